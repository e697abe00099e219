"""Search for the tolerance of an accuracy, and compute the true pictures that it compares with."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace

from hsplat_cli.terminal import Reporter, counted
from renderer.errors import InputError
from renderer.frame import Rasterizer, Stage
from renderer.scene import MetricTarget
from renderer.study import (
    ToleranceSearchResult,
    Trial,
    Truth,
    compute_truth,
    find_tolerance,
)
from renderer.system import num_cores


def search_tolerance(
    stage: Stage,
    frames: Sequence[int],
    want: MetricTarget,
    truth_tolerance: float,
    rasterizer: Rasterizer,
    reporter: Reporter,
    *,
    on_step: Callable[[], None] = lambda: None,
) -> ToleranceSearchResult:
    """Search for the coarsest tolerance with this accuracy, and print each trial.

    Parameters are those of `find_tolerance` and `compute_truth`.
    on_step: called now and then; what it raises is passed on.
    """

    def find_truth(frame: int) -> Truth:
        (truth,) = find_truths(stage, [frame], truth_tolerance, reporter, on_step=on_step)
        return truth

    def report_trial(trial: Trial) -> None:
        on_step()
        cells = counted(trial.num_cells, stage.scene.splat.primitive_name)
        reporter.status(f"tolerance {trial.tolerance:g}: {want.format(trial.value)} on frame {trial.frame}, {cells}")

    return find_tolerance(
        stage,
        frames,
        want,
        rasterizer,
        find_truth=find_truth,
        clock=time.perf_counter,
        on_trial=report_trial,
    )


def find_truths(
    stage: Stage,
    frames: Sequence[int],
    tolerance: float,
    reporter: Reporter,
    *,
    on_step: Callable[[], None] = lambda: None,
) -> list[Truth]:
    """Return the truth of every frame, with progress in percent.

    on_step: called now and then; what it raises is passed on.
    """
    truths: list[Truth] = []
    label = f"truth of frame{'s' * (len(frames) > 1)} {', '.join(map(str, frames))}"
    with reporter.progress([1.0] * 100, label=label, unit="percent") as bar:
        shown = 0

        def show(share: float) -> None:
            """Advance the bar; the share of a frame may fall when it needs more steps than predicted."""
            nonlocal shown
            on_step()
            percent = int(100 * (len(truths) + share) / len(frames))
            for _ in range(shown, percent):
                bar.advance()
            shown = max(shown, percent)

        for frame in frames:
            start = time.perf_counter()
            truth = compute_truth(stage, frame, tolerance, num_threads=num_cores(), on_progress=show)
            truths.append(replace(truth, seconds=time.perf_counter() - start))
            show(0.0)
    return truths


def nothing_visible_error(num_frames: int) -> InputError:
    """Return the error for a volume of which no frame shows anything."""
    return InputError(
        "the scene draws nothing, so there is nothing to measure",
        got=f"{num_frames} frame{'s' * (num_frames > 1)} without anything of the volume",
        expected="a volume in view, and a transfer function that shows some of it",
        hint="`hsplat info` shows which values there are",
    )
