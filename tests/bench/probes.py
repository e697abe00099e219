"""How often do the intervals of probes hold the truth? `python tests/bench/probes.py DATA` writes the page of it.

Integrates all pixels of some frames, once. The error of each pixel at each tolerance is then known, and a probe takes
what it would measure from there: many probes cost little. The page is docs/benchmarks/probes.md.
"""

from __future__ import annotations

import math
import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import NamedTuple

import numpy as np
from measuring import PAGES, SUBJECTS, THREADS, machine_line, parser_of, section, suggested, write_page

from renderer.accuracy import ErrorSamples, FrameProber, choose_pixels, error_samples, pool_samples, psnr
from renderer.draw import Rasterizer, open_rasterizer
from renderer.film import Pixels, over_background
from renderer.frame import Stage, prepare_stage, render_frames, view_of
from renderer.scene import with_tolerance
from renderer.transfer import make_transfer_function
from renderer.truth import RayIntegrator, TrueLayer
from renderer.volume import Float64

PAGE = PAGES / "probes.md"
SIZE, FRAMES = (512, 512), (5, 35, 65, 95)
TOLERANCES = (1.0, 0.5, 0.3, 0.1, 0.03)
RAYS, FILM_RAYS = (16, 64, 256, 1024), 64
REPEATS = 200
# Of the long film: it has each frame so often.
TIMES = 30
TIMED_TOLERANCE, TIMED_ROUNDS = 0.1, 5
STEP = 0.5  # of the truth, in voxels


class Case(NamedTuple):
    """A scene at a tolerance. mse: of the frames together.

    frames, films: for each number of rays whether the interval holds the truth, and its half-width in decibels, float64
        [n, 2]. Films have all frames. long_films: with each frame many times, at FILM_RAYS.
    normal_frames, normal_films: the share of intervals that hold it if errors are taken for normal, at FILM_RAYS.
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

    def half_width(self, num_rays: int) -> float:
        """Return the median half-width of the intervals of frames, of all tolerances."""
        return float(np.median(np.concatenate([case.frames[num_rays][:, 1] for case in self.cases])))


class Drawn(NamedTuple):
    """A frame as it was drawn. squared_errors: float64 [pixels]."""

    number: int
    image: Pixels
    squared_errors: Float64


def main() -> None:
    data, found = parser_of(__doc__).parse_args().data, []
    with ProcessPoolExecutor(THREADS, mp_context=multiprocessing.get_context("spawn")) as processes:
        for name in SUBJECTS:
            found.append(measured(data, name, processes))
            print(_row(found[-1]), flush=True)
    write_page(PAGE, page(found))


def measured(data: Path, name: str, processes: Executor) -> Figures:
    """Draw a scene and probe it many times."""
    scene = suggested(data, name, SIZE)
    with (
        prepare_stage(scene, clock=time.process_time, num_threads=THREADS, any_tolerance=True) as stage,
        open_rasterizer(scene) as rasterizer,
    ):
        draw_ms, probe_ms = timed(stage, rasterizer)
        exact = exact_frames(stage)
        cases = [case_of(tolerance, drawn(stage, rasterizer, tolerance, exact), processes) for tolerance in TOLERANCES]
    return Figures(name, cases, draw_ms, probe_ms)


def timed(stage: Stage, rasterizer: Rasterizer) -> tuple[float, float]:
    """Return the median milliseconds, of all threads, of drawing a frame and of probing it, in turns.

    The first round is not counted: it uploads bricks, and notes what shows nothing.
    """
    at = replace(stage, scene=with_tolerance(stage.scene, TIMED_TOLERANCE))
    prober = FrameProber(at, FILM_RAYS, num_threads=THREADS)
    taken = []
    for frame in render_frames(at, FRAMES * (1 + TIMED_ROUNDS), rasterizer, clock=time.process_time):
        begin = time.process_time()
        prober.probe(frame.number, frame.image)
        taken.append((1e3 * sum(frame.seconds.values()), 1e3 * (time.process_time() - begin)))
    drawing, probing = zip(*taken[len(FRAMES) :], strict=True)
    return median(drawing), median(probing)


def exact_frames(stage: Stage) -> list[Float64]:
    """Return the exact pictures of all frames, float64 [pixels, 3]."""
    volume = stage.layers[0].volume
    transfer = make_transfer_function(stage.scene.layers[0].transfer_function, volume.finest_spacing)
    layer = TrueLayer(volume, transfer, stage.scene.layers[0].shading)
    integrator = RayIntegrator([layer], num_threads=THREADS)
    pixels = np.arange(SIZE[0] * SIZE[1])
    radiances = (integrator.integrate(view_of(stage, number), pixels, [STEP])[0] for number in FRAMES)
    return [over_background(each[:, None], stage.scene.output.background)[:, 0] for each in radiances]


def drawn(stage: Stage, rasterizer: Rasterizer, tolerance: float, exact: Sequence[Float64]) -> list[Drawn]:
    """Draw all frames at a tolerance and compare each of their pixels."""
    at = replace(stage, scene=with_tolerance(stage.scene, tolerance))
    frames = render_frames(at, FRAMES, rasterizer, clock=time.process_time)
    return [
        Drawn(frame.number, frame.image, ((frame.image.reshape(-1, 3) / 255 - truth) ** 2).mean(axis=1))
        for frame, truth in zip(frames, exact, strict=True)
    ]


def case_of(tolerance: float, frames: Sequence[Drawn], processes: Executor) -> Case:
    """Probe the frames many times, and look which intervals hold the truth."""
    truths = [float(frame.squared_errors.mean()) for frame in frames]
    whole = float(np.mean(truths))
    probes = list(processes.map(probed, frames))

    def of_frames(num_rays: int) -> list[tuple[ErrorSamples, float]]:
        return [(each, truth) for probe, truth in zip(probes, truths, strict=True) for each in probe[num_rays]]

    def of_films(num_rays: int) -> list[tuple[ErrorSamples, float]]:
        of_seeds = zip(*(probe[num_rays] for probe in probes), strict=True)
        return [(pool_samples(of_seed), whole) for of_seed in of_seeds]

    return Case(
        tolerance,
        whole,
        {num: intervals(of_frames(num)) for num in RAYS},
        {num: intervals(of_films(num)) for num in RAYS},
        intervals((film, whole) for film in long_films([probe[FILM_RAYS] for probe in probes])),
        normal_share(of_frames(FILM_RAYS)),
        normal_share(of_films(FILM_RAYS)),
    )


def probed(frame: Drawn) -> dict[int, list[ErrorSamples]]:
    """Return what each seed's probe finds, by number of rays."""
    found: dict[int, list[ErrorSamples]] = {}
    for num_rays in RAYS:
        choices = (choose_pixels(frame.image, num_rays, (seed, frame.number)) for seed in range(REPEATS))
        found[num_rays] = [error_samples(each.factors * frame.squared_errors[each.numbers]) for each in choices]
    return found


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
        f"Shares are those of the tolerance where they are least, at {FILM_RAYS} rays a frame: *frame* of "
        f"{REPEATS * len(FRAMES)} intervals, *film* of {REPEATS} of all {len(FRAMES)} frames together. *Normal* is the "
        "share for frames if the interval were the mean and 1.96 of its standard errors either way. The least of "
        f"{len(TOLERANCES)} shares lies below 95 % by chance, where each is 95 %: about 1 % for frames and 2 % for "
        "films. Half-widths are medians over all tolerances, of frames."
    )
    widths = " | ".join(f"+- dB, {num} rays" for num in RAYS)
    columns = f"scene | PSNR, dB | frame, least | film, least | normal, least | {widths}"
    yield from section("Each scene", text, columns)
    yield from map(_row, found)
    yield ""


def _row(figures: Figures) -> str:
    decibels = [psnr(case.mse) for case in figures.cases]
    frame = _least(figures.cases, lambda case: case.frames[FILM_RAYS][:, 0].mean())
    film = _least(figures.cases, lambda case: case.films[FILM_RAYS][:, 0].mean())
    normal = _least(figures.cases, lambda case: case.normal_frames)
    widths = " | ".join(f"{figures.half_width(num):.2f}" for num in RAYS)
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
    columns = "of | rays a frame | holds, mean | holds, least | half-width, dB | 95 % below"
    yield from section("All scenes", text, columns)
    for num in RAYS:
        yield _share_row("frame", num, [case.frames[num] for case in cases])
    for num in RAYS:
        yield _share_row(f"film of {len(FRAMES)} frames", num, [case.films[num] for case in cases])
    yield _share_row(f"film of {len(FRAMES) * TIMES} frames", FILM_RAYS, [case.long_films for case in cases])
    yield ""
    normal = [[case.normal_frames for case in cases], [case.normal_films for case in cases]]
    frame, film = (f"{np.mean(shares):.1%} on the mean and {min(shares):.1%} at the least" for shares in normal)
    yield f"Normal intervals at {FILM_RAYS} rays hold {frame} for a frame, and {film} for a film of {len(FRAMES)}."
    yield ""


def _share_row(of: str, num_rays: int, found: Sequence[Float64]) -> str:
    holds, widths = [float(each[:, 0].mean()) for each in found], np.concatenate([each[:, 1] for each in found])
    below = np.quantile(widths, 0.95, method="lower")
    shares = f"{np.mean(holds):.1%} | {min(holds):.1%}"
    return f"| {of} | {num_rays} | {shares} | {np.median(widths):.2f} | {below:.2f} |"


def times(found: Sequence[Figures]) -> Iterator[str]:
    """Yield what the rays of a frame cost."""
    text = (
        f"`FrameProber.probe` with {FILM_RAYS} rays, beside the frame's own drawing at `tolerance: "
        f"{TIMED_TOLERANCE:g}`: CPU milliseconds of all threads, medians of {TIMED_ROUNDS * len(FRAMES)} frames in "
        "turns. The first round of frames, which uploads bricks and finds empty space, is not counted. Encoding is not "
        "counted, either. Other work on the machine was not excluded."
    )
    yield from section("What the rays cost", text, "scene | drawing | probing | share")
    for each in found:
        share = each.probe_ms / each.draw_ms
        yield f"| {each.name} | {each.draw_ms:.1f} ms | {each.probe_ms:.1f} ms | {share:.0%} |"


if __name__ == "__main__":
    main()
