"""The sidecar of a film of parts: like that of a film that was drawn by one job."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from hsplat_cli.films.assemble.agreement import PickedFrame, error_without_schedule
from hsplat_cli.films.assemble.parts import Part
from hsplat_cli.films.fingerprint import JobFingerprint, recorded_fingerprint
from hsplat_cli.films.sidecar_record import min_max
from renderer.film import Record, bytes_digest, has_frame_files
from renderer.frame import visibility_notes
from renderer.scene import ErrorSpec, OutputSpec, is_film_wide_goal, schedule_from_tolerances, schedule_to_dict
from renderer.versions import package_versions, sources_digest


def merged_record(picked: Sequence[PickedFrame], output: OutputSpec, seconds: float) -> dict[str, Any]:
    """Return the content of the sidecar, from which `hsplat render` makes the film again.

    seconds: what assembling took. The seconds of the parts are summed, even if they were drawn at the same time.
    """
    parts = parts_of(picked)
    first, records = parts[0].data, [frame.record for frame in picked]
    finest = min(part.data["pyramid"]["finest_level_drawn"] for part in parts)
    steps = dict.fromkeys(step for part in parts for step in part.data["seconds"])
    summed = {step: sum(part.data["seconds"].get(step, 0.0) for part in parts) for step in steps}
    return {
        "scene": _scene(picked, output),
        "volume": first["volume"],
        "camera": first["camera"],
        "pyramid": first["pyramid"] | {"finest_level_drawn": finest},
        "gl": _joined_text(part.data["gl"] for part in parts),
        "versions": _versions(parts),
        "schedule": _schedule(parts, records),
        "parts": [_part_record(part, picked) for part in parts],
        "notes": [],
        "seconds": summed | {"assembling": seconds},
        "frames": records,
    }


def parts_of(picked: Sequence[PickedFrame]) -> list[Part]:
    """Return the parts that frames are taken from, in the order of their first frames."""
    return list({frame.part.path: frame.part for frame in picked}.values())


def part_notes(picked: Sequence[PickedFrame]) -> list[str]:
    """Return what the user should know: notes on the film, then those of its parts."""
    parts = parts_of(picked)
    versions = _versions(parts) | {"GL": _joined_text(part.data["gl"] for part in parts)}
    of_parts = [{**part.data["versions"], "GL": part.data["gl"]} for part in parts]
    different = [
        f"{name} {value}" for name, value in versions.items() if len({each.get(name) for each in of_parts}) > 1
    ]
    notes = [f"bytes may differ from part to part, drawn with different versions: {'; '.join(different)}"]
    notes = notes * bool(different) + visibility_notes([frame.record for frame in picked])
    missed = [part for part in parts if not part.data["schedule"]["met"]]
    if missed:
        notes.append(f"{len(missed)} of {len(parts)} parts did not meet what was requested, the first {missed[0].path}")
    for part in parts:
        own = visibility_notes(part.records)
        notes += [note for note in part.data["notes"] if note not in own]
    return list(dict.fromkeys(notes))


def parts_fingerprint(picked: Sequence[PickedFrame], output: OutputSpec) -> JobFingerprint | None:
    """Return the fingerprint of the film as one job would draw it, or None where no job would draw this film.

    The parts need the same fingerprint. A goal for all frames together was met by whole parts only. A film that is
    encoded by another version than drew the frames has a fingerprint of its own.
    """
    parts, numbers = parts_of(picked), [frame.number for frame in picked]
    first, *others = (recorded_fingerprint(part.data) for part in parts)
    if first is None or not first.is_intact or any(each is None or each.frames != first.frames for each in others):
        return None
    drawn = {record["frame"] for part in parts for record in part.records}
    if is_film_wide_goal(parts[0].requested_error) and not drawn <= {*numbers}:
        return None
    fingerprint = JobFingerprint.make(first.of, output, numbers)
    before = _encoder_versions(first.of)
    now = _encoder_versions({"versions": package_versions(), "sources": sources_digest()})
    if has_frame_files(output) or before == now:
        return fingerprint
    return replace(fingerprint, film=bytes_digest(json.dumps([fingerprint.film, now]).encode()))


def _encoder_versions(of: Any) -> list[Any]:
    """Return what the bytes of a film depend on besides its pictures, from the data of a fingerprint."""
    data = of if isinstance(of, dict) else {}
    versions = data.get("versions")
    return [versions.get("imageio-ffmpeg") if isinstance(versions, dict) else None, data.get("sources")]


def _scene(picked: Sequence[PickedFrame], output: OutputSpec) -> dict[str, Any]:
    part = picked[0].part
    coding = {"frames_per_second": output.frames_per_second, "quality": output.quality}
    recorded = {**part.scene["output"], "file": str(output.file), **coding}
    error = part.scene["error"]
    if part.has_goal:
        found = ErrorSpec(schedule_from_tolerances({frame.number: frame.record["tolerance"] for frame in picked}))
        error = {**schedule_to_dict(found), **error_without_schedule(part)}
    return {**part.scene, "output": recorded, "error": error}


def _schedule(parts: Sequence[Part], records: Sequence[Record]) -> dict[str, Any]:
    schedules = [part.data["schedule"] for part in parts]
    measured = [each["measured"] for each in schedules if "measured" in each]
    missed = list(dict.fromkeys(each["shortfall"] for each in schedules if "shortfall" in each))
    record: dict[str, Any] = {
        "asked": schedules[0]["asked"],
        "tolerance": min_max(record["tolerance"] for record in records),
        "cells": min_max(record["cells"] for record in records),
        "met": all(each["met"] for each in schedules),
        "reproducible": all(each["reproducible"] for each in schedules),
    }
    if measured:
        record["measured"] = _worst_measurement(measured)
    if missed:
        record["shortfall"] = "\n".join(missed)
    return record


def _worst_measurement(measured: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the least accurate of the parts' measurements, with the probe frames of all parts.

    A higher PSNR is better, and None stands for an infinite one; lower values of other metrics are better.
    """
    known = [each for each in measured if each["worst"] is not None] or measured
    worst = known[0]
    if worst["worst"] is not None:
        worst = (min if worst["metric"] == "psnr" else max)(known, key=lambda each: each["worst"])
    return {**worst, "probes": sorted({probe for each in measured for probe in each["probes"]})}


def _part_record(part: Part, picked: Sequence[PickedFrame]) -> dict[str, Any]:
    numbers = [frame.number for frame in picked if frame.part is part]
    seconds = part.data["seconds"]
    return {"sidecar": str(part.path), "frames": min_max(numbers), "num_frames": len(numbers), "seconds": seconds}


def _versions(parts: Sequence[Part]) -> dict[str, Any]:
    names = dict.fromkeys(name for part in parts for name in part.data["versions"])
    return {name: _joined_text(part.data["versions"].get(name) for part in parts) for name in names}


def _joined_text(values: Iterable[Any]) -> str:
    return " and ".join(dict.fromkeys("unknown" if value is None else str(value) for value in values))
