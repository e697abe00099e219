"""How well are wanted accuracies met? `python tests/bench/goals.py DATA` writes the page of it.

Finds tolerances for short films, draws them and compares every frame with many exact rays that the search did not have.
The page is docs/benchmarks/goals.md.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple
from unittest.mock import patch

import numpy as np
from measuring import PAGES, SUBJECTS, THREADS, machine_line, parser_of, section, span, suggested, write_page

from renderer.accuracy import (
    ExactPixels,
    ExactRays,
    FoundTolerances,
    FrameProber,
    Trial,
    find_tolerances,
    psnr,
    tolerance_ladder,
)
from renderer.draw import Rasterizer, open_rasterizer
from renderer.frame import Frame, Stage, make_primitive, prepare_stage, render_frames
from renderer.scene import MetricTarget, with_tolerance, with_tolerances
from renderer.volume import Float64

# The tolerances from which on pixels are interpolated, and then farther apart.
STRIDES = (2.0, 1.0, 0.6, 0.15)

PAGE = PAGES / "goals.md"
SIZE, NUM_FRAMES = (512, 512), 24
GOALS, SPLAT_GOALS = (54.0, 48.0, 42.0, 36.0), (28.0, 25.0)  # the pixels for the rays are chosen at the first one
# The films of these are drawn at one tolerance, too.
COMPARED = ("engine, CT", "bonsai, CT", "chest, CT, not lit", "head, CT, oblique")
NAMES = (
    *("engine, CT", "bonsai, CT", "fuel, simulation, not lit", "hydrogen atom", "chest, CT, not lit"),
    *("head, proton density", "head, MR, not lit", "head, CT, oblique", "head, CT, splats"),
)
RAYS, SEED = 8192, 9  # the search has seed 0
WARM_TOLERANCE, TURNS = 0.1, 3
# A film is too good from here on, and a miss is a large one, in dB.
TOO_GOOD, LARGE_MISS = 3.0, 0.5


class Film(NamedTuple):
    """A film for a goal: its frames' PSNR, their standard deviations in dB, and their tolerances.

    seconds, cpu_seconds: of the search, without the drawing of its trial pictures.
    coarser, coarser_psnrs: the tolerances a step coarser, and the frames' PSNR with them; empty if it is not too good.
    """

    scene: str
    goal: float
    is_reachable: bool
    psnrs: Sequence[float]
    deviations: Sequence[float]
    tolerances: Sequence[float]
    num_trials: int
    seconds: float
    cpu_seconds: float
    coarser: Sequence[float]
    coarser_psnrs: Sequence[float]

    @property
    def excess(self) -> float:
        """Return by how many dB the mean is better than the goal."""
        return float(np.mean(self.psnrs)) - self.goal

    @property
    def share(self) -> float:
        """Return the share of the frames that reach the goal."""
        return float(np.mean(np.greater_equal(self.psnrs, self.goal)))


class Saving(NamedTuple):
    """A film beside the same at one tolerance, the finest of its own: milliseconds of a frame, and the mean PSNR."""

    scene: str
    goal: float
    tolerance: float
    ms: float
    psnr: float
    ms_of_one: float
    psnr_of_one: float

    @property
    def saved(self) -> float:
        """Return the share of the time that varying tolerances save."""
        return 1 - self.ms / self.ms_of_one


class Drawn(NamedTuple):
    """A film as it was drawn. ms: processor time of a frame."""

    psnrs: list[float]
    deviations: list[float]
    ms: float


@dataclass(frozen=True)
class Measured:
    """All that was measured, and where."""

    machine: str
    films: list[Film]
    savings: list[Saving]


@dataclass(frozen=True)
class Room:
    """A stage on which a film is drawn. exact: the exact pixels of its frames, filled by the first film."""

    stage: Stage
    rasterizer: Rasterizer
    prober: FrameProber
    exact: dict[int, ExactPixels]

    def draw(self, tolerances: Sequence[float]) -> Drawn:
        """Draw a film with these tolerances and compare it."""
        at = replace(self.stage, scene=with_tolerances(self.stage.scene, dict(enumerate(tolerances))))
        psnrs, deviations, seconds = [], [], 0.0
        for frame in render_frames(at, range(NUM_FRAMES), self.rasterizer, clock=time.process_time):
            seconds += sum(frame.seconds.values())
            if frame.number not in self.exact:
                self.exact[frame.number] = self.prober.exact_pixels(frame.number, frame.image)
            samples = self.exact[frame.number].compare_radiance(frame.radiance).samples
            psnrs.append(psnr(samples.mean))
            deviations.append(10 / math.log(10) * samples.deviation / samples.mean)
        return Drawn(psnrs, deviations, 1e3 * seconds / NUM_FRAMES)


def main() -> None:
    parser = parser_of(__doc__)
    parser.add_argument("--raw", type=Path, help="a JSON file for the figures; scenes that it has are not measured")
    arguments = parser.parse_args()
    raw: Path | None = arguments.raw
    found = load(raw) if raw and raw.exists() else Measured(machine_line(), [], [])
    for name in NAMES:
        if all(film.scene != name for film in found.films):
            measure(arguments.data, name, found)
            if raw:
                raw.write_text(json.dumps([found.machine, found.films, found.savings]), encoding="utf-8")
    write_page(PAGE, page(found))


def load(raw: Path) -> Measured:
    """Return what an earlier run measured."""
    machine, films, savings = json.loads(raw.read_text("utf-8"))
    return Measured(machine, [Film(*each) for each in films], [Saving(*each) for each in savings])


def measure(data: Path, name: str, found: Measured) -> None:
    """Find tolerances for each goal of a scene, draw the films, and add their figures."""
    scene = suggested(data, name, SIZE, num_frames=NUM_FRAMES)
    with (
        prepare_stage(scene, clock=time.process_time, num_threads=THREADS, any_tolerance=True) as stage,
        open_rasterizer(scene) as rasterizer,
    ):
        warm_up(stage, rasterizer)
        room = Room(stage, rasterizer, FrameProber(stage, RAYS, seed=SEED, num_threads=THREADS), {})
        for goal in SPLAT_GOALS if SUBJECTS[name].is_splats else GOALS:
            film = film_of(room, name, goal)
            found.films.append(film)
            print(_row(film), flush=True)
            if name in COMPARED:
                found.savings.append(saving_of(room, film))
                print(found.savings[-1], flush=True)


def warm_up(stage: Stage, rasterizer: Rasterizer) -> None:
    """Draw and probe a frame, so that nothing is compiled later."""
    at = replace(stage, scene=with_tolerance(stage.scene, WARM_TOLERANCE))
    (frame,) = render_frames(at, [0], rasterizer, clock=time.process_time)
    FrameProber(at, 1, num_threads=THREADS).probe(0, frame.image)


def film_of(room: Room, name: str, goal: float) -> Film:
    """Find tolerances, draw the film, and where it is too good draw it a step coarser."""
    found, num_trials, (seconds, cpu_seconds) = searched(room, MetricTarget("psnr", goal))
    tolerances = [found.by_frame[number] for number in range(NUM_FRAMES)]
    drawn = room.draw(tolerances)
    figures = (drawn.psnrs, drawn.deviations, tolerances, num_trials, seconds, cpu_seconds)
    film = Film(name, goal, found.is_reachable, *figures, [], [])
    if film.excess <= TOO_GOOD:
        return film
    ladder = tolerance_ladder(room.stage.largest_error, make_primitive(room.stage).work, ExactRays.step)
    coarser = [ladder[max(ladder.index(each) - 1, 0)] for each in tolerances]
    return film._replace(coarser=coarser, coarser_psnrs=room.draw(coarser).psnrs)


def searched(room: Room, want: MetricTarget) -> tuple[FoundTolerances, int, Float64]:
    """Return what the search finds, its number of trials, and its seconds by both clocks without drawing."""
    drawing, trials = np.zeros(2), list[Trial]()

    def timed_frames(*arguments: Any, **options: Any) -> Iterator[Frame]:
        begin = clocks()
        frames = list(render_frames(*arguments, **options))
        drawing[:] += clocks() - begin
        yield from frames

    begin = clocks()
    with patch("renderer.accuracy.search.render_frames", timed_frames):
        found = find_tolerances(
            room.stage,
            range(NUM_FRAMES),
            ExactRays(room.stage, want, num_threads=THREADS),
            room.rasterizer,
            is_constant=room.stage.scene.needs_opengl,
            clock=time.perf_counter,
            on_trial=trials.append,
        )
    return found, len(trials), clocks() - begin - drawing


def clocks() -> Float64:
    """Return the seconds by the clock, and those of all threads."""
    return np.array([time.perf_counter(), time.process_time()])


def saving_of(room: Room, film: Film) -> Saving:
    """Draw a film, which was drawn before, and the same at the finest of its tolerances, in turns."""
    finest = min(film.tolerances)
    turns = [(room.draw(film.tolerances), room.draw([finest] * NUM_FRAMES)) for _ in range(TURNS)]
    ms, ms_of_one = (median(drawn.ms for drawn in films) for films in zip(*turns, strict=True))
    psnrs = [float(np.mean(drawn.psnrs)) for drawn in turns[0]]
    return Saving(film.scene, film.goal, finest, ms, psnrs[0], ms_of_one, psnrs[1])


def page(found: Measured) -> Iterator[str]:
    """Yield the lines of the page."""
    deviations = np.concatenate([film.deviations for film in found.films])
    yield found.machine
    yield ""
    yield (
        f"The PSNR of a frame is known to {np.median(deviations):.1f} dB (the median of its standard deviations; "
        f"{deviations.max():.1f} dB at the most)."
    )
    yield ""
    yield from summary(found.films, [each.saved for each in found.savings])
    yield from each_film(found.films)
    yield from too_good([film for film in found.films if film.coarser])
    yield from savings(found.savings)


def summary(films: Sequence[Film], saved: Sequence[float]) -> Iterator[str]:
    """Yield a table of what the films say together. saved: the shares of time that varying tolerances save."""
    reachable = [film for film in films if film.is_reachable]
    margins = np.concatenate([np.subtract(film.psnrs, film.goal) for film in reachable])
    excess = [film.excess for film in reachable]
    all_reach, most_reach = (sum(film.share >= least for film in reachable) for least in (1, 0.9))
    trials, seconds = ([getattr(film, name) for film in films] for name in ("num_trials", "cpu_seconds"))
    worst = min(reachable, key=lambda film: min(film.psnrs) - film.goal)
    rows = {
        "frames that reach their goal": f"{np.mean(margins >= 0):.1%}",
        f"frames that reach it or miss it by at most {LARGE_MISS:g} dB": f"{np.mean(margins >= -LARGE_MISS):.1%}",
        f"the worst frame, of {worst.scene} at {worst.goal:g} dB, misses it by": f"{max(0.0, -margins.min()):.1f} dB",
        "films in which all frames reach it": f"{all_reach}; at least nine of ten in {most_reach}",
        "too good by": f"{np.median(excess):.1f} dB in the median, {min(excess):.1f} to {max(excess):.1f}",
        "trial pictures of a search": f"{np.median(trials):.0f} in the median, at most {max(trials)}",
        "a search beyond their drawing": (
            f"{np.median(seconds):.1f} s of a processor in the median, at most {max(seconds):.1f}"
        ),
        "varying tolerances against the finest one for all frames": (
            f"{_percent(float(np.mean(saved)))} of the time saved in the mean, {_percent(min(saved))} to "
            f"{_percent(max(saved))}"
        ),
    }
    yield from section("Summary", "", f"measure | of {len(reachable)} films, {margins.size} frames")
    yield from (f"| {measure} | {value} |" for measure, value in rows.items())
    yield ""


def each_film(films: Sequence[Film]) -> Iterator[str]:
    """Yield a row for each film."""
    text = (
        "*Too good*: the mean PSNR of the frames, less the goal. *Search*: seconds without the drawing of its trial "
        "pictures, by the clock and of all processors: mostly exact rays. Other work on the machine was not excluded."
    )
    columns = "scene | goal, dB | reach it | mean, dB | least, dB | too good, dB | trials | search | CPU | tolerances"
    yield from section("Each film", text, columns)
    yield from map(_row, by_goal(films))
    yield ""


def _row(film: Film) -> str:
    goal = f"{film.goal:g}" if film.is_reachable else f"{film.goal:g}, not reachable"
    accuracy = f"{film.share:.0%} | {np.mean(film.psnrs):.1f} | {min(film.psnrs):.1f} | {film.excess:.1f}"
    search = f"{film.num_trials} | {film.seconds:.1f} s | {film.cpu_seconds:.1f} s"
    return f"| {film.scene} | {goal} | {accuracy} | {search} | {span(film.tolerances)} |"


def by_goal(rows: Sequence[Any]) -> list[Any]:
    """Return rows with each scene's goals in ascending order."""
    return sorted(rows, key=lambda row: (NAMES.index(row.scene), row.goal))


def too_good(films: Sequence[Film]) -> Iterator[str]:
    """Yield why films are too good."""
    listed = ", ".join(f"{least:g}" for least in reversed(STRIDES))
    text = (
        "They were drawn again with all tolerances a step coarser, of the steps that the search tries. *Enter*: frames "
        f"that thereby reach a tolerance from which on pixels are interpolated, {listed} "
        "(`renderer/bricks/pixel_grid.py`). Accuracy falls there at once: a goal between the two gets the finer one. "
        "*No coarser*: frames that have the coarsest tolerance that the search tries. *Spread*: by how much frames of "
        "the film at one tolerance differ, at the most. Where it is large, frames between those that were tried may be "
        "much better than these."
    )
    columns = "scene | goal, dB | mean, dB | a step coarser: mean, dB | reach it | enter | no coarser | spread, dB"
    yield from section(f"Films more than {TOO_GOOD:g} dB too good", text, columns)
    for film in by_goal(films):
        coarser = film._replace(psnrs=film.coarser_psnrs)
        accuracy = f"{np.mean(film.psnrs):.1f} | {np.mean(coarser.psnrs):.1f} | {coarser.share:.0%}"
        steps = list(zip(film.tolerances, film.coarser, strict=True))
        entering = {least: sum(before < least <= after for before, after in steps) for least in STRIDES}
        entered = ", ".join(f"{num} at {least:g}" for least, num in entering.items() if num)
        no_coarser = sum(before == after for before, after in steps)
        reasons = f"{entered or 'none'} | {no_coarser} | {spread(film):.1f}"
        yield f"| {film.scene} | {film.goal:g} | {accuracy} | {reasons} |"
    yield ""


def spread(film: Film) -> float:
    """Return by how many dB frames at one tolerance differ, at the most."""
    values = np.array(film.psnrs)
    return float(max(np.ptp(values[np.equal(film.tolerances, each)]) for each in set(film.tolerances)))


def savings(found: Sequence[Saving]) -> Iterator[str]:
    """Yield what varying tolerances save."""
    saved = [each.saved for each in found]
    alike = [each.saved for each in found if each.psnr == each.psnr_of_one]
    text = (
        "The same films at one tolerance, the finest of those that were found: processor milliseconds of a frame, "
        f"medians of {TURNS} films in turns. PSNR is the mean of the frames. Varying tolerances save "
        f"{_percent(float(np.mean(saved)))} of the time on the mean, {_percent(min(saved))} to {_percent(max(saved))}."
    )
    if alike:
        listed = ", ".join(map(_percent, alike))
        text += f" Where the search found one tolerance, both films are the same; what differs is chance: {listed}."
    columns = "scene | goal, dB | varying | PSNR, dB | one tolerance | its time | PSNR, dB | saved"
    yield from section("What varying tolerances save", text, columns)
    for each in by_goal(found):
        varying = f"{each.ms:.1f} ms | {each.psnr:.1f}"
        one = f"{each.tolerance:g} | {each.ms_of_one:.1f} ms | {each.psnr_of_one:.1f}"
        yield f"| {each.scene} | {each.goal:g} | {varying} | {one} | {_percent(each.saved)} |"
    yield ""


def _percent(share: float) -> str:
    return f"{round(100 * share)}%"


if __name__ == "__main__":
    main()
