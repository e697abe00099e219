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
from renderer.frame.camera_framing import frame_camera
from renderer.frame.frame import Frame, draw_frame
from renderer.frame.preparation import StageMaker, volume_key
from renderer.frame.stage import Clock, FilmStage, Stage, Stopwatch
from renderer.layers import placement_problems, reach_text
from renderer.scene import (
    ClipSpec,
    FilmScene,
    OverFrames,
    VolumeSpec,
    camera_problems,
    min_tolerance,
    raise_problems,
    volume_extent,
    with_draw_order,
)
from renderer.system import start_threads
from renderer.view import (
    are_clipped_away,
    place_object_clips,
    with_key_of_camera,
)
from renderer.volume import Volume


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
    camera, left_out = frame_camera(scene, maker, layers)
    raise_problems(_clip_problems(scene, volumes))
    watch.lap("framing")
    stage = maker.stage_of(first, layers, camera, lap=watch.lap)
    watch.lap("framing")
    if scene is first:
        return replace(stage, seconds=watch.seconds, not_framed=left_out)
    made = stage.layers, stage.target, stage.distance, stage.groups, stage.resolutions, stage.order_blending
    return FilmStage(scene, *made, watch.seconds, maker, left_out, stage.shift)


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
