"""Reproduce the figures of Laur and Hanrahan 1991: `python tests/paper/reproduce.py` writes paper/index.html.

D. Laur, P. Hanrahan, "Hierarchical Splatting: A Progressive Refinement Algorithm for Volume Rendering", SIGGRAPH 1991.

The page states what the paper claims, what was measured, and whether that confirms the claim. `scenes/` has the scene
of each figure. In the module of a figure `measure` draws and counts, `check_claims` compares the numbers with the
claims, and `make_figure` lays out both for the page; `figure.py` opens stages and draws.
"""

from __future__ import annotations

import argparse
import os
import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import footprints
import levels
import octrees
import one_splat
import opacity
import refinement
from figure import FigureRenderer, PaperFigure

from hsplat_cli.reports import format_facts, page_environment
from hsplat_cli.terminal import describe_machine
from renderer.draw import SplatRasterizer
from renderer.scene import load_scene

HERE = Path(__file__).parent
FIGURES: dict[str, ModuleType] = {
    "1_footprints.yaml": footprints,
    "2_opacity.yaml": opacity,
    "3_one_splat.yaml": one_splat,
    "4_levels.yaml": levels,
    "5_octrees.yaml": octrees,
    "6_engine.yaml": refinement,
}
# Figures whose scene may have any volume; the paper's scan of an engine is not in the repository.
OF_ANY_VOLUME = (octrees, refinement)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("--volume", type=Path, help="a scan in place of the procedural engine of figures 5 and 6")
    parser.add_argument("--output", type=Path, default=Path("paper"), help="the folder of the page")
    arguments = parser.parse_args()
    figures: dict[int, PaperFigure] = {}
    with SplatRasterizer() as rasterizer:
        figure_renderer = FigureRenderer(rasterizer, time.perf_counter, os.cpu_count() or 1)
        for number, (file, module) in enumerate(FIGURES.items(), start=1):
            figures[number] = make_figure(file, module, figure_renderer, arguments.volume)
            for claim in figures[number].claims:
                verdict = "confirmed" if claim.is_confirmed else "NOT CONFIRMED"
                print(f"figure {number}: {verdict}: {claim.statement} Measured: {claim.measured}.", flush=True)
        text = page(figures, describe_machine(rasterizer.device))
    arguments.output.mkdir(parents=True, exist_ok=True)
    (arguments.output / "index.html").write_text(text, encoding="utf-8")


def make_figure(file: str, module: ModuleType, figure_renderer: FigureRenderer, volume: Path | None) -> PaperFigure:
    """Draw and measure a figure, with another volume where it takes any."""
    takes_volume = volume is not None and module in OF_ANY_VOLUME
    scene = load_scene(HERE / "scenes" / file, volume=volume if takes_volume else None)
    figure: PaperFigure = module.make_figure(scene, figure_renderer)
    return replace(figure, notes=(f"The volume is {volume}.", *figure.notes)) if takes_volume else figure


def page(figures: Mapping[int, PaperFigure], machine: Mapping[str, object]) -> str:
    """Return the page of figures, by their numbers."""
    template = page_environment().from_string((HERE / "page.html").read_text("utf-8"))
    title = "Hierarchical splatting, 1991, reproduced"
    return template.render(title=title, facts=format_facts(machine), figures=figures)


if __name__ == "__main__":
    main()
