"""`hsplat paper`: the figures of the paper from scene files, on one page that says what was seen."""

from __future__ import annotations

import importlib
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from hsplat_cli.terminal import OutputPath, describe_machine, progress, report_first_run, sigterm_as_interrupt
from renderer.cores import num_cores
from renderer.errors import InputError, SceneError
from renderer.film import require_no_input, volume_files, write_staged
from renderer.scene import Scene, load_scene

if TYPE_CHECKING:
    from hsplat_cli.studies import Figure, Studio

FOLDER = Path("configs/paper")
PAGE = "index.html"


@dataclass(frozen=True)
class _FigureSpec:
    """Where a figure's scene is, which module makes it, and how long that takes beside the others.

    takes_volume: it is of any volume, such as a scan.
    """

    scene: str
    module: str
    work: float
    takes_volume: bool = False


RECIPES = {
    1: _FigureSpec("1_footprints.yaml", "footprints", 4.0),
    2: _FigureSpec("2_opacity.yaml", "opacity", 8.0),
    3: _FigureSpec("3_one_splat.yaml", "one_splat", 2.0),
    4: _FigureSpec("4_levels.yaml", "levels", 6.0),
    5: _FigureSpec("5_octrees.yaml", "octrees", 20.0, takes_volume=True),
    6: _FigureSpec("6_engine.yaml", "refinement", 40.0, takes_volume=True),
}

# Takes the place of a scan that is not there.
_FALLBACK_VOLUME = "volume={procedural: {name: engine_block, shape: [128, 128, 64], seed: 1}}"


@dataclass(frozen=True)
class _Job:
    """A figure to be made. path: of its scene; notes: what is to be said of that."""

    number: int
    path: Path
    scene: Scene
    notes: tuple[str, ...] = ()

    def make(self, studio: Studio) -> Figure:
        """Draw and measure it."""
        module = importlib.import_module(f"hsplat_cli.studies.paper.{RECIPES[self.number].module}")
        try:
            figure: Figure = module.make(self.scene, studio)
        except InputError as error:
            if error.where is not None:
                raise
            parts = {"got": error.got, "expected": error.expected, "hint": error.hint}
            raise InputError(error.what, where=str(self.path), **parts) from error
        return replace(figure, notes=self.notes + figure.notes)


@click.command()
@click.argument("folder", type=click.Path(path_type=Path), default=FOLDER)
@click.option("--volume", type=click.Path(path_type=Path), metavar="FILE", help="The engine, for figures 5 and 6.")
@click.option("--output", type=OutputPath(), default=Path("paper"), metavar="DIR", help="Write DIR/index.html.")
@click.option("--figure", "numbers", type=int, multiple=True, metavar="N", help="Make only this figure; repeatable.")
@click.option("--quiet", is_flag=True, help="Say nothing but errors.")
def paper(folder: Path, volume: Path | None, output: Path, numbers: tuple[int, ...], quiet: bool) -> None:
    """Reproduce the figures of Laur and Hanrahan 1991 on one page.

    FOLDER holds a scene file for each figure, configs/paper by default. The page says, figure by figure, what the paper
    claims, what was measured, and whether the claim was seen.
    """
    from hsplat_cli.reports import (
        require_page_packages,
        require_writable_files,
    )

    require_page_packages()
    jobs = _jobs(folder, numbers, volume)
    require_writable_files(output, [PAGE])
    path = output / PAGE
    require_no_input([path], [file for job in jobs for file in (job.path, *volume_files(job.scene.volume))])
    with sigterm_as_interrupt():
        figures, text = _page(jobs, quiet=quiet)
        write_staged(path, text.encode())
    if not quiet:
        _report(jobs, figures, path)


def _jobs(folder: Path, numbers: Sequence[int], volume: Path | None) -> list[_Job]:
    """The figures asked for, or all whose scenes are there, with their scenes read."""
    unknown = [number for number in numbers if number not in RECIPES]
    if unknown:
        raise InputError(
            "no such figure", where=f"--figure {unknown[0]}", expected=f"a number from {min(RECIPES)} to {max(RECIPES)}"
        )
    there = [number for number, recipe in RECIPES.items() if (folder / recipe.scene).exists()]
    if not there:
        raise InputError(
            "no scene files of the paper's figures",
            where=str(folder),
            expected=", ".join(recipe.scene for recipe in RECIPES.values()),
            hint="they are in configs/paper of hsplat's repository",
        )
    for number in numbers:
        if number not in there:
            expected = str(folder / RECIPES[number].scene)
            raise InputError("there is no scene of this figure", where=f"--figure {number}", expected=expected)
    return [_job(number, folder / RECIPES[number].scene, volume) for number in sorted(set(numbers)) or there]


def _job(number: int, path: Path, volume: Path | None) -> _Job:
    recipe = RECIPES[number]
    if not recipe.takes_volume:
        return _Job(number, path, load_scene(path))
    if volume is not None:
        return _Job(number, path, load_scene(path, volume=volume), (f"The volume is {volume.name}.",))
    try:
        return _Job(number, path, load_scene(path))
    except SceneError as error:
        (problem, *others) = error.problems
        if others or problem.path != "volume.file" or not problem.what.startswith("no such file"):
            raise
        missing = problem.got
    note = (
        f"There is no {Path(missing or '').name} beside the scene file: an engine block made up by a formula stands in "
        "for it. Give --volume FILE to have the scan."
    )
    return _Job(number, path, load_scene(path, overrides=[_FALLBACK_VOLUME]), (note,))


def _page(jobs: Sequence[_Job], *, quiet: bool) -> tuple[list[Figure], str]:
    # Imported here: numpy, numba, matplotlib and GL take longer to load than --help may take to answer.
    from hsplat_cli.executors import open_rasterizer
    from hsplat_cli.reports import plot_style
    from hsplat_cli.scenes import read_volume_guarded
    from hsplat_cli.studies import (
        Studio,
        paper_page,
    )

    report_first_run(quiet=quiet)
    num_threads = num_cores()
    work = [RECIPES[job.number].work for job in jobs]
    figures: list[Figure] = []
    with (
        open_rasterizer(needs_opengl=True) as rasterizer,
        plot_style(),
        progress(work, label="paper", quiet=quiet, unit="figures") as bar,
    ):
        # Before any figure is drawn, so that a volume that cannot be read costs no wait.
        volumes = {job.scene.volume: read_volume_guarded(job.scene.volume) for job in jobs}
        studio = Studio(rasterizer, volumes, time.perf_counter, num_threads)
        for job in jobs:
            figures.append(job.make(studio))
            bar.advance(f"figure {job.number}")
        return figures, paper_page(figures, facts=describe_machine(rasterizer.renderer_name))


def _report(jobs: Sequence[_Job], figures: Sequence[Figure], path: Path) -> None:
    for note in dict.fromkeys(note for job in jobs for note in job.notes):
        click.echo(f"note: {note}")
    for figure in figures:
        for claim in figure.claims:
            click.echo(f"figure {figure.number}: {'seen' if claim.seen else 'NOT SEEN'}: {claim.says}")
    click.echo(f"all of it: {path}")
