"""Run `hsplat check SCENE`: list the mistakes in a scene, or describe the film that it makes."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import click

from hsplat_cli.commands.shared_options import takes_scene
from hsplat_cli.executors import memory_option
from hsplat_cli.scenes import SceneRequest, load_job
from hsplat_cli.terminal import Reporter
from renderer.accuracy import asked_psnr, finer_than_kept, typical_kept_psnr
from renderer.errors import HsplatError, InputError, SceneError
from renderer.film import (
    frame_path,
    require_own_folder,
    require_writable_dry_run,
    translate_os_errors,
    unfinished_folder,
)
from renderer.readers import find_volume
from renderer.record import require_own_files
from renderer.scene import (
    FileSource,
    FilmScene,
    MetricTarget,
    Motion,
    OutputFile,
    RawSource,
    SplatBudget,
    TimeBudget,
    UrlSource,
    VolumeSpec,
    chosen_exposure_text,
    counted,
    first_few,
    join_some,
    moving_values,
)
from renderer.system import MemoryShare, join_lines

if TYPE_CHECKING:  # the modules load kernels
    from renderer.draw import BrickMemory
    from renderer.job import Forecast, LightCost

# Largest number of turning points of a schedule that are listed; a schedule with more is shown by its range.
_MAX_TURNS = 4


@click.command()
@takes_scene("As for render.")
@click.option("--output", metavar="FILE", help="As for render.")
@click.option("--no-cost", is_flag=True, help="Do not predict the cost of the film, which needs the volume.")
@memory_option
def check(request: SceneRequest, *, output: str | None, no_cost: bool, memory: int | None) -> None:
    """Check a scene file and list everything that is wrong with it.

    SCENE is a YAML file, or the JSON file beside a film. check finds every mistake that render refuses before it loads
    a library to read voxels, to draw or to encode. Nothing is written. If the scene is right, some frames are drawn and
    encoded to predict the cost of the film on this machine; numbers that do not fit the volumes are errors, too. With
    --no-cost, only the first bytes of the volume and the labels that the scene names are read. Where nothing can be
    drawn, a note says why: a damaged header or voxels, a size that OpenGL does not have, no OpenGL, no ffmpeg.
    """
    request = replace(request, output=output)
    job = load_job(request, reads="nothing")
    outputs = [frame_path(each.file, job.frames[0]) for each in job.scene.output.files]
    for file in (*outputs, job.sidecar):
        require_writable_dry_run(file)
    with translate_os_errors(job.scene.output.file):
        for each in job.scene.output.files:
            require_own_folder(unfinished_folder(each))
    require_own_files(job.scene.output, job.frames, job.sidecar)
    for layer in job.scene.at(0).layers:
        for volume in layer.volumes.values():
            if isinstance(volume.source, FileSource):
                for file in volume.source.steps or (volume.source.file,):
                    find_volume(file)
    found, costs = (_label_notes(request, job.scene), None) if no_cost else _costs(request, MemoryShare(memory))
    facts = [*_summary(job.scene, len(job.frames), costs), *found]
    rows = [f"  {name:<8} {text}" for name, text in facts]
    Reporter().result(join_lines([f"{request.path}: ok", *rows]))


def _label_notes(request: SceneRequest, scene: FilmScene) -> list[tuple[str, str]]:
    """Look for the labels that a scene names; if a volume cannot be read, return a row with the reason.

    Raises SceneError for labels that a volume does not have.
    """
    if not any(layer.transfer_function.labels or layer.mask for layer in scene.at(0).layers):
        return []
    try:
        load_job(request, reads="labels")
    except SceneError:
        raise
    except InputError as error:
        return [("note", f"the labels were not looked for: {_first_line(error)}")]
    return []


def _first_line(error: HsplatError) -> str:
    return str(error).partition("\n")[0]


def _costs(request: SceneRequest, memory: MemoryShare) -> tuple[list[tuple[str, str]], Forecast | None]:
    """Return rows on the cost of a film in this process, and its forecast; or a row with the reason for no forecast."""
    # Imported here: the modules load kernels.
    from hsplat_cli.terminal import FilmEvents
    from renderer.job import forecast_film, open_local_executor

    try:
        job = load_job(request)
        with FilmEvents(Reporter(), job.scene.primitive_name) as events:
            found = forecast_film(job, partial(open_local_executor, memory=memory), events)
    except SceneError:  # numbers of the scene do not fit its volumes
        raise
    except HsplatError as error:
        return [("note", f"the cost is not known: {_first_line(error)}")], None
    rows = [*(("level", note) for note in job.scene.level_notes)]
    rows += [("cost", f"about {found.seconds_text} here, {found.bytes_text(found.num_bytes)}")]
    if found.brick_memory is not None:
        rows.append(("memory", _memory_text(found.brick_memory)))
    if found.light is not None:
        rows.append(("light", _light_text(found.light)))
    if found.exposure is not None:
        rows.append(("exposure", chosen_exposure_text(found.exposure)))
    rows += [("note", each.note) for each in found.glances]
    return rows, found


def _memory_text(memory: BrickMemory) -> str:
    """Describe how much memory the film's bricks need, and what happens if the limit is lower."""
    from hsplat_cli.reports import bytes_text  # loads numpy

    needed = f"{bytes_text(memory.needed)} for bricks"
    if memory.needed <= memory.limit:
        return needed
    return f"{needed}, but at most {bytes_text(memory.limit)} are kept: others are made again for each frame (--memory)"


def _light_text(light: LightCost) -> str:
    """Describe the cells that the light is found on, and the cost of it."""
    from hsplat_cli.reports import bytes_text  # loads numpy

    voxels = "1 voxel" if light.cell_voxels == 1 else f"{light.cell_voxels:.3g} voxels"
    cells = " x ".join(map(str, light.shape_xyz))
    cost = f"{bytes_text(light.num_bytes)} and {light.seconds:.2g} s each time that it is computed"
    return f"{cells} cells of {voxels}, {cost}"


def _summary(scene: FilmScene, num_frames: int, costs: Forecast | None) -> list[tuple[str, str]]:
    output, camera = scene.output, scene.at(0).camera
    frames = f"{num_frames} of " * (num_frames < camera.num_frames) + counted(camera.num_frames, "frame")
    path = ", ".join(piece.type for piece in getattr(camera.path, "pieces", [camera.path]))
    return [
        *_volumes(scene),
        ("camera", f"{path}{', to and fro' * (camera.loop == 'ping-pong')}, {frames}"),
        *_motion(scene),
        ("error", _schedule(scene)),
        *(("output", _output_text(each, num_frames, costs if output.others else None)) for each in output.files),
        *(("note", note) for note in scene.import_notes),
        *([("note", output.dpi_note)] if output.dpi_note is not None else []),
        *([("note", advice)] if (advice := _advice(scene)) is not None else []),
    ]


def _output_text(output: OutputFile, num_frames: int, costs: Forecast | None) -> str:
    width, height = output.size
    text = f"{output.file}, {width} x {height}"
    if output.dpi is not None:
        lengths = " x ".join(f"{25.4 * side / output.dpi:.3g}" for side in output.size)
        text += f" ({lengths} mm at {output.dpi:g} dpi)"
    text += "" if costs is None else f", {costs.bytes_text([output.file])}"
    if output.frame is not None:
        return f"{text}, frame {output.frame}"
    rate = "1 frame" if output.frames_per_second == 1 else f"{output.frames_per_second:g} frames"
    seconds = -(-num_frames // output.every) / output.frames_per_second
    return text if output.is_frames else f"{text}, {seconds:.3g} s at {rate} per second"


def _motion(scene: FilmScene) -> Iterator[tuple[str, str]]:
    """Yield a row with the values that move, and a row for each layer with the frames that need a new pyramid."""
    in_time = ["all steps in time"] * any(layer.volume.time == "auto" for layer in scene.at(0).layers)
    if scene.moves or in_time:
        yield "motion", join_some([*in_time, *moving_values(scene, 0)])
    light = scene.at(0).light
    if not scene.moves and (light is None or not light.follows_camera):
        return
    from renderer.layers import frames_of_new_layers, frames_of_new_light

    for number, layer in enumerate(scene.at(0).layers):
        if runs := frames_of_new_layers(scene, number):
            yield "layer", f"{layer.name} " * bool(layer.name) + f"made again on {_frames_text(runs)}"
    if runs := frames_of_new_light(scene):
        yield "light", f"found again on {_frames_text(runs)}"


def _frames_text(runs: Sequence[tuple[int, int]]) -> str:
    num = sum(last - first + 1 for first, last in runs)
    frames = first_few([f"{first} to {last}" if last > first else f"{first}" for first, last in runs])
    return f"{counted(num, 'frame')}: {frames}"


def _volumes(scene: FilmScene) -> Iterator[tuple[str, str]]:
    """Yield a row for each volume; for a scene with a list of volumes also their names, weights and blending."""
    for layer in scene.at(0).layers:
        name = f"{layer.name}: " * bool(layer.name)
        for key, volume in layer.volumes.items():
            has_weight = key == "volume" and scene.has_list
            yield key, f"{name}{_source(volume)}{f', weight {layer.weight:g}' * has_weight}"
    if scene.has_list:
        yield "blend", scene.blend


def _advice(scene: FilmScene) -> str | None:
    """Return a note where the scene asks for a far higher accuracy than the format of its film keeps."""
    goal = scene.error.goal
    if scene.needs_opengl or isinstance(goal, (SplatBudget, TimeBudget)):
        return None
    return finer_than_kept(asked_psnr(scene.error), typical_kept_psnr(scene.output))


def _source(volume: VolumeSpec) -> str:
    source = volume.source
    if isinstance(source, FileSource):
        lengths = "" if source.spacing is None else " x ".join(f"{length:g}" for length in source.spacing)
        steps = f" to {source.steps[-1].name}, {counted(len(source.steps), 'step')}" if source.steps else ""
        return f"{source.file}{steps}{f', spacing {lengths} in place of its own' if lengths else ''}"
    if isinstance(source, UrlSource):
        return source.url
    shape = " x ".join(map(str, source.shape))
    if isinstance(source, RawSource):
        return f"{source.file}, {shape} of {source.dtype}"
    return f"{source.name}, {shape}"


def _schedule(scene: FilmScene) -> str:
    error, goal = scene.error, scene.error.goal
    if goal is None:
        wanted = f"tolerance {_schedule_text(error.tolerance)}"
    elif isinstance(goal, MetricTarget):
        wanted = f"{goal.metric} {goal.value:g}" + " dB" * (goal.metric == "psnr")
    elif isinstance(goal, SplatBudget):
        num = _schedule_text(goal.value)
        wanted = f"at most {num} {scene.primitive_name}{'s' * (num != '1')}"
    else:
        wanted = f"{_schedule_text(goal.value)} s a frame"
    return f"{error.measure}, {wanted}"


def _schedule_text(scheduled: float | Motion[float] | Motion[int]) -> str:
    """Return `2 to 0.02 to 2`: the first value of a schedule, its turning points and its last value.

    For a schedule with many turning points, return its range.
    """
    turns = list[float]()
    for value in scheduled.values if isinstance(scheduled, Motion) else [scheduled]:
        if len(turns) > 1 and min(turns[-2], value) <= turns[-1] <= max(turns[-2], value):
            turns[-1] = value
        elif not turns or value != turns[-1]:
            turns.append(value)
    if len(turns) > _MAX_TURNS:
        turns = [min(turns), max(turns)]
    return " to ".join(str(value) if isinstance(value, int) else f"{value:g}" for value in turns)
