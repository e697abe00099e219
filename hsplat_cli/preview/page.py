"""Makes the preview page: draws each of its parts, and renders them to HTML."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from hsplat_cli.preview.studio import TOLERANCE, Shot, Studio, shot_of, small_scene
from hsplat_cli.preview.variants import draw_tolerances, suggest_looks, variants
from hsplat_cli.preview.volume_chart import chart_of
from hsplat_cli.reports import render_page
from renderer.accuracy import Glance, is_loop, look_ahead, scalar_ranges, spread_evenly
from renderer.draw import open_rasterizer
from renderer.frame import require_annotation
from renderer.job import FilmJob
from renderer.record import FilmVisibility, VisibleRange, film_visibility, range_record, visibility_text
from renderer.scene import PathSequence, Scene, TurntablePath, counted, min_tolerance, with_tolerance
from renderer.system import num_cores, start_threads

# Number of times that `preview_page` calls `advance`: once for each part of the page.
NUM_PARTS = 4
# Largest number of frames of the film that the page shows.
_NUM_FRAMES = 12
# Longer side of a frame on the page, in pixels.
_FRAME_PX = 192
# Longer side, in pixels, at which a frame with annotation is drawn; then it is reduced to _FRAME_PX.
_ANNOTATED_PX = 512
# Number of pictures of the turning object.
_NUM_TURNED = 24
# Number of pictures of the turning object in a row.
_TURN_COLUMNS = 6
# Longer side of a picture of the turning object, in pixels.
_TURN_PX = 192
# Longer side of the pictures of variants of the scene, in pixels.
_OTHERS_PX = 256
# Tolerance of pictures of the turning object, unless the scene's tolerance is larger.
_TURN_TOLERANCE = 0.3
# Elevation of the camera around the turning object, in degrees, unless the film is a turntable.
_ELEVATION = 20.0
# Number of exact rays through each frame on the page, which find the visible values.
_RAYS_A_FRAME = 96
# Largest number of layers whose charts the page shows.
_MOST_CHARTS = 8


def preview_page(job: FilmJob, title: str, advance: Callable[[str], object]) -> tuple[str, Sequence[Glance]]:
    """Return the page of a film, and the faults of its pictures.

    advance: a function that is called with the name of each finished part. Raises InputError, SceneError, and
    RenderError where a scene with splats finds no OpenGL.
    """
    film = job.scene
    frame = film.num_frames // 2 if film.moves else 0
    with open_rasterizer(film) as rasterizer, start_threads(1) as beside:
        studio, still = Studio(rasterizer), small_scene(film.at(frame), _OTHERS_PX)
        with studio.stage(still) as stage:
            looks = beside.submit(suggest_looks, stage.first)  # in a thread of its own, while other threads draw
            sheet, visibility, glances = _sheet(studio, job)
            advance("frames")
            shown = [*enumerate(stage.layers[:_MOST_CHARTS])]
            charts = beside.submit(lambda: [chart_of(layer, _of_layer(visibility, number)) for number, layer in shown])
            coarser = draw_tolerances(studio, job, frame, _OTHERS_PX, sum(stage.seconds.values()))
            advance("tolerances")
            turn = _turn(studio, small_scene(film.at(frame), _TURN_PX))
            advance("turning")
            denser = max((each.factor for each in glances), default=1.0)
            rows = [*variants(studio, stage.first, frame, coarser, looks.result(), denser)]
            advance("variants")
    page = render_page(
        "preview.html",
        title=title,
        facts=_facts(job),
        tolerance="its tolerance" if film.error.goal is None else f"tolerance {TOLERANCE:g} in place of its goal",
        sheet=sheet,
        turn=turn,
        columns=_TURN_COLUMNS,
        charts=charts.result(),
        num_layers=len(still.layers),
        hidden="" if visibility is None else visibility_text(visibility),
        notes=[each.note for each in glances],
        variants=rows,
        frame=frame,
    )
    return page, glances


def _facts(job: FilmJob) -> list[tuple[str, str]]:
    """Return the facts about the film for the head of the page."""
    output = job.scene.output
    seconds = len(job.frames) / output.frames_per_second
    size = f"{output.size[0]} × {output.size[1]} pixels"
    return [("film", f"{output.file.name}, {size}, {counted(len(job.frames), 'frame')}, {seconds:.3g} s")]


def _sheet(studio: Studio, job: FilmJob) -> tuple[list[Shot], FilmVisibility | None, Sequence[Glance]]:
    """Draw some frames of the film with their annotation; find the visible values, and the faults of pictures."""
    has_text = job.scene.at(0).annotation.has_patches  # texts need a larger picture, which is then reduced
    scene = small_scene(job.scene, _ANNOTATED_PX if has_text else _FRAME_PX, is_annotated=True)
    frames = spread_evenly(job.frames, _NUM_FRAMES, is_loop=is_loop(scene.at(0).camera.path))
    with studio.stage(scene) as stage:
        require_annotation(stage, frames)
        ranges = scalar_ranges(stage)
        drawn = studio.draw(stage, frames, _RAYS_A_FRAME if ranges else 0)
        glances = look_ahead(stage, job.frames, num_threads=num_cores())
    shots = [
        shot_of(each, scene.at(number).background, f"frame {number}", side=_FRAME_PX)
        for number, each in zip(frames, drawn, strict=True)
    ]
    return shots, film_visibility([each.record for each in drawn], [*map(range_record, ranges)]), glances


def _of_layer(visibility: FilmVisibility | None, number: int) -> list[VisibleRange]:
    """Return the ranges of values that are visible in the layer `number`; none if they were not measured."""
    return [each for each in visibility.ranges if each.layer in (None, number)] if visibility is not None else []


def _turn(studio: Studio, still: Scene) -> Shot:
    """Draw the object from all sides: the frames of a turn around the camera's target, in one picture, row by row."""
    camera = replace(still.camera, loop="restart")
    path = camera.path.pieces[0] if isinstance(camera.path, PathSequence) else camera.path
    if isinstance(path, TurntablePath):
        camera = replace(camera, path=replace(path, frames=_NUM_TURNED))
    else:
        axis = getattr(path, "axis", TurntablePath.axis)
        camera = replace(camera, path=TurntablePath(_NUM_TURNED, elevation=_ELEVATION, axis=axis), distance=None)
    scene = with_tolerance(still, max(_TURN_TOLERANCE, min_tolerance(still.error)))
    with studio.stage(replace(scene, camera=camera)) as stage:
        shots = [shot_of(each, still.background, "") for each in studio.draw(stage, range(_NUM_TURNED))]
    rows = [
        np.hstack([shot.pixels for shot in shots[k : k + _TURN_COLUMNS]]) for k in range(0, _NUM_TURNED, _TURN_COLUMNS)
    ]
    return replace(shots[0], pixels=np.vstack(rows), caption=str(_NUM_TURNED))
