"""Say how exact frames, and the film of them, are: from exact rays to records and words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from renderer.job.record import FileAccuracy, FilmAccuracy, FrameAccuracy, FrameRecord, Range, WorstFrame
from renderer.probes import ErrorSamples, pool_samples, psnr

if TYPE_CHECKING:
    from renderer.probes import Probe

_METHOD = "stratified by the differences between neighbouring pixels"
# No error at all counts as this many decibels, and so does less than that.
_MOST_DB = 200.0


def frame_accuracy(probe: Probe) -> FrameAccuracy:
    """Return the record of what rays have measured of a frame."""
    samples = probe.samples
    value, interval = _decibels(samples)
    return FrameAccuracy(value, interval, samples.num, samples.variance, samples.largest, probe.largest_error)


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


def with_encoding_loss(accuracy: FilmAccuracy, mean_squared_error: float, num_frames: int) -> FilmAccuracy:
    """Return the accuracy of a film with that of its file.

    mean_squared_error: between the frames as they were drawn and as they are decoded, in [0, 1]. It adds to that of the
        drawing: neither error knows of the other.
    """
    both = min(psnr(mean_squared_error + _mean_squared_error(accuracy.psnr)), _MOST_DB)
    return replace(accuracy, file=FileAccuracy(both, min(psnr(mean_squared_error), _MOST_DB), num_frames))


def accuracy_text(accuracy: FilmAccuracy) -> str:
    """Return `58.8 +- 0.2 dB of the exact picture, 40.7 dB in the file`."""
    value, (low, high) = accuracy.psnr, accuracy.interval
    text = f"{value:.1f} +- {max(value - low, high - value):.1f} dB of the exact picture"
    if value >= _MOST_DB:
        text = f"no difference from the exact picture seen, at least {low:.0f} dB"
    return text if accuracy.file is None else f"{text}, {accuracy.file.psnr:.1f} dB in the file"


def _samples(accuracy: FrameAccuracy) -> ErrorSamples:
    return ErrorSamples(accuracy.rays, _mean_squared_error(accuracy.psnr), accuracy.variance, accuracy.largest)


def _mean_squared_error(decibels: float) -> float:
    return float(10 ** (-decibels / 10)) if decibels < _MOST_DB else 0.0


def _decibels(samples: ErrorSamples) -> tuple[float, Range]:
    """Return the PSNR and its interval, from low to high."""
    low, high = samples.interval
    return min(psnr(samples.mean), _MOST_DB), (psnr(high), min(psnr(low), _MOST_DB))
