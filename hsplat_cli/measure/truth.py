"""The truth of some frames, with progress: the long wait before anything can be measured."""

from __future__ import annotations

import time
from collections.abc import Sequence

from hsplat_cli.progress import progress
from renderer.errors import InputError
from renderer.pipeline import Stage
from renderer.study import TruthRecord
from renderer.thumbnails import thumbnail
from renderer.truths import Truth, find_truth


def find_truths(
    stage: Stage, frames: Sequence[int], tolerance: float, *, quiet: bool
) -> tuple[list[Truth], list[TruthRecord]]:
    """The truth of every frame, and how it came about."""
    truths, records = [], []
    with progress(len(frames), label="truth", quiet=quiet) as bar:
        for frame in frames:
            start = time.perf_counter()
            truth = find_truth(stage, frame, tolerance)
            truths.append(truth)
            records.append(
                TruthRecord(
                    frame,
                    time.perf_counter() - start,
                    truth.convergence,
                    float(truth.on_volume.mean()),
                    thumbnail(truth.picture),
                )
            )
            bar.advance()
    return truths, records


def require_something(truths: Sequence[Truth]) -> None:
    """Raise InputError where nothing of the volume is seen on any of the frames."""
    if not any(truth.on_volume.any() for truth in truths):
        raise InputError(
            "the scene draws nothing, so there is nothing to measure",
            got=f"{len(truths)} frame{'s' * (len(truths) > 1)} without anything of the volume",
            expected="a volume in view, and a transfer function that shows some of it",
            hint="`hsplat info` shows which values there are",
        )
