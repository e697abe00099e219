"""Figure 6: draw one picture within 0.2 s, within 5 s, and at full resolution."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from figure import Claim, FigureRenderer, FigureStage, PaperFigure, PictureRows

from hsplat_cli.measure import DIFFERENCE_GAIN, amplified_difference
from renderer.accuracy import compute_metric
from renderer.film import rounded
from renderer.scene import Scene, counted

INTERACTIVE_FRAME_S, REFINED_FRAME_S = 0.2, 5.0
# Seconds of each picture.
BUDGETS = {"five times a second": INTERACTIVE_FRAME_S, "in five seconds": REFINED_FRAME_S, "full resolution": math.inf}
# The search aims a little below the budget, because no two frames take the same time.
BUDGET_SHARE = 0.9
# The search bisects the logarithm of the tolerance between these, down to 9 %.
COARSEST, FINEST, NUM_HALVINGS = 100.0, 1e-3, 7
QUICK_REPETITIONS, REPETITIONS = 3, 7
# If the result is too slow when it is timed again, it is made coarser by this factor, at most this often.
COARSENING_FACTOR, MAX_TRIES = 1.25, 4
# A root mean square error of a tenth of the brightest value: large structures are in place.
USEFUL_DB = 20.0
# Above this, only a comparison side by side shows a difference.
INDISTINGUISHABLE_DB = 35.0


@dataclass(frozen=True)
class TimedFrame:
    """A frame with its times. tolerance: 0 at full resolution. seconds: median of a frame whose cut exists.

    budget: seconds, infinite without one. cut_seconds: time to make the cut and its splats.
    """

    name: str
    budget: float
    tolerance: float
    seconds: float
    cut_seconds: float
    num_primitives: int
    psnr_db: float

    @property
    def is_within_budget(self) -> bool:
        """Return whether the frame takes no longer than its budget."""
        return self.seconds <= self.budget


def make_figure(scene: Scene, figure_renderer: FigureRenderer) -> PaperFigure:
    """Return figure 6."""
    drawings, psnr_to_full_db, rows = measure(scene, figure_renderer)
    full = drawings[-1]
    notes = [
        f"{drawing.name}: full resolution takes {full.seconds:.2f} s on this machine, so this is full resolution."
        for drawing in drawings[:-1]
        if drawing.tolerance == 0
    ]
    return PaperFigure(
        "Five times a second, in five seconds, at full resolution",
        "One view at the tolerances that meet two budgets on this machine, and with a splat for every visible voxel. "
        "Times are for one frame of a film: sort, draw and round to 8 bits; the cut is made once for all frames.",
        check_claims(drawings, psnr_to_full_db),
        rows,
        tables={
            "The three frames": [
                {
                    "frame": drawing.name,
                    "tolerance": f"{drawing.tolerance:g}",
                    "splats": f"{drawing.num_primitives}",
                    "frame, s": f"{drawing.seconds:.3f}",
                    "cut, s": f"{drawing.cut_seconds:.3f}",
                    "PSNR, dB": f"{drawing.psnr_db:.2f}",
                }
                for drawing in drawings
            ]
        },
        notes=tuple(notes),
    )


def measure(scene: Scene, figure_renderer: FigureRenderer) -> tuple[list[TimedFrame], float, PictureRows]:
    """Find the tolerances by timing, draw, and compare with the ray integral.

    Return the frames drawn five times a second, in five seconds and at full resolution, the PSNR of the second against
    the third, infinite if they are equal, and the pictures.
    """
    drawings, rgb, pictures, differences = [], [], [], []
    with figure_renderer.open_stage(scene) as stage:
        truth = stage.truth()
        full_seconds = stage.median_seconds(QUICK_REPETITIONS, tolerance=0.0)
        for name, budget in BUDGETS.items():
            tolerance, seconds = 0.0, full_seconds
            if full_seconds > budget:
                tolerance, seconds = _finest_tolerance_within(stage, budget)
            frame = stage.draw(tolerance=tolerance)
            rgb.append(stage.rgb(frame))
            drawing = TimedFrame(
                name,
                budget,
                tolerance,
                seconds,
                frame.seconds["cut"] + frame.seconds["primitives"],
                frame.num_primitives,
                compute_metric("psnr", rgb[-1], truth),
            )
            drawings.append(drawing)
            pictures.append((frame.image, f"{name}: {drawing.seconds:.2f} s, {drawing.psnr_db:.1f} dB"))
            differences.append((rounded(amplified_difference(rgb[-1], truth)), name))
    rows = {
        "The pictures": pictures,
        f"Their differences from the ray integral, times {DIFFERENCE_GAIN:g}": differences,
    }
    return drawings, compute_metric("psnr", rgb[1], rgb[2]), rows


def check_claims(drawings: Sequence[TimedFrame], psnr_to_full_db: float) -> tuple[Claim, ...]:
    """Compare the results of `measure` with the paper's claims."""
    quick, middle, full = drawings
    alike = "the same picture" if math.isinf(psnr_to_full_db) else f"{psnr_to_full_db:.1f} dB"
    return (
        Claim(
            "A picture that is good enough for interaction can be drawn several times a second.",
            f"a frame takes {INTERACTIVE_FRAME_S:g} s or less in the median and has {USEFUL_DB:g} dB or more against "
            "the ray integral",
            f"{quick.seconds:.3f} s, {quick.psnr_db:.1f} dB with {counted(quick.num_primitives, 'splat')}",
            quick.is_within_budget and quick.psnr_db >= USEFUL_DB,
        ),
        Claim(
            "Given more time, the picture is refined towards full resolution.",
            "PSNR against the ray integral never falls from one picture to the next, and rises from the first to the "
            "last, unless all are at full resolution",
            ", ".join(f"{drawing.psnr_db:.1f} dB" for drawing in drawings),
            quick.psnr_db <= middle.psnr_db <= full.psnr_db and (quick.psnr_db < full.psnr_db or quick.tolerance == 0),
        ),
        Claim(
            "A picture of a few seconds is hard to distinguish from one at full resolution.",
            f"it takes {REFINED_FRAME_S:g} s or less, and has {INDISTINGUISHABLE_DB:g} dB "
            "or more against full resolution",
            f"{middle.seconds:.2f} s, {alike}",
            middle.is_within_budget and psnr_to_full_db >= INDISTINGUISHABLE_DB,
        ),
    )


def _finest_tolerance_within(stage: FigureStage, budget: float) -> tuple[float, float]:
    """Return the smallest tolerance found within the budget and its seconds, or a coarse tolerance above it."""
    finest, coarsest = math.log(FINEST), math.log(COARSEST)
    for _ in range(NUM_HALVINGS):
        middle = (finest + coarsest) / 2
        if stage.median_seconds(QUICK_REPETITIONS, tolerance=math.exp(middle)) <= BUDGET_SHARE * budget:
            coarsest = middle
        else:
            finest = middle
    tolerance, seconds = 0.0, math.inf
    for k in range(MAX_TRIES):
        tolerance = float(f"{math.exp(coarsest) * COARSENING_FACTOR**k:.3g}")
        seconds = stage.median_seconds(REPETITIONS, tolerance=tolerance)
        if seconds <= budget:
            break
    return tolerance, seconds
