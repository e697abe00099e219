"""Figure 6: one picture at what can be drawn five times a second, in five seconds, and at full resolution."""

from __future__ import annotations

import math
from dataclasses import dataclass

from hsplat_cli.studies.paper.figure_renderer import Studio, with_error
from hsplat_cli.studies.paper.paper_figure import Claim, Figure, Picture, Row, Table
from hsplat_cli.terminal import counted
from renderer.frame import Stage
from renderer.scene import Scene
from renderer.study import DIFFERENCE_GAIN, compute_metric, difference_picture, over_background

INTERACTIVE_FRAME_S, REFINED_FRAME_S = 0.2, 5.0
# What is looked for is a little faster than needed, because no two frames take the same time.
BUDGET_SHARE = 0.9
# Tolerances between which one is looked for, and how often the ratio between them is halved: to 9 %.
COARSEST, FINEST, NUM_HALVINGS = 100.0, 1e-3, 7
QUICK_REPETITIONS, REPETITIONS = 3, 7
# Timed again, what was found may be too slow: then it is made so many times coarser, and so often.
COARSENING_FACTOR, MAX_TRIES = 1.25, 4
# An error of a tenth of the brightest, in the root mean square: the large parts are where they belong.
USEFUL_DB = 20.0
# Pictures nearer than this to each other are told apart only side by side.
INDISTINGUISHABLE_DB = 35.0


@dataclass(frozen=True)
class Drawing:
    """tolerance: 0 at full resolution. seconds: median of a frame whose cut is made. cut_seconds: to make that."""

    name: str
    budget: float | None
    tolerance: float
    seconds: float
    cut_seconds: float
    num_splats: int
    psnr_db: float

    @property
    def fits(self) -> bool:
        """Whether it takes no longer than it may."""
        return self.budget is None or self.seconds <= self.budget


@dataclass(frozen=True)
class Refinement:
    """Five times a second, in five seconds, at full resolution.

    psnr_to_full_db: of the second drawing against the third; infinite where they are the same.
    """

    drawings: tuple[Drawing, ...]
    psnr_to_full_db: float
    rows: tuple[Row, ...]


def make(scene: Scene, studio: Studio) -> Figure:
    """The figure for any scene."""
    numbers = measure(scene, studio)
    full = numbers.drawings[-1]
    notes = [
        f"{drawing.name}: full resolution takes {full.seconds:.2f} s on this machine, so this is full resolution."
        for drawing in numbers.drawings[:-1]
        if drawing.tolerance == 0
    ]
    return Figure(
        6,
        "Five times a second, in five seconds, at full resolution",
        "One view at the tolerances that meet two times on this machine, and with a splat for every visible voxel. "
        "Times are those of a frame of a film: order, draw and round to 8 bits, the cut being made once.",
        judge(numbers),
        rows=numbers.rows,
        tables=(_table(numbers),),
        notes=tuple(notes),
    )


def measure(scene: Scene, studio: Studio) -> Refinement:
    """Find the tolerances by timing, draw, and compare with the ray integral."""
    stage = studio.stage(scene)
    background = scene.output.background
    truth = studio.truth(stage)
    full_seconds = _frame_seconds_at(stage, 0.0, studio, QUICK_REPETITIONS)
    drawings, seen, pictures, differences = [], [], [], []
    for name, budget in (
        ("five times a second", INTERACTIVE_FRAME_S),
        ("in five seconds", REFINED_FRAME_S),
        ("full resolution", None),
    ):
        if budget is None or full_seconds <= budget:
            tolerance, seconds = 0.0, full_seconds
        else:
            tolerance, seconds = _finest_tolerance_within(stage, budget, studio)
        frame = studio.draw(with_error(stage, tolerance=((0, tolerance),)))
        seen.append(over_background(frame.radiance, background))
        drawing = Drawing(
            name,
            budget,
            tolerance,
            seconds,
            frame.seconds["cut"] + frame.seconds["splats"],
            frame.num_splats,
            compute_metric("psnr", seen[-1], truth),
        )
        drawings.append(drawing)
        pictures.append(Picture(frame.image, f"{name}: {drawing.seconds:.2f} s, {drawing.psnr_db:.1f} dB"))
        differences.append(Picture(difference_picture(seen[-1], truth), name))
    rows = (
        Row("The pictures", tuple(pictures)),
        Row(f"Their differences from the ray integral, times {DIFFERENCE_GAIN:g}", tuple(differences)),
    )
    return Refinement(tuple(drawings), compute_metric("psnr", seen[1], seen[2]), rows)


def judge(numbers: Refinement) -> tuple[Claim, ...]:
    """What the numbers say of the paper's claims."""
    quick, middle, full = numbers.drawings
    alike = "the same picture" if math.isinf(numbers.psnr_to_full_db) else f"{numbers.psnr_to_full_db:.1f} dB"
    return (
        Claim(
            "A picture that is good enough to look around with can be drawn several times a second.",
            f"a frame takes {INTERACTIVE_FRAME_S:g} s or less in the median and has {USEFUL_DB:g} dB or more against "
            "the ray integral",
            f"{quick.seconds:.3f} s, {quick.psnr_db:.1f} dB with {counted(quick.num_splats, 'splat')}",
            quick.fits and quick.psnr_db >= USEFUL_DB,
        ),
        Claim(
            "Given more time, the picture is refined towards that at full resolution.",
            "PSNR against the ray integral does not fall from each picture to the next, and rises from the first to "
            "the last, unless all are at full resolution",
            ", ".join(f"{drawing.psnr_db:.1f} dB" for drawing in numbers.drawings),
            quick.psnr_db <= middle.psnr_db <= full.psnr_db and (quick.psnr_db < full.psnr_db or quick.tolerance == 0),
        ),
        Claim(
            "A picture of a few seconds is hardly to be told from that at full resolution.",
            f"it takes {REFINED_FRAME_S:g} s or less, and has {INDISTINGUISHABLE_DB:g} dB "
            "or more against that at full resolution",
            f"{middle.seconds:.2f} s, {alike}",
            middle.fits and numbers.psnr_to_full_db >= INDISTINGUISHABLE_DB,
        ),
    )


def _finest_tolerance_within(stage: Stage, budget: float, studio: Studio) -> tuple[float, float]:
    """The smallest tolerance found whose frames take no longer, and what they take; a coarse one where none does."""
    finest, coarsest = math.log(FINEST), math.log(COARSEST)
    for _ in range(NUM_HALVINGS):
        middle = (finest + coarsest) / 2
        if _frame_seconds_at(stage, math.exp(middle), studio, QUICK_REPETITIONS) <= BUDGET_SHARE * budget:
            coarsest = middle
        else:
            finest = middle
    tolerance, seconds = 0.0, math.inf
    for k in range(MAX_TRIES):
        tolerance = float(f"{math.exp(coarsest) * COARSENING_FACTOR**k:.3g}")
        seconds = _frame_seconds_at(stage, tolerance, studio, REPETITIONS)
        if seconds <= budget:
            break
    return tolerance, seconds


def _frame_seconds_at(stage: Stage, tolerance: float, studio: Studio, repetitions: int) -> float:
    return studio.frame_seconds(with_error(stage, tolerance=((0, tolerance),)), repetitions=repetitions)


def _table(numbers: Refinement) -> Table:
    return Table(
        "What was drawn",
        ("", "tolerance", "splats", "frame, s", "cut, s", "PSNR, dB"),
        tuple(
            (
                drawing.name,
                f"{drawing.tolerance:g}",
                f"{drawing.num_splats}",
                f"{drawing.seconds:.3f}",
                f"{drawing.cut_seconds:.3f}",
                f"{drawing.psnr_db:.2f}",
            )
            for drawing in numbers.drawings
        ),
    )
