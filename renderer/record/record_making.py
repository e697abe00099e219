"""Make the records of a film and its frames, and the notes that belong to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from renderer.accuracy import NOTHING_VISIBLE, scalar_ranges
from renderer.frame import FilmStage, Frame, finest_level_at
from renderer.record.accuracy_records import film_accuracy
from renderer.record.film_record import (
    CameraRecord,
    FilmRecord,
    FrameRecord,
    LevelRecord,
    PyramidRecord,
    ScheduleRecord,
    VolumeRecord,
)
from renderer.record.finished_film import FinishedFilm
from renderer.record.visibility_records import film_visibility, range_record
from renderer.scene import (
    LevelChoice,
    format_value,
    moving_values,
    scene_to_dict,
    schedule_to_dict,
    short_text,
    with_tolerances,
)
from renderer.system import package_versions, sources_digest
from renderer.volume import Volume

# The opacity below which a pixel of 8 bits shows its background alone. A frame without larger opacities is blank.
_MIN_VISIBLE_OPACITY = 0.5 / 255


def make_frame_record(frame: Frame, film: FilmStage) -> FrameRecord:
    """Return the record of a drawn frame. The record has no digest yet. film: the stage of the film."""
    return FrameRecord(
        frame=frame.number,
        tolerance=frame.tolerance,
        cells=frame.num_cells,
        primitives=frame.num_primitives,
        seconds=frame.seconds,
        rays=None if frame.rays_per_pixel is None else round(frame.rays_per_pixel, 2),
        predicted_seconds=frame.predicted_seconds,
        blank=bool(np.max(frame.radiance[..., 3], initial=0.0) < _MIN_VISIBLE_OPACITY),
        values=None if film.maker is None else moving_values(film.scene, frame.number),
    )


def make_film_record(
    stage: FilmStage,
    frames: Sequence[FrameRecord],
    schedule: ScheduleRecord,
    *,
    devices: Sequence[str],
    notes: Sequence[str],
    seconds: float,
) -> FilmRecord:
    """Return the record of a film that was drawn.

    stage: the stage of the film. If tolerances were found for a goal, the stage's scene has them.
    devices: the devices that drew the frames. seconds: the time of the whole job.
    """
    scene, volumes = stage.scene, [_volume_record(layer.volume, layer.spec.volume.chosen) for layer in stage.layers]
    levels = [
        finest_level_at(stage.first, frame.tolerance, number) for frame in frames for number in range(len(stage.groups))
    ]
    if scene.error.goal is not None:
        scene = with_tolerances(scene, {frame.frame: frame.tolerance for frame in frames})
    pyramids = {id(layer.pyramid): layer.pyramid for layer in stage.layers}.values()
    return FilmRecord(
        scene=scene_to_dict(scene),
        volume=volumes[0],
        volumes=tuple(volumes) if len(volumes) > 1 else (),
        camera=CameraRecord(
            tuple(map(float, stage.target)), float(stage.distance), stage.shift if any(stage.shift) else None
        ),
        pyramid=PyramidRecord(
            max(each.num_levels for each in pyramids), sum(int(each.num_bytes) for each in pyramids), min(levels)
        ),
        device=" and ".join(devices),
        versions=package_versions(),
        schedule=schedule,
        notes=(*notes, *visibility_notes(frames)),
        seconds={**stage.seconds, "total": seconds},
        exposure=stage.chosen_exposure,
        accuracy=film_accuracy(frames),
        visibility=film_visibility(frames, [range_record(each) for each in scalar_ranges(stage)]),
        frames=tuple(frames),
    )


def _volume_record(volume: Volume, chosen: LevelChoice | None) -> VolumeRecord:
    shape: Any = tuple(map(int, volume.shape_xyz))
    affine = tuple(map(tuple, volume.world_from_index.tolist()))
    name, dtype = Path(volume.name).name, str(volume.values.dtype)
    level = None if chosen is None else _level_record(chosen)
    return VolumeRecord(name, volume.fingerprint, dtype, shape, affine, volume.length_unit, level)


def _level_record(chosen: LevelChoice) -> LevelRecord:
    return LevelRecord(
        chosen.number,
        chosen.num_levels,
        chosen.why,
        chosen.num_bytes,
        chosen.num_measured,
        chosen.is_exact,
        None if math.isinf(chosen.asked) else round(chosen.asked, 2),
        None if chosen.psnr is None else round(chosen.psnr, 2),
        None if chosen.least is None else round(chosen.least, 2),
    )


# Notes for the user


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


def device_notes(devices: Sequence[str]) -> list[str]:
    """Return a note if several devices drew the frames, such as the workers of a cluster."""
    if len(devices) < 2:
        return []
    return [f"bytes may differ from frame to frame, drawn by different devices: {' and '.join(devices)}"]


def shortfall_notes(original: FinishedFilm) -> list[str]:
    """Return a note if a film that is made again missed the accuracy that was requested."""
    schedule = original.record.schedule
    if schedule.met:
        return []
    goals = ", ".join(f"{name} {format_value(value)}" for name, value in schedule_to_dict(schedule.requested).items())
    return [f"the original film did not meet what was requested: {goals}"]


def version_notes(original: FinishedFilm, device: str) -> list[str]:
    """Return a note if a film is made again, with other versions of packages or another device than the original."""
    changed = changed_tools(original, device)
    if not changed:
        return []
    return [f"the bytes may differ from the original film, which had other versions: {'; '.join(changed)}"]


def changed_tools(original: FinishedFilm, device: str | None = None) -> list[str]:
    """Return `numpy 2.4.6, which was 2.0.2` for each package that had another version when a film was made.

    device: the device that draws now, which is compared like a version; None to compare packages alone.
    """
    before = original.tools
    now = package_versions() | ({} if device is None else {"device": device}) | {"sources": sources_digest()}
    return [
        f"{name} {version}, which was {short_text(before[name])}"
        for name, version in now.items()
        if name in before and before[name] != version
    ]
