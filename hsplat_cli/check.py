"""`hsplat check SCENE`: is this scene right, and what would it make?"""

from __future__ import annotations

from pathlib import Path

import click

from hsplat_cli.scene_file import load_scene
from renderer.scene import FileSource, ProceduralSource, RawSource, RockerPath, Scene, TurntablePath


@click.command()
@click.argument("scene", type=click.Path(path_type=Path))
@click.option(
    "--set", "overrides", multiple=True, metavar="KEY=VALUE", help="Change a value: --set error.tolerance=0.2"
)
@click.option("--volume", type=click.Path(path_type=Path), metavar="FILE", help="Take the volume from this file.")
def check(scene: Path, overrides: tuple[str, ...], volume: Path | None) -> None:
    """Check a scene file and list everything that is wrong with it."""
    checked = load_scene(scene, overrides=overrides, volume=volume)
    click.echo(f"{scene}: ok")
    for name, text in _summary(checked):
        click.echo(f"  {name:<8} {text}")


def _summary(scene: Scene) -> list[tuple[str, str]]:
    output, num_frames = scene.output, scene.camera.path.frames
    frames = "1 frame" if num_frames == 1 else f"{num_frames} frames"
    seconds = num_frames / output.frames_per_second
    is_film = output.file.suffix.lower() != ".png"
    film = f", {seconds:.3g} s at {output.frames_per_second:g} frames per second" if is_film else ""
    width, height = output.size
    return [
        ("volume", _source(scene.volume.source)),
        ("camera", f"{_path(scene)}, {frames}"),
        ("error", _tolerance(scene)),
        ("output", f"{output.file}, {width} x {height}{film}"),
    ]


def _source(source: FileSource | RawSource | ProceduralSource) -> str:
    if isinstance(source, FileSource):
        return str(source.file)
    shape = " x ".join(map(str, source.shape))
    if isinstance(source, RawSource):
        return f"{source.file}, {shape} of {source.dtype}"
    return f"{source.name}, {shape}"


def _path(scene: Scene) -> str:
    path = scene.camera.path
    if isinstance(path, TurntablePath):
        return "turntable"
    return "rocker" if isinstance(path, RockerPath) else "keyframes"


def _tolerance(scene: Scene) -> str:
    (_, first), *_, (_, last) = [*scene.error.tolerance, scene.error.tolerance[-1]]
    return f"{scene.error.measure}, tolerance {first:g}" + (f" to {last:g}" if last != first else "")
