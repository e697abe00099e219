"""`hsplat check SCENE`: is this scene right, and what would it make?"""

from __future__ import annotations

from pathlib import Path

import click

from hsplat_cli.scenes import load_job
from hsplat_cli.terminal import counted
from renderer.film import first_output_paths, require_folder_if_exists, require_writable_dry_run, unfinished_folder
from renderer.readers import require_volume_file
from renderer.scene import (
    AccuracyGoal,
    ArraySource,
    ByFrame,
    FileSource,
    ProceduralSource,
    RawSource,
    RockerPath,
    Scene,
    SplatBudget,
    TurntablePath,
)

# Of a schedule, values that are listed.
_MAX_TURNS = 4


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value: --set error.tolerance=0.2"
)
@click.option("--output", type=click.Path(path_type=Path), metavar="FILE", help="As for render.")
@click.option("--frames", metavar="A:B:STEP", help="As for render.")
@click.option("--volume", type=click.Path(path_type=Path), metavar="FILE", help="Take the volume from this file.")
def check(
    scene: Path, overrides: tuple[str, ...], output: Path | None, frames: str | None, volume: Path | None
) -> None:
    """Check a scene file and list everything that is wrong with it.

    SCENE is a YAML file, or the JSON file beside a film. All that render refuses before it loads a library to read
    voxels, to draw or to encode: nothing is written, and of the volume no more is read than the first bytes. What only
    those libraries see remains: a damaged header or voxels, a size that GL does not have, no GL at all, no ffmpeg, a
    full disk.
    """
    job = load_job(scene, overrides=overrides, frames=frames, volume=volume, output=output)
    for file in first_output_paths(job.scene, job.frames):
        require_writable_dry_run(file)
    require_folder_if_exists(unfinished_folder(job.scene.output))
    if isinstance(job.scene.volume.source, FileSource):
        require_volume_file(job.scene.volume.source.file)
    click.echo(f"{scene}: ok")
    for name, text in _summary(job.scene, len(job.frames)):
        click.echo(f"  {name:<8} {text}")


def _summary(scene: Scene, num_frames: int) -> list[tuple[str, str]]:
    output, num_in_all = scene.output, scene.camera.path.frames
    frames = counted(num_in_all, "frame")
    if num_frames < num_in_all:
        frames = f"{num_frames} of {frames}"
    seconds = num_frames / output.frames_per_second
    is_film = output.file.suffix.lower() != ".png"
    rate = "1 frame" if output.frames_per_second == 1 else f"{output.frames_per_second:g} frames"
    film = f", {seconds:.3g} s at {rate} per second" if is_film else ""
    width, height = output.size
    return [
        ("volume", _source(scene.volume.source)),
        ("camera", f"{_path(scene)}, {frames}"),
        ("error", _schedule(scene)),
        ("output", f"{output.file}, {width} x {height}{film}"),
    ]


def _source(source: FileSource | RawSource | ProceduralSource | ArraySource) -> str:
    if isinstance(source, FileSource):
        lengths = "" if source.spacing is None else " x ".join(f"{length:g}" for length in source.spacing)
        return f"{source.file}{f', spacing {lengths} in place of its own' if lengths else ''}"
    shape = " x ".join(map(str, source.shape))
    if isinstance(source, RawSource):
        return f"{source.file}, {shape} of {source.dtype}"
    return f"{source.name}, {shape}"


def _path(scene: Scene) -> str:
    path = scene.camera.path
    if isinstance(path, TurntablePath):
        return "turntable"
    return "rocker" if isinstance(path, RockerPath) else "keyframes"


def _schedule(scene: Scene) -> str:
    error, goal = scene.error, scene.error.goal
    if goal is None:
        wanted = f"tolerance {_schedule_text(error.tolerance)}"
    elif isinstance(goal, AccuracyGoal):
        wanted = f"{goal.metric} {goal.value:g}" + " dB" * (goal.metric == "psnr")
    elif isinstance(goal, SplatBudget):
        num = _schedule_text(goal.by_frame)
        wanted = f"at most {num} {scene.splat.primitive_name}{'s' * (num != '1')}"
    else:
        wanted = f"{_schedule_text(goal.by_frame)} s a frame"
    return f"{error.measure}, {wanted}"


def _schedule_text(by_frame: ByFrame) -> str:
    """`2 to 0.02 to 2`: the first value, those where a schedule turns back, and the last one; of many turns the range
    alone."""
    turns: list[float] = []
    for _, value in by_frame:
        if len(turns) > 1 and min(turns[-2], value) <= turns[-1] <= max(turns[-2], value):
            turns[-1] = value
        elif not turns or value != turns[-1]:
            turns.append(value)
    if len(turns) > _MAX_TURNS:
        turns = [min(turns), max(turns)]
    return " to ".join(str(value) if isinstance(value, int) else f"{value:g}" for value in turns)
