"""The truth of some frames, with progress: the long wait before anything can be measured."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from hsplat_cli.terminal import progress
from renderer.cores import num_cores
from renderer.errors import InputError
from renderer.frame import Stage
from renderer.study import Truth, TruthRecord, compute_truth, thumbnail


def find_truths(
    stage: Stage,
    frames: Sequence[int],
    tolerance: float,
    *,
    quiet: bool,
    on_step: Callable[[], None] = lambda: None,
) -> tuple[list[Truth], list[TruthRecord]]:
    """The truth of every frame, and how it came about.

    on_step: called now and then; what it raises goes through.
    """
    truths: list[Truth] = []
    records = []
    label = f"truth of frame{'s' * (len(frames) > 1)} {', '.join(map(str, frames))}"
    with progress([1.0] * 100, label=label, quiet=quiet, unit="percent") as bar:
        shown = 0

        def show(share: float) -> None:
            """Percent by percent; the share of a frame may fall, when it needs more than was thought."""
            nonlocal shown
            on_step()
            percent = int(100 * (len(truths) + share) / len(frames))
            for _ in range(shown, percent):
                bar.advance()
            shown = max(shown, percent)

        for frame in frames:
            start = time.perf_counter()
            truth = compute_truth(stage, frame, tolerance, num_threads=num_cores(), on_progress=show)
            seconds = time.perf_counter() - start
            truths.append(truth)
            show(0.0)
            on_volume = float(truth.on_volume.mean())
            records.append(TruthRecord(frame, seconds, truth.convergence, on_volume, thumbnail(truth.picture)))
    return truths, records


def nothing_visible_error(num_frames: int) -> InputError:
    """The error where nothing of the volume is seen on any of so many frames."""
    return InputError(
        "the scene draws nothing, so there is nothing to measure",
        got=f"{num_frames} frame{'s' * (num_frames > 1)} without anything of the volume",
        expected="a volume in view, and a transfer function that shows some of it",
        hint="`hsplat info` shows which values there are",
    )
