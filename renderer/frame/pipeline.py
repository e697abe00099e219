"""Draw the frames of a scene: the program's table of contents, with the only frame loop.

FilmScene -> Volume -> Pyramid -> (per frame: Scene, View, tolerance) -> Cut -> splats or bricks -> float image
-> 8 bits
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from contextlib import ExitStack
from dataclasses import replace
from itertools import zip_longest
from operator import itemgetter

import numpy as np

from renderer.draw import Rasterizer
from renderer.errors import Problem
from renderer.frame.budget import ScheduleController, ToleranceController
from renderer.frame.frame import Frame, draw_frame
from renderer.frame.preparation import StageMaker, points_in_frame, volume_key
from renderer.frame.stage import Clock, FilmStage, Stage, Stopwatch
from renderer.layers import Layer, parts_over_frames, placement_problems, reach_text
from renderer.scene import (
    CameraSpec,
    ClipSpec,
    FilmScene,
    OverFrames,
    Vector,
    VolumeSpec,
    camera_problems,
    min_tolerance,
    raise_problems,
    volume_extent,
    with_draw_order,
)
from renderer.splats import GAUSSIAN_CUTOFF
from renderer.system import start_threads
from renderer.view import (
    are_clipped_away,
    corners_around,
    fit_distance,
    least_distance,
    place_object_clips,
    visible_centre,
    volume_corners,
    with_key_of_camera,
)
from renderer.volume import Float64, Volume

# The largest number of frames of a film in motion whose visible cells decide how far away the camera is. The layers of
# each such frame have to be made.
_MOST_SAMPLED_LAYERS = 9
# The largest number of frames of a film in motion whose cameras decide how far away the camera is.
_MOST_SAMPLED_CAMERAS = 1000
# The longest side, in voxels, of a volume that counts as small. Its splats may reach beyond the margin of the picture,
# so that the camera is moved away from it. Larger volumes are framed alike for all footprints, so that their pictures
# can be compared.
_MAX_SIDE_OF_SMALL = 24


def prepare_stage(
    scene: FilmScene,
    *,
    clock: Clock,
    num_threads: int,
    volumes: Sequence[Volume] | None = None,
    known: Mapping[VolumeSpec, str] | None = None,
    any_tolerance: bool = False,
    maker: StageMaker | None = None,
) -> FilmStage:
    """Read the volumes, make their layers, and frame the visible cells. Raises InputError for an unusable volume.

    volumes: the volumes of the first frame, if they were read before; None to read the scene's volumes.
    known: the fingerprints that volumes of other frames must have, by the volumes' specs.
    any_tolerance: whether to build the pyramid for every tolerance and level, as for bricks, and not only for the
        tolerances of the scene's schedule.
    maker: a maker that has made the stage of a similar scene, and reuses its layers; None for a new one.
    """
    scene, watch = with_key_of_camera(with_draw_order(scene)), Stopwatch(clock)
    first, size = scene.at(0), scene.output.size
    maker = maker or StageMaker(num_threads, any_tolerance, known=known or {})
    if volumes is not None:
        maker.volumes = [volume_key(layer) for layer in first.layers], volumes
    volumes = maker.volumes_of(first)
    raise_problems(placement_problems(scene, volumes))
    for volume in volumes:
        raise_problems(camera_problems(first.camera, size, volume_extent(volume)))
    watch.lap("read")
    layers = maker.layers_of(first, min_tolerance(scene.error), watch.lap)
    target, distance, left_out = _framing(scene, maker, layers)
    raise_problems(_clip_problems(scene, volumes))
    watch.lap("framing")
    stage = maker.stage_of(first, layers, target, distance, lap=watch.lap)
    watch.lap("framing")
    if scene is first:
        return replace(stage, seconds=watch.seconds, not_framed=left_out)
    made = stage.layers, stage.target, stage.distance, stage.groups, stage.resolutions, stage.order_blending
    return FilmStage(scene, *made, watch.seconds, maker, left_out)


def render_frames(
    stage: FilmStage,
    frames: Sequence[int],
    rasterizer: Rasterizer,
    *,
    clock: Clock,
    controller: ToleranceController | None = None,
) -> Iterator[Frame]:
    """Draw frames of the film in the given order.

    controller: the controller that chooses the tolerances; None to follow the schedule.
    """
    controller = ScheduleController(stage) if controller is None else controller
    with ExitStack() as stack:
        ahead: Future[Stage] | None = None
        thread = stack.enter_context(start_threads(1)) if stage.maker is not None else None
        for number, following in zip_longest(frames, frames[1:]):
            watch = Stopwatch(clock)
            if ahead is not None:
                ahead.result()
                watch.lap("layers")
            draw_list, predicted_seconds = controller.prepare_frame(number, watch)
            if thread is not None and following is not None and isinstance(controller, ScheduleController):
                ahead = thread.submit(stage.at, following)  # the next stage is made while this frame is drawn
            yield replace(draw_frame(draw_list, rasterizer, watch), predicted_seconds=predicted_seconds)
            controller.finish_frame(draw_list, watch)


def _clip_problems(scene: FilmScene, volumes: Sequence[Volume]) -> Iterator[Problem]:
    """Yield a problem for each clip plane or box, fixed to the object, that leaves nothing of its volumes."""
    for number, clip in _still_clips(scene.map(lambda each: each.clip)):
        if all(_leaves_nothing(clip, volume) for volume in volumes):
            yield _clip_problem(f"clip.{number}", volumes[0])
    for layer, (spec, volume) in enumerate(zip(scene.film_layers, volumes, strict=True)):
        for number, clip in _still_clips(spec.map(lambda each: each.clip)):
            if _leaves_nothing(clip, volume):
                yield _clip_problem(f"{scene.layer_key(layer, 'clip')}.{number}", volume)


def _still_clips(clips: OverFrames[tuple[ClipSpec, ...]]) -> Iterator[tuple[int, ClipSpec]]:
    """Yield the clip planes and clip boxes that do not move during the film, with their numbers."""
    for number, clip in enumerate(clips.at(0)):
        if not clips.map(itemgetter(number)).moves:
            yield number, clip


def _leaves_nothing(each: ClipSpec, volume: Volume) -> bool:
    half = np.array(volume.shape_xyz) / 2
    clip = place_object_clips(volume, [each])
    return clip is not None and bool(are_clipped_away(clip, np.array([[-half, half]]))[0])


def _clip_problem(key: str, volume: Volume) -> Problem:
    expected = f"one that leaves some of it; it reaches {reach_text(volume)}"
    return Problem(key, "leaves nothing of the volume", expected=expected)


def _framing(scene: FilmScene, maker: StageMaker, layers: tuple[Layer, ...]) -> tuple[Vector, float, float]:
    """Return the target and the distance of the camera, so that all frames hold everything that any frame shows.

    The scene's own target and distance are kept. Cells that hardly show are left out of the framing. The third value is
    the share of a picture that these cells would add.
    """
    camera, size = scene.at(0).camera, scene.output.size
    frames_of: dict[CameraSpec, list[int]] = {}
    for frame in _sampled(scene, _MOST_SAMPLED_CAMERAS):
        frames_of.setdefault(scene.at(frame).camera, []).append(camera.path_frame(frame))
    if all(isinstance(each.target, tuple) and each.distance is not None for each in frames_of):
        assert isinstance(camera.target, tuple) and camera.distance is not None
        return camera.target, camera.distance, 0.0
    framed = [points_in_frame(scene.at(0), layers), *_other_points(scene, maker, layers)]
    points, left_out = np.concatenate([each for each, _ in framed]), max(part for _, part in framed)
    target = _target(camera, layers, points)
    if camera.distance is not None:
        return target, camera.distance, left_out
    if len(frames_of) == 1:
        distance = fit_distance(camera, points, target, size)
    else:
        found = (
            least_distance(each, points, each.target if isinstance(each.target, tuple) else target, size, frames=frames)
            for each, frames in frames_of.items()
        )
        distance = max(found)
    volume = layers[0].volume
    if scene.needs_opengl and max(volume.shape_xyz) <= _MAX_SIDE_OF_SMALL:
        reach = GAUSSIAN_CUTOFF * scene.at(0).splat.sigma - 0.5
        whole = corners_around(volume, points, reach)
        distance = max(distance, fit_distance(camera, whole, target, size, margin=0.0))
    return target, distance, left_out


def _target(camera: CameraSpec, layers: Sequence[Layer], points: Float64) -> Vector:
    """Return the target of a camera: the one in the scene, else the centre of the visible cells or of the volumes.

    points: the corners of visible cells that must be in frame.
    """
    if camera.target == "visible":
        return visible_centre(points)
    if camera.target is not None:
        return camera.target
    if len(layers) > 1:
        return visible_centre(np.concatenate([volume_corners(layer.volume) for layer in layers]))
    x, y, z = layers[0].volume.centre
    return float(x), float(y), float(z)


def _other_points(scene: FilmScene, maker: StageMaker, layers: tuple[Layer, ...]) -> Iterator[tuple[Float64, float]]:
    """Yield what `points_in_frame` returns, for some frames of a film in motion, without the first frame.

    layers: the layers of the first frame.
    """
    tolerance, known = min_tolerance(scene.error), [layer.digest for layer in layers]
    for frame in _sampled(scene, _MOST_SAMPLED_LAYERS)[1:] if scene.moves else ():
        sampled = scene.at(frame)
        if maker.digests_of(sampled, tolerance) != known:  # without shading, which takes time and makes no cell visible
            sampled = sampled.with_layers(shading=None)
        yield points_in_frame(sampled, maker.layers_of(sampled, tolerance))


def framing_note(scene: FilmScene) -> str | None:
    """Return a sentence on the frames by which a film is framed, if its layers change and other frames may show more.

    Return None if the frames cannot show more, or the scene gives the camera's target and distance.
    """
    frames, camera = _sampled(scene, _MOST_SAMPLED_LAYERS), scene.at(0).camera
    is_open = camera.distance is None or not isinstance(camera.target, tuple)
    layers = enumerate(scene.film_layers)
    changes = any(
        layer.map(lambda each: each.volume).changing_frames or parts_over_frames(scene, number).changing_frames
        for number, layer in layers
    )
    if not (is_open and changes and len(frames) < scene.num_frames):
        return None
    return f"framed by the voxels visible on {len(frames)} of {scene.num_frames} frames"


def _sampled(scene: FilmScene, num: int) -> list[int]:
    """Return about `num` frames of a film, among them key frames; frame 0 alone if nothing moves."""
    if not scene.moves:
        return [0]
    frames = sorted({0, *scene.key_frames, *range(0, scene.num_frames, max(1, scene.num_frames // num))})
    num = min(num, len(frames))
    return [frames[k * (len(frames) - 1) // max(1, num - 1)] for k in range(num)]
