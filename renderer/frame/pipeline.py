"""The program's table of contents: from a scene to its frames, and the only frame loop.

Scene -> Volume -> Pyramid -> (per frame: View, tolerance) -> Cut -> splats or bricks -> float image -> 8 bits
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from renderer.bricks import Bricks, extreme_bricks, make_bricks
from renderer.draw import Rasterizer
from renderer.errors import InputError, Problem
from renderer.frame.budget import ScheduleController, ToleranceController
from renderer.frame.frame import Frame, draw_frame
from renderer.frame.stage import Clock, Stage, Stopwatch
from renderer.lighting import compute_light_grid
from renderer.modes import make_projection
from renderer.pyramid import FinestCut, Pyramid, build_pyramid
from renderer.readers import read_volume
from renderer.scene import (
    Scene,
    Vector,
    camera_problems,
    format_value,
    min_tolerance,
    raise_problems,
    volume_extent,
    volume_problems,
    with_draw_order,
)
from renderer.splats import GAUSSIAN_CUTOFF
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.view import (
    ClipRegion,
    are_clipped_away,
    corners_around,
    finest_useful_level,
    fit_distance,
    make_order_blending,
    place_clips,
    smallest_voxel_px,
    visible_centre,
    visible_points,
    volume_corners,
)
from renderer.volume import Float64, Volume

# Splats reach beyond their cells: further than the frame's margin, if so few voxels fill it. Studies compare footprints
# of larger volumes in the same frame.
_MAX_SIDE_OF_SMALL = 24


def prepare_stage(
    scene: Scene,
    *,
    clock: Clock,
    num_threads: int,
    volume: Volume | None = None,
    fingerprint: str | None = None,
    recorded_in: str = "",
    any_tolerance: bool = False,
) -> Stage:
    """Read the volume, build the pyramid, and frame what is visible. Raises InputError for an unusable volume.

    volume: drawn in place of the scene's volume, which is then not read.
    fingerprint: the fingerprint that the volume must have. recorded_in: where it was recorded, for the message.
    any_tolerance: build the pyramid for every tolerance and level, as bricks always do, and not only for those that
        the scene's schedule can ask for.
    """
    scene = with_draw_order(scene)
    watch, camera, size = Stopwatch(clock), scene.camera, scene.output.size
    volume = read_volume(scene.volume) if volume is None else volume
    if fingerprint is not None:
        _require_fingerprint(volume, fingerprint, recorded_in)
    extent = volume_extent(volume)
    raise_problems([*volume_problems(extent, volume.name), *camera_problems(camera, size, extent)])
    watch.lap("read")
    transfer = make_transfer_function(scene.transfer_function, volume.finest_spacing)
    projection = make_projection(scene.mode, transfer, volume)
    if projection is not None:
        transfer = projection.optics
    clip = _object_clip(scene, volume)
    build: dict[str, Any] = {"num_threads": num_threads}
    if scene.shading is not None and scene.shading.has_light_grid:
        are_removed = None if clip is None else partial(are_clipped_away, clip)
        build["light_grid"] = compute_light_grid(volume, transfer, scene.shading, are_removed=are_removed, **build)
        watch.lap("light")
    if scene.splat.footprint != "integrated" and not any_tolerance:
        build["finest_cut"] = FinestCut(min_tolerance(scene.error), scene.error.finest_level)
    pyramid, bricks = _build_levels(scene, volume, transfer, **build)
    extremes = None
    if bricks is not None and scene.mode.is_extremum:
        extremes = extreme_bricks(bricks, scene.mode, num_threads=num_threads)
    watch.lap("pyramid")
    points = visible_points(pyramid, clip if camera.target == "visible" else None)
    target, distance = _framing(scene, volume, volume_corners(volume) if scene.overlay == "bounds" else points)
    raise_problems(camera_problems(replace(camera, target=target, distance=distance), size, extent))
    raise_problems(_clip_problems(scene, volume))
    finest_level = finest_useful_level(volume, points, camera, target, distance, size)
    voxel_px = smallest_voxel_px(volume, camera, target, distance, size)
    order_blending = make_order_blending(volume.world_from_index, camera.path)
    watch.lap("framing")
    return Stage(
        scene,
        volume,
        pyramid,
        target,
        distance,
        finest_level,
        voxel_px,
        order_blending,
        bricks,
        projection,
        extremes,
        watch.seconds,
    )


def _require_fingerprint(volume: Volume, fingerprint: str, recorded_in: str) -> None:
    if volume.fingerprint != fingerprint:
        raise InputError(
            "the film was made from another volume",
            where=recorded_in or None,
            got=f"the fingerprint {volume.fingerprint} of {volume.name}",
            expected=fingerprint,
            hint="if the volume was moved, name it with --volume; draw another volume with another scene",
        )


def _build_levels(
    scene: Scene, volume: Volume, transfer: TransferFunction, **options: Any
) -> tuple[Pyramid, Bricks | None]:
    """Build the pyramid, and the bricks if the footprint is drawn from them. options: of `build_pyramid`."""
    baked = scene.shading and scene.shading.lambert  # other shading is left to samples between voxels
    options |= {"spec": scene.pyramid, "error": scene.error, "shading": baked}
    if scene.splat.footprint != "integrated":
        return build_pyramid(volume, transfer, **options), None
    bricks = make_bricks(volume, transfer, **options)
    return bricks.pyramid, bricks


@contextlib.contextmanager
def open_stage(scene: Scene, **options: Any) -> Iterator[Stage]:
    """Prepare a stage for the block, which owns its memory; parameters and errors are those of `prepare_stage`."""
    stage = prepare_stage(scene, **options)
    try:
        yield stage
    finally:
        stage.close()


def render_frames(
    stage: Stage,
    frames: Sequence[int],
    rasterizer: Rasterizer,
    *,
    clock: Clock,
    controller: ToleranceController | None = None,
) -> Iterator[Frame]:
    """Draw these frames of the film, in this order. The tolerances are the controller's, or those of the schedule."""
    controller = ScheduleController(stage) if controller is None else controller
    for number in frames:
        watch = Stopwatch(clock)
        draw_list, predicted_seconds = controller.prepare_frame(number, watch)
        yield replace(draw_frame(stage, draw_list, rasterizer, watch), predicted_seconds=predicted_seconds)
        controller.finish_frame(draw_list, watch)


def _object_clip(scene: Scene, volume: Volume) -> ClipRegion | None:
    """Return what the planes and boxes that turn with the object leave."""
    return place_clips(volume, [each for each in scene.clip if each.fixed == "object"])


def _clip_problems(scene: Scene, volume: Volume) -> Iterator[Problem]:
    """Yield the clip planes and boxes, fixed to the object, that leave nothing of it."""
    half = np.array(volume.shape_xyz) / 2
    reach = np.abs(volume.world_from_index[:3, :3]) @ half
    low, high = (format_value(corner.tolist()) for corner in (volume.centre - reach, volume.centre + reach))
    for number, each in enumerate(scene.clip):
        clip = place_clips(volume, [each]) if each.fixed == "object" else None
        if clip is not None and are_clipped_away(clip, np.array([[-half, half]]))[0]:
            expected = f"one that leaves some of it; it reaches from {low} to {high}"
            yield Problem(f"clip.{number}", "leaves nothing of the volume", expected=expected)


def _framing(scene: Scene, volume: Volume, points: Float64) -> tuple[Vector, float]:
    """Return target and distance: the scene's, or such that the whole path has these points in frame."""
    camera = scene.camera
    if camera.target == "visible":
        target = visible_centre(points)
    elif camera.target is None:
        x, y, z = volume.centre
        target = float(x), float(y), float(z)
    else:
        target = camera.target
    if camera.distance is not None:
        return target, camera.distance
    distance = fit_distance(camera, points, target, scene.output.size)
    if scene.splat.footprint != "integrated" and max(volume.shape_xyz) <= _MAX_SIDE_OF_SMALL:
        reach = GAUSSIAN_CUTOFF * scene.splat.sigma - 0.5
        whole = corners_around(volume, points, reach)
        distance = max(distance, fit_distance(camera, whole, target, scene.output.size, margin=0.0))
    return target, distance
