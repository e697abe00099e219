"""The program's table of contents: from a scene to its frames, and the only frame loop.

Scene -> Volume -> Pyramid -> (per frame: View, tolerance) -> Cut -> splats or bricks -> float image -> 8 bits
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from renderer.draw import Rasterizer
from renderer.errors import InputError, Problem
from renderer.frame.budget import ScheduleController, ToleranceController
from renderer.frame.frame import Frame, draw_frame
from renderer.frame.stage import Clock, Resolution, Stage, Stopwatch
from renderer.layers import (
    Layer,
    LayerGroup,
    group_layers,
    layer_digest,
    make_layer,
    mask_volume,
    placement_problems,
    reach_text,
)
from renderer.pyramid import EVERY_CUT, FinestCut
from renderer.readers import read_volume
from renderer.scene import (
    ClipSpec,
    Scene,
    Vector,
    VolumeSpec,
    camera_problems,
    min_tolerance,
    raise_problems,
    volume_extent,
    volume_problems,
    with_draw_order,
)
from renderer.splats import GAUSSIAN_CUTOFF
from renderer.view import (
    are_clipped_away,
    corners_around,
    finest_useful_level,
    fit_distance,
    make_order_blending,
    place_object_clips,
    smallest_voxel_px,
    visible_centre,
    visible_points,
    volume_corners,
)
from renderer.volume import Float64, Volume, joint_fingerprint, move_volume

# Splats reach beyond their cells: further than the frame's margin, if so few voxels fill it. Studies compare footprints
# of larger volumes in the same frame.
_MAX_SIDE_OF_SMALL = 24


def prepare_stage(
    scene: Scene,
    *,
    clock: Clock,
    num_threads: int,
    volumes: Sequence[Volume] | None = None,
    fingerprint: str | None = None,
    recorded_in: str = "",
    any_tolerance: bool = False,
) -> Stage:
    """Read the volumes, make their layers, and frame what is visible. Raises InputError for an unusable volume.

    volumes: drawn in place of the scene's volumes, which are then not read.
    fingerprint: the joint fingerprint that the volumes must have. recorded_in: where it was recorded, for the message.
    any_tolerance: build the pyramid for every tolerance and level, as bricks always do, and not only for those that
        the scene's schedule can ask for.
    """
    scene = with_draw_order(scene)
    watch, camera, size = Stopwatch(clock), scene.camera, scene.output.size
    volumes = read_volumes(scene) if volumes is None else volumes
    if fingerprint is not None:
        _require_fingerprint(volumes, fingerprint, recorded_in)
    extents = [volume_extent(volume) for volume in volumes]
    for volume, extent in zip(volumes, extents, strict=True):
        raise_problems([*volume_problems(extent, volume.name), *camera_problems(camera, size, extent)])
    raise_problems(placement_problems(volumes))
    watch.lap("read")
    layers = _make_layers(scene, volumes, any_tolerance=any_tolerance, num_threads=num_threads, lap=watch.lap)
    groups = group_layers(layers, scene)
    points = [_visible_points(scene, group) for group in groups]
    shown = [volume_corners(volume) for volume in volumes] if scene.overlay == "bounds" else points
    target, distance = _framing(scene, volumes, np.concatenate(shown))
    for extent in extents:
        raise_problems(camera_problems(replace(camera, target=target, distance=distance), size, extent))
    raise_problems(_clip_problems(scene, volumes))
    resolutions = [
        Resolution(
            finest_useful_level(group.volume, of_group, camera, target, distance, size),
            smallest_voxel_px(group.volume, camera, target, distance, size),
        )
        for group, of_group in zip(groups, points, strict=True)
    ]
    order_blending = make_order_blending(volumes[0].world_from_index, camera.path)
    watch.lap("framing")
    return Stage(scene, layers, target, distance, groups, tuple(resolutions), order_blending, watch.seconds)


def read_volumes(scene: Scene) -> list[Volume]:
    """Return the volume of each layer of a scene; the same one is read once. Raises InputError."""
    read, volumes = cache(read_volume), []
    for spec in scene.layers:
        volume = _moved(read(spec.volume), spec.transform)
        if (mask := spec.mask) is not None:
            assert isinstance(mask.volume, VolumeSpec)
            volume = mask_volume(volume, _moved(read(mask.volume), mask.transform), mask.labels.values)
        volumes.append(volume)
    return volumes


def _moved(volume: Volume, matrix: Sequence[Sequence[float]] | None) -> Volume:
    return volume if matrix is None else move_volume(volume, np.array(matrix))


def _make_layers(
    scene: Scene, volumes: Sequence[Volume], *, any_tolerance: bool, num_threads: int, lap: Callable[[str], object]
) -> tuple[Layer, ...]:
    """Make the layers of a scene; two that are made from the same data are made once."""
    finest_cut = EVERY_CUT
    if scene.needs_opengl and not any_tolerance:
        finest_cut = FinestCut(min_tolerance(scene.error), scene.error.finest_level)
    made: dict[str, Layer] = {}
    layers = []
    for spec, volume in zip(scene.layers, volumes, strict=True):
        digest = layer_digest(spec, scene, volume, finest_cut)
        if digest not in made:
            made[digest] = make_layer(spec, scene, volume, finest_cut=finest_cut, num_threads=num_threads, lap=lap)
        layers.append(replace(made[digest], spec=spec))
    return tuple(layers)


def _visible_points(scene: Scene, group: LayerGroup) -> Float64:
    """Return the positions of what is visible of the layers of a group, as `visible_points`."""
    clip = None
    if scene.camera.target == "visible":
        clip = place_object_clips(group.volume, scene.clip + group.layers[0].spec.clip)
    return np.concatenate([visible_points(layer.pyramid, clip) for layer in group.layers])


def _require_fingerprint(volumes: Sequence[Volume], fingerprint: str, recorded_in: str) -> None:
    found = joint_fingerprint(volumes)
    if found != fingerprint:
        names = ", ".join(volume.name for volume in volumes)
        raise InputError(
            "the film was made from another volume",
            where=recorded_in or None,
            got=f"the fingerprint {found} of {names}",
            expected=fingerprint,
            hint="if the volume was moved, name it with --volume; draw another volume with another scene",
        )


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


def _clip_problems(scene: Scene, volumes: Sequence[Volume]) -> Iterator[Problem]:
    """Yield the planes and boxes, fixed to the object, that leave nothing of any volume, or nothing of their own."""
    for number, each in enumerate(scene.clip):
        if all(_leaves_nothing(each, volume) for volume in volumes):
            yield _clip_problem(f"clip.{number}", volumes[0])
    for layer, (spec, volume) in enumerate(zip(scene.layers, volumes, strict=True)):
        for number, each in enumerate(spec.clip):
            if _leaves_nothing(each, volume):
                yield _clip_problem(f"volumes.{layer}.clip.{number}", volume)


def _leaves_nothing(each: ClipSpec, volume: Volume) -> bool:
    half = np.array(volume.shape_xyz) / 2
    clip = place_object_clips(volume, [each])
    return clip is not None and bool(are_clipped_away(clip, np.array([[-half, half]]))[0])


def _clip_problem(key: str, volume: Volume) -> Problem:
    expected = f"one that leaves some of it; it reaches {reach_text(volume)}"
    return Problem(key, "leaves nothing of the volume", expected=expected)


def _framing(scene: Scene, volumes: Sequence[Volume], points: Float64) -> tuple[Vector, float]:
    """Return target and distance: the scene's, or such that the whole path has these points in frame."""
    camera = scene.camera
    if camera.target == "visible":
        target = visible_centre(points)
    elif camera.target is not None:
        target = camera.target
    elif len(volumes) > 1:
        target = visible_centre(np.concatenate([volume_corners(volume) for volume in volumes]))
    else:
        x, y, z = volumes[0].centre
        target = float(x), float(y), float(z)
    if camera.distance is not None:
        return target, camera.distance
    distance = fit_distance(camera, points, target, scene.output.size)
    if scene.needs_opengl and max(volumes[0].shape_xyz) <= _MAX_SIDE_OF_SMALL:
        reach = GAUSSIAN_CUTOFF * scene.splat.sigma - 0.5
        whole = corners_around(volumes[0], points, reach)
        distance = max(distance, fit_distance(camera, whole, target, scene.output.size, margin=0.0))
    return target, distance
