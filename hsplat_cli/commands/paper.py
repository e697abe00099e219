"""Run `hsplat paper`: draw the figures of the paper from scene files, on one page with the verdict on each claim."""

from __future__ import annotations

import importlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hsplat_cli.commands.options import quiet_option, volume_option
from hsplat_cli.terminal import OutputPath, Reporter, describe_machine, sigterm_as_interrupt
from renderer.errors import InputError
from renderer.film import require_no_input, require_writable_dry_run, volume_files, write_staged
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


@dataclass(frozen=True)
class _FigureJob:
    """A figure to draw. path: of its scene."""

    number: int
    path: Path
    scene: Scene

    def make_figure(self, figure_renderer: FigureRenderer) -> PaperFigure:
        """Draw and measure the figure."""
        spec = FIGURE_SPECS[self.number]
        module = importlib.import_module(f"hsplat_cli.studies.paper.{spec.module}")
        try:
            figure: PaperFigure = module.make_figure(self.scene, figure_renderer)
        except InputError as error:
            error.where = error.where or str(self.path)
            raise
        note = f"The volume is {Path(figure_renderer.volumes[self.scene.volume].name).name}."
        return replace(figure, notes=(note, *figure.notes)) if spec.takes_volume else figure


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), required=False)
@volume_option(help="A scan in place of the procedural engine of figures 5 and 6.")
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
    from hsplat_cli.reports import require_page_packages

    require_page_packages()
    jobs = _jobs(folder or SCENES, numbers, volume)
    path = output / PAGE_FILE
    require_writable_dry_run(path)
    require_no_input([path], [file for job in jobs for file in (job.path, *volume_files(job.scene.volume))])
    with sigterm_as_interrupt():
        figures, text = _page(jobs, reporter)
        write_staged(path, text.encode())
    for figure in figures:
        for claim in figure.claims:
            verdict = "confirmed" if claim.is_confirmed else "NOT CONFIRMED"
            reporter.line(f"figure {figure.number}: {verdict}: {claim.statement}")
    reporter.line(f"page: {path}")


def _jobs(folder: Path, numbers: Sequence[int], volume: Path | None) -> list[_FigureJob]:
    """Return the requested figures, or all whose scenes exist, with their scenes."""
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
    jobs = []
    for number in sorted(set(numbers)) or there:
        spec = FIGURE_SPECS[number]
        path = folder / spec.scene
        jobs.append(_FigureJob(number, path, load_scene(path, volume=volume if spec.takes_volume else None)))
    return jobs


def _page(jobs: Sequence[_FigureJob], reporter: Reporter) -> tuple[list[PaperFigure], str]:
    # Imported here to keep --help fast.
    from hsplat_cli.reports import format_facts, plot_style, render_page
    from hsplat_cli.scenes import read_volume_guarded
    from hsplat_cli.studies import FigureRenderer
    from renderer.draw import open_rasterizer

    reporter.announce_compilation()
    num_threads = num_cores()
    work = [FIGURE_SPECS[job.number].work for job in jobs]
    figures: list[PaperFigure] = []
    with (
        open_rasterizer(needs_opengl=True) as rasterizer,
        plot_style(),
        reporter.progress(work, label="paper", unit="figures") as bar,
    ):
        # All volumes are read first, so that an unreadable one fails at once.
        volumes = {job.scene.volume: read_volume_guarded(job.scene.volume) for job in jobs}
        figure_renderer = FigureRenderer(rasterizer, volumes, time.perf_counter, num_threads)
        for job in jobs:
            figures.append(job.make_figure(figure_renderer))
            bar.advance(f"figure {job.number}")
        facts = format_facts(describe_machine(rasterizer.renderer_name))
        title = "Hierarchical splatting, 1991, reproduced"
        return figures, render_page("paper.html", title=title, facts=facts, figures=figures)
