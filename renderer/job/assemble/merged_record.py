"""Merge the records of parts to the record of their film, as one job would have made it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain

from renderer.film import data_digest, film_notes
from renderer.record import (
    FilmFingerprint,
    FilmRecord,
    FinishedFilm,
    FrameFile,
    PartRecord,
    ScheduleRecord,
    film_accuracy,
    film_visibility,
    fingerprint_of,
    min_max,
    visibility_notes,
)
from renderer.scene import (
    ErrorSpec,
    OutputSpec,
    found_path,
    is_film_wide_goal,
    schedule_from_tolerances,
    schedule_to_dict,
    spec_to_dict,
    with_files,
)
from renderer.system import package_versions, sources_digest


def merged_record(picked: Sequence[FrameFile], output: OutputSpec, seconds: float) -> FilmRecord:
    """Return the record of a film that is assembled of these frames. From it, `hsplat render` makes the film again.

    seconds: the time of assembling. In the record, the seconds of the parts are summed, even if the parts were drawn at
    the same time.
    """
    parts = parts_of(picked)
    first, frames = parts[0].record, [frame.record for frame in picked]
    finest = min(part.record.pyramid.finest_level_drawn for part in parts)
    summed: dict[str, float] = {}
    for part in parts:
        summed |= {step: summed.get(step, 0.0) + took for step, took in part.record.seconds.items()}
    tools = _joined_tools(parts)
    device = tools.pop("device")
    shown = next((part.record.visibility.ranges for part in parts if part.record.visibility), ())
    exposures = {part.record.exposure for part in parts}
    missed = dict.fromkeys(part.record.schedule.shortfall for part in parts if not part.record.schedule.met)
    return FilmRecord(
        scene=_scene(picked, output),
        volume=first.volume,
        camera=first.camera,
        pyramid=replace(first.pyramid, finest_level_drawn=finest),
        device=device,
        versions=tools,
        schedule=ScheduleRecord(
            first.schedule.requested,
            min_max([frame.tolerance for frame in frames]),
            min_max([frame.cells for frame in frames]),
            met=not missed,
            reproducible=all(part.record.schedule.reproducible for part in parts),
            shortfall="\n".join(filter(None, missed)) or None,
        ),
        notes=(*film_notes(output), *_part_notes(picked)),
        seconds=summed | {"assembling": seconds},
        frames=tuple(frames),
        accuracy=film_accuracy(frames),
        visibility=film_visibility(frames, shown),
        exposure=first.exposure if len(exposures) == 1 else None,
        parts=tuple(_part_record(part, picked) for part in parts),
    )


def parts_of(picked: Sequence[FrameFile]) -> list[FinishedFilm]:
    """Return the parts of these frames, in the order of their first frames."""
    return list({frame.film.path: frame.film for frame in picked}.values())


def _part_notes(picked: Sequence[FrameFile]) -> list[str]:
    """Return the notes for the user on the film of these frames: first on the film, then the notes of its parts."""
    parts = parts_of(picked)
    first = _tools(parts[0])
    different = [f"{name} {value}" for name, value in _joined_tools(parts).items() if value != first.get(name)]
    notes = [f"bytes may differ from part to part, drawn with different versions: {'; '.join(different)}"]
    notes = notes * bool(different) + visibility_notes([frame.record for frame in picked])
    missed = [part for part in parts if not part.record.schedule.met]
    if missed:
        notes.append(
            f"{len(missed)} of {len(parts)} parts did not meet what was requested, the first {missed[0].path.name}"
        )
    for part in parts:
        own = visibility_notes(part.record.frames)
        notes += [note for note in part.record.notes if note not in own]
    return list(dict.fromkeys(notes))


def parts_fingerprint(picked: Sequence[FrameFile], output: OutputSpec) -> FilmFingerprint | None:
    """Return the fingerprint of the film as one job would draw it; None if no single job would draw this film.

    All parts must have the same fingerprint. If the goal is for all frames of a film together, all frames of each part
    must be taken, since only together they meet the goal. A film that is encoded by other versions of packages than
    those that drew its frames has a fingerprint of its own.
    """
    parts = parts_of(picked)
    first, *others = (part.record.fingerprint for part in parts)
    if first is None or first.frames_digest != data_digest(first.depends_on):
        return None
    if any(each is None or each.frames_digest != first.frames_digest for each in others):
        return None
    drawn = {number for part in parts for number in part.record.numbers}
    requested = parts[0].record.schedule.requested
    if is_film_wide_goal(requested) and not drawn <= {frame.number for frame in picked}:
        return None
    fingerprint = fingerprint_of(first.depends_on, output)
    now = {"versions": package_versions(), "sources": sources_digest()}
    if all(each.is_frames for each in output.files) or now == {key: first.depends_on.get(key) for key in now}:
        return fingerprint
    return replace(fingerprint, encoding={**fingerprint.encoding, **now})


def _scene(picked: Sequence[FrameFile], output: OutputSpec) -> dict[str, object]:
    part = picked[0].film
    scene = with_files(part.record.scene, lambda _, file: found_path(file, part.path.parent))
    error = scene["error"]
    if part.has_goal:
        found = ErrorSpec(schedule_from_tolerances({frame.number: frame.record.tolerance for frame in picked}))
        error = schedule_to_dict(found) | {key: value for key, value in error.items() if key != "tolerance"}
    return {**scene, "output": spec_to_dict(output), "error": error}


def _part_record(part: FinishedFilm, picked: Sequence[FrameFile]) -> PartRecord:
    numbers = [frame.number for frame in picked if frame.film is part]
    measured = part.record.schedule.measured
    return PartRecord(str(part.path), min_max(numbers), len(numbers), part.record.seconds, measured)


def _tools(part: FinishedFilm) -> dict[str, str]:
    """Return the versions of the packages that drew a part, and the device."""
    return {**part.record.versions, "device": part.record.device}


def _joined_tools(parts: Sequence[FinishedFilm]) -> dict[str, str]:
    """Return the versions of the packages that drew the parts, and the devices, joined where they differ."""
    tools = [_tools(part) for part in parts]
    names = dict.fromkeys(chain(*tools))
    return {name: " and ".join(dict.fromkeys(each.get(name, "unknown") for each in tools)) for name in names}
