"""Folders, command line, scenes, work in turns and tables of the benchmarks."""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

import renderer
from hsplat_cli.terminal import describe_machine
from renderer.accuracy import ExactPixels, FrameProber, psnr
from renderer.draw import SplatRasterizer
from renderer.frame import FilmStage
from renderer.scene import Scene
from renderer.volume import Float64

ROOT = Path(__file__).resolve().parents[2]
PAGES = ROOT / "build" / "benchmarks"
SCENES = Path(__file__).with_name("scenes")
THREADS = os.cpu_count() or 1
# Pixels of each frame that are compared with exact rays where the exact rays of all pixels would take many minutes.
PROBES = 4096


class Point(NamedTuple):
    """A setting, by its tolerance or its name, with the accuracy and the milliseconds of a frame."""

    setting: str
    psnr: float
    ms: float


def fastest(points: Sequence[Point], psnr: float) -> Point | None:
    """Return the fastest that reaches an accuracy, if any does."""
    return min((point for point in points if point.psnr >= psnr), key=lambda point: point.ms, default=None)


class SampledTruth:
    """The means over some pixels of some frames of a scene, by exact rays."""

    def __init__(self, stage: FilmStage, frames: Sequence[int]) -> None:
        self._prober = FrameProber(stage.first, PROBES, num_threads=THREADS)
        self._frames = frames
        self._exact = list[ExactPixels]()

    def psnr(self, pictures: Sequence[Float64]) -> float:
        """Return the PSNR of pictures of the frames, float64 [h, w, 3]; the first ones say which pixels are compared.

        It is infinite if the errors are too small to be told from those of the exact rays.
        """
        if not self._exact:
            images = [np.rint(255 * picture).astype(np.uint8) for picture in pictures]
            numbered = zip(self._frames, images, strict=True)
            self._exact = [self._prober.exact_pixels(number, image) for number, image in numbered]
        probes = [exact.compare_picture(picture) for exact, picture in zip(self._exact, pictures, strict=True)]
        return psnr(statistics.fmean(probe.samples.mean for probe in probes))


def parser_of(description: str | None) -> argparse.ArgumentParser:
    """Return a parser that takes the folder of the volumes, with the first line of a module's docstring."""
    parser = argparse.ArgumentParser(description=(description or "").split("\n", maxsplit=1)[0])
    parser.add_argument("data", type=Path, help="the folder with engine.nhdr and bonsai.nhdr")
    return parser


def write_page(page: Path, lines: Iterable[str]) -> None:
    """Write all tables of a benchmark. The page of this name in docs/benchmarks has the one that decides, by hand."""
    page.parent.mkdir(parents=True, exist_ok=True)
    page.write_text("\n".join(lines).rstrip("\n") + "\n", encoding="utf-8")
    print(page)


def machine_line() -> str:
    """Say at which commit and on which machine figures are measured."""
    with SplatRasterizer() as rasterizer:
        return "Commit {commit}; {processor}, {cores} cores; {device}.".format(
            **describe_machine(f"splats by {rasterizer.device}")
        )


def medians_in_turns(
    works: Sequence[Callable[[], object]], repeats: int, clock: Callable[[], float] = time.process_time
) -> list[float]:
    """Return the median of the seconds of each, when they take turns; the first turn is not counted."""
    turns = [[_taken(work, clock) for work in works] for _ in range(repeats + 1)]
    return [statistics.median(taken) for taken in zip(*turns[1:], strict=True)]


def _taken(work: Callable[[], object], clock: Callable[[], float]) -> float:
    begin = clock()
    work()
    return clock() - begin


class Subject(NamedTuple):
    """A volume whose suggested scene is drawn."""

    file: str
    is_lit: bool = True
    is_splats: bool = False


SUBJECTS = {
    "engine, CT": Subject("engine.nhdr"),
    "bonsai, CT": Subject("bonsai.nhdr"),
    "fuel, simulation, not lit": Subject("fuel.nhdr", is_lit=False),
    "hydrogen atom": Subject("hydrogenAtom.nhdr"),
    "neghip, splats, not lit": Subject("neghip.nhdr", is_lit=False, is_splats=True),
    "Marschner-Lobb": Subject("marschnerlobb.nhdr"),
    "head, CT, splats": Subject("medical/headsq_quarter.nrrd", is_splats=True),
    "head, CT, oblique": Subject("medical/CT_pitch.nii.gz"),
    "chest, CT, not lit": Subject("medical/LIDC2.mha", is_lit=False),
    "head, proton density": Subject("medical/chris_PD.nii.gz"),
    "head, T1 atlas": Subject("medical/PD25_T1.nii.gz"),
    "head, MR, not lit": Subject("medical/seg3d_MR.nii.gz", is_lit=False),
    "head, T1 of CIT168": Subject("medical/CIT168_T1w.nii.gz"),
    "engine, splats, not lit": Subject("engine.nhdr", is_lit=False, is_splats=True),
}


def suggested(data: Path, name: str, size: tuple[int, int], *, num_frames: int = 0) -> Scene:
    """Return the suggested scene of a subject, with fewer frames, without its light or as splats."""
    subject = SUBJECTS[name]
    scene = renderer.suggest_scene(data / subject.file, size=size)
    if num_frames:
        scene = replace(scene, camera=replace(scene.camera, path=replace(scene.camera.path, frames=num_frames)))
    if subject.is_splats:
        scene = replace(scene, splat=replace(scene.splat, footprint="gaussian"))
    return scene if subject.is_lit else scene.with_layers(shading=None)


def section(title: str, text: str, columns: str) -> Iterator[str]:
    """Yield a heading, a paragraph and the head of a table. columns: such as `volume | time`."""
    yield from (f"## {title}", "", text, "", f"| {columns} |", "| --- " * (columns.count(" | ") + 1) + "|")


def span(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"
