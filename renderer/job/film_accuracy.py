"""Say how exact frames, and the film of them, are: from exact rays to records and words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from renderer.accuracy import MOST_DB, ErrorSamples, pool_samples, psnr, squared_error
from renderer.job.record import FileAccuracy, FilmAccuracy, FrameAccuracy, FrameRecord, Range, WorstFrame

if TYPE_CHECKING:
    from renderer.accuracy import Probe

_METHOD = "stratified by the differences between neighbouring pixels"


def frame_accuracy(probe: Probe) -> FrameAccuracy:
    """Return the record of what rays have measured of a frame."""
    samples = probe.samples
    return FrameAccuracy(*_decibels(samples), samples.num, samples.variance, samples.largest, probe.largest_error)


def film_accuracy(frames: Sequence[FrameRecord]) -> FilmAccuracy | None:
    """Return the record of what rays have measured of a film; None unless they have of each frame."""
    measured = [(frame.frame, frame.accuracy) for frame in frames if frame.accuracy is not None]
    if len(measured) < len(frames):
        return None
    pooled = pool_samples([_samples(accuracy) for _, accuracy in measured])
    value, interval = _decibels(pooled)
    number, worst = min(measured, key=lambda each: each[1].psnr)
    return FilmAccuracy(
        value,
        interval,
        pooled.num,
        WorstFrame(number, worst.psnr, worst.interval),
        max(accuracy.largest_error for _, accuracy in measured),
        _METHOD,
        seed=0,
    )


def with_encoding_loss(accuracy: FilmAccuracy, loss: float, num_frames: int) -> FilmAccuracy:
    """Return the accuracy of a film with that of its file.

    loss: the mean squared error between the frames as they were drawn and as they are decoded, in [0, 1]. It adds to
        that of the drawing: neither error knows of the other.
    """
    both = min(psnr(loss + squared_error(accuracy.psnr)), MOST_DB)
    return replace(accuracy, file=FileAccuracy(both, min(psnr(loss), MOST_DB), num_frames))


def accuracy_text(accuracy: FilmAccuracy) -> str:
    """Return `58.8 +- 0.2 dB of the exact picture, 40.7 dB in the file`."""
    value, (low, high) = accuracy.psnr, accuracy.interval
    text = f"{value:.1f} +- {max(value - low, high - value):.1f} dB of the exact picture"
    if value >= MOST_DB:
        text = f"no difference from the exact picture seen, at least {low:.0f} dB"
    return text if accuracy.file is None else f"{text}, {accuracy.file.psnr:.1f} dB in the file"


def _samples(accuracy: FrameAccuracy) -> ErrorSamples:
    return ErrorSamples(accuracy.rays, squared_error(accuracy.psnr), accuracy.variance, accuracy.largest)


def _decibels(samples: ErrorSamples) -> tuple[float, Range]:
    """Return the PSNR and its interval, from low to high."""
    low, high = samples.interval
    return min(psnr(samples.mean), MOST_DB), (psnr(high), min(psnr(low), MOST_DB))
