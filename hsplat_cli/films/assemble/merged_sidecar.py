"""Build the sidecar of a film of parts, like that of a film that was drawn by one job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain
from typing import Any

from hsplat_cli.films.assemble.agreement import PickedFrame, error_without_schedule
from hsplat_cli.films.assemble.parts import Part
from hsplat_cli.films.fingerprint import JobFingerprint, recorded_fingerprint
from hsplat_cli.films.sidecar_record import min_max, schedule_record
from renderer.film import data_digest, film_notes, has_frame_files
from renderer.frame import visibility_notes
from renderer.scene import ErrorSpec, OutputSpec, is_film_wide_goal, schedule_from_tolerances, schedule_to_dict
from renderer.system import package_versions, sources_digest


def merged_record(picked: Sequence[PickedFrame], output: OutputSpec, seconds: float) -> dict[str, Any]:
    """Return the content of the sidecar, from which `hsplat render` makes the film again.

    seconds: what assembling took. The seconds of the parts are summed, even if they were drawn at the same time.
    """
    parts = parts_of(picked)
    first, records = parts[0].data, [frame.record for frame in picked]
    finest = min(part.data["pyramid"]["finest_level_drawn"] for part in parts)
    summed: dict[str, float] = {}
    for part in parts:
        summed |= {step: summed.get(step, 0.0) + took for step, took in part.data["seconds"].items()}
    tools = _joined_tools(parts)
    missed = dict.fromkeys(part.data["schedule"]["shortfall"] for part in parts if not part.data["schedule"]["met"])
    return {
        "scene": _scene(picked, output),
        "volume": first["volume"],
        "camera": first["camera"],
        "pyramid": first["pyramid"] | {"finest_level_drawn": finest},
        "gl": tools.pop("GL"),
        "versions": tools,
        "schedule": schedule_record(
            first["schedule"]["asked"],
            records,
            "\n".join(missed) or None,
            is_reproducible=all(part.data["schedule"]["reproducible"] for part in parts),
        ),
        "parts": [_part_record(part, picked) for part in parts],
        "notes": [*film_notes(output), *_part_notes(picked)],
        "seconds": summed | {"assembling": seconds},
        "frames": records,
    }


def parts_of(picked: Sequence[PickedFrame]) -> list[Part]:
    """Return the parts that frames are taken from, in the order of their first frames."""
    return list({frame.part.path: frame.part for frame in picked}.values())


def _part_notes(picked: Sequence[PickedFrame]) -> list[str]:
    """Return what the user should know: notes on the film, then those of its parts."""
    parts = parts_of(picked)
    first = _tools(parts[0])
    different = [f"{name} {value}" for name, value in _joined_tools(parts).items() if value != first.get(name)]
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
    parts = parts_of(picked)
    first, *others = (recorded_fingerprint(part.data) for part in parts)
    if first is None or first.frames != data_digest(first.of):
        return None
    if any(each is None or each.frames != first.frames for each in others):
        return None
    drawn = {record["frame"] for part in parts for record in part.records}
    if is_film_wide_goal(parts[0].requested_error) and not drawn <= {frame.number for frame in picked}:
        return None
    fingerprint = JobFingerprint.make(first.of, output)
    now = {"versions": package_versions(), "sources": sources_digest()}
    if has_frame_files(output) or now == {key: first.of.get(key) for key in now}:
        return fingerprint
    return replace(fingerprint, film=fingerprint.film | now)


def _scene(picked: Sequence[PickedFrame], output: OutputSpec) -> dict[str, Any]:
    part = picked[0].part
    keys = ("frames_per_second", "quality", "record_paths")
    recorded = {**part.scene["output"], "file": str(output.file), **{key: getattr(output, key) for key in keys}}
    error = part.scene["error"]
    if part.has_goal:
        found = ErrorSpec(schedule_from_tolerances({frame.number: frame.record["tolerance"] for frame in picked}))
        error = {**schedule_to_dict(found), **error_without_schedule(part)}
    return {**part.scene, "output": recorded, "error": error}


def _part_record(part: Part, picked: Sequence[PickedFrame]) -> dict[str, Any]:
    numbers = [frame.number for frame in picked if frame.part is part]
    record = {"sidecar": str(part.path), "frames": min_max(numbers), "num_frames": len(numbers)}
    measured = {key: part.data["schedule"][key] for key in part.data["schedule"].keys() & {"measured"}}
    return record | measured | {"seconds": part.data["seconds"]}


def _tools(part: Part) -> dict[str, str]:
    """Return the versions of what drew a part, OpenGL as `GL`."""
    return {**part.data["versions"], "GL": part.data["gl"]}


def _joined_tools(parts: Sequence[Part]) -> dict[str, str]:
    """Return the versions of what drew the parts, joined where they differ."""
    tools = [_tools(part) for part in parts]
    names = dict.fromkeys(chain(*tools))
    return {name: " and ".join(dict.fromkeys(each.get(name, "unknown") for each in tools)) for name in names}
