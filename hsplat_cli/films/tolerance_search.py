"""The search for the tolerance of an accuracy, for `hsplat measure --want` and for a scene that asks for one."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import click

from hsplat_cli.films.truths import find_truths
from hsplat_cli.terminal import counted
from renderer.frame import Rasterizer, Stage
from renderer.scene import MetricTarget
from renderer.study import ToleranceSearchResult, Trial, Truth, TruthCache, TruthOf, find_tolerance


def search_tolerance(
    stage: Stage,
    frames: Sequence[int],
    want: MetricTarget,
    truth_tolerance: float,
    rasterizer: Rasterizer,
    *,
    quiet: bool,
    on_step: Callable[[], None] = lambda: None,
) -> ToleranceSearchResult:
    """Search, saying what is tried and how it came out; parameters as in `find_tolerance` and `compute_truth`.

    on_step: called now and then; what it raises goes through.
    """
    return find_tolerance(
        stage,
        frames,
        want,
        rasterizer,
        truth_of=_truths(stage, truth_tolerance, on_step, quiet=quiet),
        clock=time.perf_counter,
        on_trial=_trial_reporter(want, stage.scene.splat.primitive_name, on_step, quiet=quiet),
    )


def _truths(stage: Stage, tolerance: float, on_step: Callable[[], None], *, quiet: bool) -> TruthOf:
    """The truth of a frame, found when it is first asked for; there are at most ten, of 13 bytes a pixel."""

    def find(frame: int) -> Truth:
        (truth,), _ = find_truths(stage, [frame], tolerance, quiet=quiet, on_step=on_step)
        return truth

    return TruthCache(find)


def _trial_reporter(
    want: MetricTarget, noun: str, on_step: Callable[[], None], *, quiet: bool
) -> Callable[[Trial], None]:
    def tell(trial: Trial) -> None:
        on_step()
        if not quiet:
            what = f"tolerance {trial.tolerance:g}: {want.format(trial.value)} on frame {trial.frame}"
            click.echo(f"{what}, {counted(trial.num_cells, noun)}", err=True)

    return tell
