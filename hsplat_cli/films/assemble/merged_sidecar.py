"""The sidecar of a film of parts: like that of a film that was drawn in one go."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

from hsplat_cli.films.assemble.agreement import PickedFrame, error_without_schedule, has_goal
from hsplat_cli.films.assemble.parts import Part
from hsplat_cli.films.fingerprint import JobFingerprint, recorded_fingerprint
from hsplat_cli.films.sidecar_record import limits
from renderer.film import Record, bytes_digest, has_frame_files
from renderer.frame import visibility_notes
from renderer.scene import ErrorSpec, OutputSpec, is_film_wide_goal, schedule_from_tolerances, schedule_to_dict
from renderer.versions import package_versions, sources_digest


def merged_record(picked: Sequence[PickedFrame], output: OutputSpec, seconds: float) -> dict[str, Any]:
    """From which `hsplat render` makes the film again; `seconds` is what putting it together took.

    Seconds of the parts are summed, whether they were drawn one after the other or at once.
    """
    parts = parts_of(picked)
    first, records = parts[0], [frame.record for frame in picked]
    pyramid = [part.data.get("pyramid", {}) for part in parts]
    finest = [found["finest_level_drawn"] for found in pyramid if "finest_level_drawn" in found]
    return {
        "scene": _scene(picked, output),
        "volume": first.data["volume"],
        "camera": first.data.get("camera", {}),
        "pyramid": pyramid[0] | ({"finest_level_drawn": min(finest)} if finest else {}),
        "gl": _joined_text(part.data.get("gl") for part in parts),
        "versions": _versions(parts),
        "schedule": _schedule(parts, records),
        "parts": [_part_record(part, picked) for part in parts],
        "notes": [],
        "seconds": {**_sum_by_name(part.data.get("seconds", {}) for part in parts), "assembling": seconds},
        "frames": records,
    }


def parts_of(picked: Sequence[PickedFrame]) -> list[Part]:
    """Those that frames are taken from, in the order of their first ones."""
    return list({frame.part.path: frame.part for frame in picked}.values())


def part_notes(picked: Sequence[PickedFrame]) -> list[str]:
    """What the user should know: of the film, and what was told of its parts."""
    parts = parts_of(picked)
    different = [
        f"{name} {value}"
        for name, value in {**_versions(parts), "GL": _joined_text(part.data.get("gl") for part in parts)}.items()
        if len({_part_versions(part).get(name) for part in parts}) > 1
    ]
    notes = [f"bytes may differ from part to part, made with different versions: {'; '.join(different)}"]
    notes = notes * bool(different) + visibility_notes([frame.record for frame in picked])
    missed = [part for part in parts if part.data.get("schedule", {}).get("met") is False]
    if missed:
        notes.append(f"{len(missed)} of {len(parts)} parts did not meet what was asked for, the first {missed[0].path}")
    for part in parts:
        own = visibility_notes(part.records)
        notes += [note for note in part.data.get("notes", []) if note not in own]
    return list(dict.fromkeys(notes))


def parts_fingerprint(picked: Sequence[PickedFrame], output: OutputSpec) -> JobFingerprint | None:
    """What a film drawn in one go would depend on, too, where that is one and the same for all parts.

    A goal that is one of the frames together was met by whole parts. A film that another version encodes than drew its
    frames is none that could be drawn in one go.
    """
    parts, numbers = parts_of(picked), [frame.number for frame in picked]
    first, *others = (recorded_fingerprint(part.data) for part in parts)
    if first is None or not first.is_intact or any(each is None or each.frames != first.frames for each in others):
        return None
    asked, drawn = parts[0].asked, {record["frame"] for part in parts for record in part.records}
    if asked is not None and is_film_wide_goal(asked) and not drawn <= {*numbers}:
        return None
    cause = JobFingerprint.make(first.of, output, numbers)
    before, now = (
        _encoder_versions(first.of),
        _encoder_versions({"versions": package_versions(), "sources": sources_digest()}),
    )
    if has_frame_files(output) or before == now:
        return cause
    return replace(cause, film=bytes_digest(json.dumps([cause.film, now]).encode()))


def _encoder_versions(of: Any) -> list[Any]:
    """What the bytes of a film depend on besides its pictures, in what a film depends on."""
    told = of if isinstance(of, dict) else {}
    versions = told.get("versions")
    return [versions.get("imageio-ffmpeg") if isinstance(versions, dict) else None, told.get("sources")]


def _scene(picked: Sequence[PickedFrame], output: OutputSpec) -> dict[str, Any]:
    part = picked[0].part
    coding = {"frames_per_second": output.frames_per_second, "quality": output.quality}
    recorded = {**part.scene["output"], "file": str(output.file), **coding}
    error = part.scene["error"]
    if has_goal(part):
        found = ErrorSpec(schedule_from_tolerances({frame.number: frame.record["tolerance"] for frame in picked}))
        error = {**schedule_to_dict(found), **error_without_schedule(part)}
    return {**part.scene, "output": recorded, "error": error}


def _schedule(parts: Sequence[Part], records: Sequence[Record]) -> dict[str, Any]:
    told = [part.data.get("schedule", {}) for part in parts]
    measured = [each["measured"] for each in told if "measured" in each]
    missed = list(dict.fromkeys(each["shortfall"] for each in told if "shortfall" in each))
    record = {
        "asked": told[0].get("asked"),
        "tolerance": limits(record["tolerance"] for record in records),
        "cells": limits(record["cells"] for record in records),
        "met": all(each.get("met", True) for each in told),
        "reproducible": all(each.get("reproducible", True) for each in told),
    }
    return (
        record
        | ({"measured": _worst(measured)} if measured else {})
        | ({"shortfall": "\n".join(missed)} if missed else {})
    )


def _worst(measured: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The measurement of the part that is the furthest from the truth, with the probes of all.

    A PSNR is better the higher it is, infinite as None; an RMSE the lower.
    """
    known = [each for each in measured if each.get("worst") is not None] or list(measured)
    pick = min if known[0].get("metric") == "psnr" else max
    worst = known[0] if known[0].get("worst") is None else pick(known, key=lambda each: each["worst"])
    return {**worst, "probes": sorted({probe for each in measured for probe in each.get("probes", [])})}


def _part_record(part: Part, picked: Sequence[PickedFrame]) -> dict[str, Any]:
    numbers = [frame.number for frame in picked if frame.part is part]
    seconds = part.data.get("seconds", {})
    return {"sidecar": str(part.path), "frames": limits(numbers), "num_frames": len(numbers), "seconds": seconds}


def _part_versions(part: Part) -> dict[str, Any]:
    return {**part.data.get("versions", {}), "GL": part.data.get("gl")}


def _versions(parts: Sequence[Part]) -> dict[str, Any]:
    names = dict.fromkeys(name for part in parts for name in part.data.get("versions", {}))
    return {name: _joined_text(part.data.get("versions", {}).get(name) for part in parts) for name in names}


def _joined_text(values: Iterator[Any]) -> str:
    return " and ".join(dict.fromkeys("unknown" if value is None else str(value) for value in values))


def _sum_by_name(all_seconds: Iterator[Mapping[str, float]]) -> dict[str, float]:
    summed: dict[str, float] = {}
    for seconds in all_seconds:
        for name, value in seconds.items():
            summed[name] = summed.get(name, 0.0) + value
    return summed
