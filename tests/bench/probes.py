"""How often do the intervals of probes hold the truth? `python tests/bench/probes.py DATA` writes the page of it.

Computes the mean over each pixel of some frames, once, so that the error at each tolerance is known. Then it probes
each frame many times, with other seeds. The page is docs/benchmarks/probes.md.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from measuring import PAGES, THREADS, machine_line, parser_of, section, write_page

import renderer
from renderer.accuracy import TRUTH_TOLERANCE, ErrorSamples, FrameProber, Truth, compute_truth, pool_samples, psnr
from renderer.draw import Rasterizer, open_rasterizer
from renderer.film import Pixels
from renderer.frame import FilmStage, prepare_stage, render_frames
from renderer.scene import ModeSpec, with_tolerance
from renderer.volume import Float64

PAGE = PAGES / "probes.md"
# Suggested scenes, each with its volume and its mode; the intervals were not tuned to them.
SCENES = {
    "engine, CT": ("engine.nhdr", None),
    "bonsai, CT": ("bonsai.nhdr", None),
    "labels of a head": ("medical/PD25_labels.nii.gz", None),
    "chest, CT": ("medical/LIDC2.mha", None),
    "engine, maximum": ("engine.nhdr", "maximum"),
}
SIZE = (128, 128)
FRAMES = (5, 35, 65, 95)
TOLERANCES = (1.0, 0.5, 0.3, 0.1, 0.03)
PROBES, FILM_PROBES = (16, 64, 256), 64
REPEATS = 100
# Of the long film: it has each frame so often.
TIMES = 30
TIMED_TOLERANCE, TIMED_ROUNDS = 0.1, 5


class Case(NamedTuple):
    """A scene at a tolerance. mse: of the frames together.

    frames, films: for each number of probes whether the interval holds the truth, and its half-width in decibels,
        float64 [n, 2]. Films have all frames. long_films: with each frame many times, at FILM_PROBES.
    normal_frames, normal_films: the share of intervals that hold it if errors are taken for normal, at FILM_PROBES.
    """

    tolerance: float
    mse: float
    frames: dict[int, Float64]
    films: dict[int, Float64]
    long_films: Float64
    normal_frames: float
    normal_films: float


@dataclass(frozen=True)
class Figures:
    """The figures of a scene. draw_ms, probe_ms: of a frame, by the processor's clock."""

    name: str
    cases: Sequence[Case]
    draw_ms: float
    probe_ms: float

    def half_width(self, num_probes: int) -> float:
        """Return the median half-width of the intervals of frames, of all tolerances."""
        return float(np.median(np.concatenate([case.frames[num_probes][:, 1] for case in self.cases])))


class Drawn(NamedTuple):
    """A frame as it was drawn. mse: its mean squared error. probes: of each seed, by number of probes."""

    number: int
    image: Pixels
    mse: float
    probes: dict[int, list[ErrorSamples]]


def main() -> None:
    data, found = parser_of(__doc__).parse_args().data, []
    for name in SCENES:
        found.append(measured(data, name))
        print(_row(found[-1]), flush=True)
    write_page(PAGE, page(found))


def measured(data: Path, name: str) -> Figures:
    """Draw a scene and probe it many times."""
    file, mode = SCENES[name]
    scene = renderer.suggest_scene(data / file, size=SIZE)
    scene = scene if mode is None else replace(scene, mode=ModeSpec(mode)).with_layers(shading=None)
    with (
        prepare_stage(scene, clock=time.process_time, num_threads=THREADS, any_tolerance=True) as stage,
        open_rasterizer(scene) as rasterizer,
    ):
        draw_ms, probe_ms = timed(stage, rasterizer)
        truths = [compute_truth(stage, number, TRUTH_TOLERANCE, num_threads=THREADS) for number in FRAMES]
        cases = [case_of(tolerance, drawn(stage, rasterizer, tolerance, truths)) for tolerance in TOLERANCES]
    return Figures(name, cases, draw_ms, probe_ms)


def timed(stage: FilmStage, rasterizer: Rasterizer) -> tuple[float, float]:
    """Return the median milliseconds, of all threads, of drawing a frame and of probing it, in turns.

    The first round is not counted: it uploads bricks, and notes what shows nothing.
    """
    at = replace(stage, scene=with_tolerance(stage.scene, TIMED_TOLERANCE))
    prober = FrameProber(at.first, FILM_PROBES, num_threads=THREADS)
    taken = []
    for frame in render_frames(at, FRAMES * (1 + TIMED_ROUNDS), rasterizer, clock=time.process_time):
        begin = time.process_time()
        prober.probe(frame.number, frame.image)
        taken.append((1e3 * sum(frame.seconds.values()), 1e3 * (time.process_time() - begin)))
    drawing, probing = zip(*taken[len(FRAMES) :], strict=True)
    return median(drawing), median(probing)


def drawn(stage: FilmStage, rasterizer: Rasterizer, tolerance: float, truths: Sequence[Truth]) -> list[Drawn]:
    """Draw all frames at a tolerance, compare them with their truths, and probe them."""
    at = replace(stage, scene=with_tolerance(stage.scene, tolerance))
    found = []
    for frame, truth in zip(render_frames(at, FRAMES, rasterizer, clock=time.process_time), truths, strict=True):
        errors = (frame.image / 255 - truth.means.colors) ** 2 - truth.means.variances
        found.append(Drawn(frame.number, frame.image, float(errors.mean()), probed(at, frame.number, frame.image)))
    return found


def probed(stage: FilmStage, number: int, image: Pixels) -> dict[int, list[ErrorSamples]]:
    """Return what the probes of each seed find in a frame, by number of probes."""
    found: dict[int, list[ErrorSamples]] = {}
    for num in PROBES:
        probers = (FrameProber(stage.first, num, seed=seed, num_threads=THREADS) for seed in range(REPEATS))
        found[num] = [prober.probe(number, image).samples for prober in probers]
    return found


def case_of(tolerance: float, frames: Sequence[Drawn]) -> Case:
    """Look which intervals of the probes of frames hold the truth."""
    truths, probes = [frame.mse for frame in frames], [frame.probes for frame in frames]
    whole = float(np.mean(truths))

    def of_frames(num_probes: int) -> list[tuple[ErrorSamples, float]]:
        return [(each, truth) for probe, truth in zip(probes, truths, strict=True) for each in probe[num_probes]]

    def of_films(num_probes: int) -> list[tuple[ErrorSamples, float]]:
        of_seeds = zip(*(probe[num_probes] for probe in probes), strict=True)
        return [(pool_samples(of_seed), whole) for of_seed in of_seeds]

    return Case(
        tolerance,
        whole,
        {num: intervals(of_frames(num)) for num in PROBES},
        {num: intervals(of_films(num)) for num in PROBES},
        intervals((film, whole) for film in long_films([probe[FILM_PROBES] for probe in probes])),
        normal_share(of_frames(FILM_PROBES)),
        normal_share(of_films(FILM_PROBES)),
    )


def long_films(probes: Sequence[Sequence[ErrorSamples]]) -> Iterator[ErrorSamples]:
    """Yield films that have each frame TIMES times, every time with another of the seeds."""
    random = np.random.default_rng(0)
    for _ in range(REPEATS):
        yield pool_samples([of_frame[k] for of_frame in probes for k in random.permutation(REPEATS)[:TIMES]])


def intervals(samples: Iterable[tuple[ErrorSamples, float]]) -> Float64:
    """Return whether each interval holds the truth, and its half-width in decibels, float64 [n, 2]."""
    rows = []
    for each, truth in samples:
        low, high = each.interval
        rows.append((low <= truth <= high, (psnr(low) - psnr(high)) / 2))
    return np.array(rows, np.float64)


def normal_share(samples: Sequence[tuple[ErrorSamples, float]]) -> float:
    """Return how many intervals hold the truth that reach as far as for a normal distribution."""
    holds = [abs(each.mean - truth) <= 1.96 * math.sqrt(each.variance / each.num) for each, truth in samples]
    return float(np.mean(holds))


def page(found: Sequence[Figures]) -> Iterator[str]:
    """Yield the lines of the page."""
    yield machine_line()
    yield ""
    yield from scenes(found)
    yield from together([case for each in found for case in each.cases])
    yield from times(found)


def scenes(found: Sequence[Figures]) -> Iterator[str]:
    """Yield a row for each scene."""
    text = (
        f"Shares are those of the tolerance where they are least, at {FILM_PROBES} probes a frame: *frame* of "
        f"{REPEATS * len(FRAMES)} intervals, *film* of {REPEATS} of all {len(FRAMES)} frames together. *Normal* is the "
        "share for frames if the interval were the mean and 1.96 of its standard errors either way. The least of "
        f"{len(TOLERANCES)} shares lies below 95 % by chance, where each is 95 %: about 1 % for frames and 2 % for "
        "films. Half-widths are medians over all tolerances, of frames."
    )
    widths = " | ".join(f"+- dB, {num} probes" for num in PROBES)
    columns = f"scene | PSNR, dB | frame, least | film, least | normal, least | {widths}"
    yield from section("Each scene", text, columns)
    yield from map(_row, found)
    yield ""


def _row(figures: Figures) -> str:
    decibels = [psnr(case.mse) for case in figures.cases]
    frame = _least(figures.cases, lambda case: case.frames[FILM_PROBES][:, 0].mean())
    film = _least(figures.cases, lambda case: case.films[FILM_PROBES][:, 0].mean())
    normal = _least(figures.cases, lambda case: case.normal_frames)
    widths = " | ".join(f"{figures.half_width(num):.2f}" for num in PROBES)
    return f"| {figures.name} | {min(decibels):.1f} to {max(decibels):.1f} | {frame} | {film} | {normal} | {widths} |"


def _least(cases: Sequence[Case], share: Callable[[Case], float]) -> str:
    worst = min(cases, key=share)
    return f"{share(worst):.1%} at {worst.tolerance:g}"


def together(cases: Sequence[Case]) -> Iterator[str]:
    """Yield the rows over all scenes and tolerances."""
    text = (
        f"The long film has each of the {len(FRAMES)} frames {TIMES} times, with {TIMES} of the {REPEATS} seeds drawn "
        "by chance: films share probes, so that a share of one case is uncertain by several percent. *Mean* and "
        "*least* are over the cases, half-widths medians and the one that 95 % of intervals stay below."
    )
    columns = "of | probes a frame | holds, mean | holds, least | half-width, dB | 95 % below"
    yield from section("All scenes", text, columns)
    for num in PROBES:
        yield _share_row("frame", num, [case.frames[num] for case in cases])
    for num in PROBES:
        yield _share_row(f"film of {len(FRAMES)} frames", num, [case.films[num] for case in cases])
    yield _share_row(f"film of {len(FRAMES) * TIMES} frames", FILM_PROBES, [case.long_films for case in cases])
    yield ""
    normal = [[case.normal_frames for case in cases], [case.normal_films for case in cases]]
    frame, film = (f"{np.mean(shares):.1%} on the mean and {min(shares):.1%} at the least" for shares in normal)
    yield f"Normal intervals at {FILM_PROBES} probes hold {frame} for a frame, and {film} for a film of {len(FRAMES)}."
    yield ""


def _share_row(of: str, num_probes: int, found: Sequence[Float64]) -> str:
    holds, widths = [float(each[:, 0].mean()) for each in found], np.concatenate([each[:, 1] for each in found])
    below = np.quantile(widths, 0.95, method="lower")
    shares = f"{np.mean(holds):.1%} | {min(holds):.1%}"
    return f"| {of} | {num_probes} | {shares} | {np.median(widths):.2f} | {below:.2f} |"


def times(found: Sequence[Figures]) -> Iterator[str]:
    """Yield what the probes of a frame cost."""
    text = (
        f"`FrameProber.probe` with {FILM_PROBES} probes, beside the frame's own drawing at `tolerance: "
        f"{TIMED_TOLERANCE:g}`: CPU milliseconds of all threads, medians of {TIMED_ROUNDS * len(FRAMES)} frames in "
        "turns. The first round of frames, which uploads bricks and finds empty space, is not counted. Encoding is not "
        "counted, either. Other work on the machine was not excluded."
    )
    yield from section("What probes cost", text, "scene | drawing | probing | share")
    for each in found:
        share = each.probe_ms / each.draw_ms
        yield f"| {each.name} | {each.draw_ms:.1f} ms | {each.probe_ms:.1f} ms | {share:.0%} |"


if __name__ == "__main__":
    main()
