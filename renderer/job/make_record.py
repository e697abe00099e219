"""Make the records of a film and its frames, and the notes that belong to them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from renderer.accuracy import NOTHING_VISIBLE, scalar_ranges
from renderer.errors import RenderError
from renderer.frame import FilmStage, Frame, finest_level_at
from renderer.job.film_accuracy import film_accuracy
from renderer.job.film_job import OriginalFilm
from renderer.job.film_visibility import film_visibility, range_record
from renderer.job.plan import FilmPlan
from renderer.job.record import (
    CameraRecord,
    FilmRecord,
    FrameRecord,
    MeasuredRecord,
    PyramidRecord,
    ScheduleRecord,
    VolumeRecord,
    min_max,
)
from renderer.scene import (
    ErrorSpec,
    format_value,
    moving_values,
    scene_to_dict,
    schedule_to_dict,
    short_text,
    with_tolerances,
)
from renderer.system import package_versions, sources_digest
from renderer.volume import Volume

_MIN_VISIBLE_OPACITY = 0.5 / 255  # less opacity than this changes no pixel of 8 bits


def frame_record(frame: Frame, film: FilmStage) -> FrameRecord:
    """Return the record of a frame of a film that was drawn; it has no digest yet."""
    return FrameRecord(
        frame=frame.number,
        tolerance=frame.tolerance,
        cells=frame.num_cells,
        primitives=frame.num_primitives,
        seconds=frame.seconds,
        predicted_seconds=frame.predicted_seconds,
        blank=bool(np.max(frame.radiance[..., 3], initial=0.0) < _MIN_VISIBLE_OPACITY),
        values=None if film.maker is None else moving_values(film.scene, frame.number),
    )


def film_record(
    plan: FilmPlan,
    frames: Sequence[FrameRecord],
    requested: ErrorSpec,
    original: OriginalFilm | None,
    shortfall: RenderError | None,
    devices: Sequence[str],
) -> FilmRecord:
    """Return the record of a film that was drawn, without its seconds. devices: what drew the frames."""
    stage = plan.stage
    scene, volumes = stage.scene, [layer.volume for layer in stage.layers]
    levels = [
        finest_level_at(stage.first, frame.tolerance, number) for frame in frames for number in range(len(stage.groups))
    ]
    if scene.error.goal is not None:
        scene = with_tolerances(scene, {frame.frame: frame.tolerance for frame in frames})
    device, pyramids = " and ".join(devices), {id(layer.pyramid): layer.pyramid for layer in stage.layers}.values()
    differ = f"bytes may differ from frame to frame, drawn by different devices: {device}"  # kept frames, or workers
    return FilmRecord(
        scene=scene_to_dict(scene),
        volume=_volume_record(volumes[0]),
        volumes=tuple(map(_volume_record, volumes)) if len(volumes) > 1 else (),
        camera=CameraRecord(tuple(map(float, stage.target)), float(stage.distance)),
        pyramid=PyramidRecord(
            max(each.num_levels for each in pyramids), sum(int(each.num_bytes) for each in pyramids), min(levels)
        ),
        device=device,
        versions=package_versions(),
        schedule=_plan_record(plan, frames, requested, original, shortfall),
        notes=(
            *[differ] * (len(devices) > 1),
            *(original_notes(original, device) if original else ()),
            *visibility_notes(frames),
        ),
        seconds={},
        accuracy=film_accuracy(frames),
        visibility=film_visibility(frames, [range_record(each) for each in scalar_ranges(stage)]),
        frames=tuple(frames),
    )


def _volume_record(volume: Volume) -> VolumeRecord:
    shape: Any = tuple(map(int, volume.shape_xyz))
    affine = tuple(map(tuple, volume.world_from_index.tolist()))
    name, dtype = Path(volume.name).name, str(volume.values.dtype)
    return VolumeRecord(name, volume.fingerprint, dtype, shape, affine, volume.length_unit)


def _plan_record(
    plan: FilmPlan,
    frames: Sequence[FrameRecord],
    requested: ErrorSpec,
    original: OriginalFilm | None,
    shortfall: RenderError | None,
) -> ScheduleRecord:
    """Return the record of the accuracy; what was measured of an original holds while the same is requested."""
    schedule = ScheduleRecord(
        requested,
        min_max([frame.tolerance for frame in frames]),
        min_max([frame.cells for frame in frames]),
        met=shortfall is None,
        reproducible=not plan.is_timing_dependent,
        shortfall=None if shortfall is None else str(shortfall),
        measured=_measured_record(plan),
    )
    if original is None:
        return schedule
    schedule, before = replace(schedule, made_from=original.path.name), original.record.schedule
    if plan.is_unfinished or not original.keeps_accuracy or requested != before.requested:
        return schedule
    return replace(before, tolerance=schedule.tolerance, cells=schedule.cells, made_from=schedule.made_from)


def _measured_record(plan: FilmPlan) -> MeasuredRecord | None:
    """Return the record of the search for an accuracy, if there was one."""
    found = plan.found
    if found is None:
        return None
    value = found.worst.value if isfinite(found.worst.value) else None  # the PSNR of equal pictures
    return MeasuredRecord(found.want.metric, found.worst.frame, found.tried, value)


# Notes


def visibility_notes(frames: Sequence[FrameRecord]) -> list[str]:
    """Return notes for the user if nothing is visible on some or all pictures."""
    if all(frame.cells == 0 for frame in frames):
        return [NOTHING_VISIBLE]
    empty = [frame for frame in frames if frame.primitives == 0 or frame.blank]
    if not empty:
        return []
    among = f" on {len(empty)} of {len(frames)} frames, the first of them frame {empty[0].frame}" * (len(frames) > 1)
    why = ": the volume is out of the picture, nearer than `camera.near`, too small or too transparent"
    return [f"nothing is in view{among}{why if any(frame.primitives for frame in empty) else ''}"]


def original_notes(original: OriginalFilm, device: str) -> Iterator[str]:
    """Yield notes on a film that is made again: a goal that the original missed, and other versions."""
    record = original.record
    if original.keeps_accuracy and not record.schedule.met:
        requested = schedule_to_dict(record.schedule.requested).items()
        goals = ", ".join(f"{name} {format_value(value)}" for name, value in requested)
        yield f"the original film did not meet what was requested: {goals}"
    now = package_versions() | {"device": device, "sources": sources_digest()}
    changed = changed_tools(original, now)
    if changed:
        yield f"the bytes may differ from the original film, which had other versions: {'; '.join(changed)}"


def changed_tools(original: OriginalFilm, now: Mapping[str, str]) -> list[str]:
    """Return `numpy 2.4.6, which was 2.0.2` for what has another version than made an original film."""
    before = original.tools
    return [
        f"{name} {version}, which was {short_text(before[name])}"
        for name, version in now.items()
        if name in before and before[name] != version
    ]
