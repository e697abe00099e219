"""Run `hsplat paper`: draw the figures of the paper from scene files, on one page with the verdict on each claim."""

from __future__ import annotations

import importlib
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hsplat_cli.commands.options import FILE, quiet_option
from hsplat_cli.terminal import OutputPath, Reporter, describe_machine
from renderer.errors import InputError
from renderer.film import WrittenFiles, locked_files, require_writable_dry_run, write_staged
from renderer.job import scene_files
from renderer.scene import Scene, load_scene
from renderer.system import num_cores

if TYPE_CHECKING:
    from hsplat_cli.studies import FigureRenderer, PaperFigure

SCENES = Path(__file__).resolve().parents[1] / "studies" / "paper" / "scenes"
PAGE_FILE = "index.html"


@dataclass(frozen=True)
class _FigureSpec:
    """A figure to draw: its scene file and its module. work: relative duration. takes_volume: draws any volume."""

    scene: str
    module: str
    work: float
    takes_volume: bool = False


FIGURE_SPECS = {
    1: _FigureSpec("1_footprints.yaml", "footprints", 4.0),
    2: _FigureSpec("2_opacity.yaml", "opacity", 8.0),
    3: _FigureSpec("3_one_splat.yaml", "one_splat", 2.0),
    4: _FigureSpec("4_levels.yaml", "levels", 6.0),
    5: _FigureSpec("5_octrees.yaml", "octrees", 20.0, takes_volume=True),
    6: _FigureSpec("6_engine.yaml", "refinement", 40.0, takes_volume=True),
}

_FIGURE = click.IntRange(min(FIGURE_SPECS), max(FIGURE_SPECS))


@click.command()
@click.argument("folder", type=FILE, required=False)
@click.option(
    "--volume", type=FILE, metavar="FILE", help="A scan in place of the procedural engine of figures 5 and 6."
)
@click.option("--output", type=OutputPath(), default=Path("paper"), metavar="DIR", help="Write DIR/index.html.")
@click.option(
    "--figure", "numbers", type=_FIGURE, multiple=True, metavar="N", help="Make only this figure; repeatable."
)
@quiet_option()
def paper(folder: Path | None, volume: Path | None, output: Path, numbers: tuple[int, ...], reporter: Reporter) -> None:
    """Reproduce the figures of Laur and Hanrahan 1991 on one page.

    FOLDER holds a scene file for each figure; by default the scenes that come with hsplat are used. The page states
    what the paper claims, what was measured, and whether the claim is confirmed.
    """
    from hsplat_cli.reports import require_own_page, require_page_packages

    require_page_packages()
    scenes = _load_scenes(folder or SCENES, numbers, volume)
    path = output / PAGE_FILE
    require_writable_dry_run(path)
    WrittenFiles([path]).require_harmless(
        file for scene_path, scene in scenes.values() for file in (scene_path, *scene_files(scene))
    )
    require_own_page(path)
    with locked_files([path]):
        figures, text = _page(scenes, reporter)
        write_staged(path, text.encode())
    for number, figure in figures.items():
        for claim in figure.claims:
            verdict = "confirmed" if claim.is_confirmed else "NOT CONFIRMED"
            reporter.line(f"figure {number}: {verdict}: {claim.statement}")
    reporter.line(f"page: {path}")


def _load_scenes(folder: Path, numbers: Sequence[int], volume: Path | None) -> dict[int, tuple[Path, Scene]]:
    """Return file and scene of the requested figures, or of all whose scenes exist, by number."""
    there = [number for number, spec in FIGURE_SPECS.items() if (folder / spec.scene).exists()]
    if not there:
        raise InputError(
            "no scene files of the paper's figures",
            where=str(folder),
            expected=", ".join(spec.scene for spec in FIGURE_SPECS.values()),
            hint="without FOLDER, the scenes that come with hsplat are used",
        )
    for number in numbers:
        if number not in there:
            expected = str(folder / FIGURE_SPECS[number].scene)
            raise InputError("the scene of this figure is missing", where=f"--figure {number}", expected=expected)
    scenes = {}
    for number in sorted(set(numbers)) or there:
        spec = FIGURE_SPECS[number]
        path = folder / spec.scene
        scene = load_scene(path, volume=volume if spec.takes_volume else None)
        if not scene.needs_opengl:
            raise InputError(
                "the paper draws splats",
                where=str(path),
                got=f"splat.footprint: {scene.splat.footprint}",
                expected="gaussian or gouraud",
            )
        scenes[number] = path, scene
    return scenes


def _make_figure(number: int, path: Path, scene: Scene, figure_renderer: FigureRenderer) -> PaperFigure:
    """Draw and measure the figure of the scene in the file `path`."""
    spec = FIGURE_SPECS[number]
    module = importlib.import_module(f"hsplat_cli.studies.paper.{spec.module}")
    try:
        figure: PaperFigure = module.make_figure(scene, figure_renderer)
    except InputError as error:
        error.where = error.where or str(path)
        raise
    note = f"The volume is {Path(figure_renderer.volumes[scene.volume].name).name}."
    return replace(figure, notes=(note, *figure.notes)) if spec.takes_volume else figure


def _page(scenes: Mapping[int, tuple[Path, Scene]], reporter: Reporter) -> tuple[dict[int, PaperFigure], str]:
    # Imported here to keep --help fast.
    from hsplat_cli.reports import format_facts, plot_style, render_page
    from hsplat_cli.studies import FigureRenderer
    from renderer.draw import RecoveringRasterizer
    from renderer.readers import read_volume

    num_threads = num_cores()
    work = [FIGURE_SPECS[number].work for number in scenes]
    figures: dict[int, PaperFigure] = {}
    with (
        RecoveringRasterizer() as rasterizer,
        plot_style(),
        reporter.progress(work, label="paper", unit="figures") as bar,
    ):
        # All volumes are read first, so that an unreadable one fails at once.
        volumes = {scene.volume: read_volume(scene.volume) for _, scene in scenes.values()}
        figure_renderer = FigureRenderer(rasterizer, volumes, time.perf_counter, num_threads)
        for number, (path, scene) in scenes.items():
            figures[number] = _make_figure(number, path, scene, figure_renderer)
            bar.advance(f"figure {number}")
        facts = format_facts(describe_machine(rasterizer.device))
        title = "Hierarchical splatting, 1991, reproduced"
        return figures, render_page("paper.html", title=title, facts=facts, figures=figures)
