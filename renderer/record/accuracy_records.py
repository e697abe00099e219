"""Turn the results of exact rays into records and words on how exact frames and films are."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from renderer.accuracy import (
    DEVIATIONS,
    LEVELS,
    MOST_DB,
    EncodingErrors,
    ErrorSamples,
    SharedErrors,
    error_products,
    estimate_flicker,
    pool_samples,
    psnr,
    squared_error,
)
from renderer.record.film_record import (
    FileAccuracy,
    FilmAccuracy,
    FinerFile,
    FlickerRecord,
    FrameAccuracy,
    FrameRecord,
    Range,
    SharedProbes,
    WorstFrame,
)
from renderer.record.rounding import round_decibels, round_ratio

if TYPE_CHECKING:
    from renderer.accuracy import Probe

# Another encoding is recorded only if it gains at least this much PSNR, in decibels: less is not worth a change.
_LEAST_GAIN_DB = 1.0
# The number of decimal places of an error in a record, in levels of 8 bits.
_PLACES_OF_LEVELS = 3
# The recorded name of the method by which the pixels for exact rays are chosen.
_METHOD = "stratified by the differences between neighbouring pixels"


def frame_accuracy(probe: Probe) -> FrameAccuracy:
    """Return the record of the accuracy of a frame that rays have measured."""
    samples, shared, largest = probe.samples, None, probe.samples.largest
    if probe.shared is not None:
        errors = tuple(round(LEVELS * error, _PLACES_OF_LEVELS) for error in probe.shared.errors)
        shared = SharedProbes(probe.shared.first, errors)
    return FrameAccuracy(
        *_decibels(samples), samples.num, samples.variance, largest, probe.largest_error, samples.mean, shared
    )


def film_accuracy(frames: Sequence[FrameRecord]) -> FilmAccuracy | None:
    """Return the record of the accuracy of a film; None unless rays have measured each frame."""
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
        flicker=_flicker(pooled, [accuracy.shared for _, accuracy in measured if accuracy.shared is not None]),
    )


def _flicker(errors: ErrorSamples, frames: Sequence[SharedProbes]) -> FlickerRecord | None:
    """Return the record of flicker; None without two frames that share probes.

    errors: samples of the squared error of all frames. frames: the shared probes of the frames that have any.
    """
    pairs = [
        error_products(_shared_errors(one), _shared_errors(other))
        for one, other in pairwise(frames)
        if one.first == other.first and len(one.errors) == len(other.errors)
    ]
    products = [each for each in pairs if each is not None]
    if not products:
        return None
    pooled = pool_samples(products)
    rms, (low, high) = estimate_flicker(errors, pooled)
    return FlickerRecord(LEVELS * rms, (LEVELS * low, LEVELS * high), len(products), pooled.num)


def _shared_errors(record: SharedProbes) -> SharedErrors:
    return SharedErrors(record.first, tuple(error / LEVELS for error in record.errors))


def flicker_text(accuracy: FilmAccuracy) -> str | None:
    """Return `file flicker 3.1 of 255 levels (2.6 to 3.9)`; None without a flicker.

    A job measures frames before they are encoded, whose flicker is smaller than that of an encoded file.
    """
    if accuracy.flicker is None:
        return None
    of, (low, high) = "file" if accuracy.file is None else "frames", accuracy.flicker.interval
    return f"{of} flicker {accuracy.flicker.rms:.1f} of 255 levels ({low:.1f} to {high:.1f})"


def with_encoding_errors(
    accuracy: FilmAccuracy, errors: EncodingErrors, num_frames: int, finer: FinerFile | None
) -> FilmAccuracy:
    """Return the record of a film's accuracy, with the accuracy of its encoded file.

    num_frames: the number of frames that were decoded. finer: another encoding that keeps more, or None.
    """
    kept, interval = min(psnr(errors.loss), MOST_DB), None
    error = _file_error(accuracy, errors)
    if errors.products is not None:
        low, high = (squared_error(end) - squared_error(accuracy.psnr) for end in reversed(accuracy.interval))
        of_products = DEVIATIONS * errors.products.deviation
        least, most = error - math.hypot(low, of_products), error + math.hypot(high, of_products)
        interval = min(psnr(most), MOST_DB), min(psnr(max(least, 0.0)), MOST_DB)
    file = FileAccuracy(min(psnr(error), MOST_DB), kept, num_frames, finer, interval)
    return replace(accuracy, file=file)


def finer_file(
    accuracy: FilmAccuracy, keys: Mapping[str, Any], errors: tuple[EncodingErrors, EncodingErrors], bytes_ratio: float
) -> FinerFile | None:
    """Return the record of an encoding with other keys of the output; None if it gains little.

    errors: the errors that the film's encoding and the other one add.
    bytes_ratio: the bytes of the other file, divided by those of the film.
    """
    psnr_of_film, gained = (min(psnr(_file_error(accuracy, each)), MOST_DB) for each in errors)
    if gained < psnr_of_film + _LEAST_GAIN_DB:
        return None
    return FinerFile(keys, round_decibels(gained), round_ratio(bytes_ratio))


def _file_error(accuracy: FilmAccuracy, errors: EncodingErrors) -> float:
    """Return the mean squared error of a file, by the error of drawing and those that encoding adds.

    No products of these errors can bring it out of the bounds by Cauchy and Schwarz. Without products the errors count
    as independent.
    """
    of_drawing, product = squared_error(accuracy.psnr), errors.products.mean if errors.products else 0.0
    most = 2 * math.sqrt(of_drawing * errors.loss)
    return of_drawing + errors.loss + min(max(product, -most), most)


def accuracy_text(accuracy: FilmAccuracy) -> str:
    """Return `file PSNR 40.7 dB (40.6 to 40.8), frames PSNR 58.8 dB (58.6 to 59.0) before encoding`."""
    if accuracy.file is None:
        return file_accuracy_text(accuracy)
    file, of_frames = accuracy.file, f"frames PSNR {_decibels_text(accuracy.psnr, accuracy.interval)} before encoding"
    of_file = f"about {file.psnr:.1f} dB" if file.interval is None else _decibels_text(file.psnr, file.interval)
    return f"file PSNR {of_file}, {of_frames}"


def file_accuracy_text(accuracy: FilmAccuracy, psnr_of_encoding: float | None = None) -> str:
    """Return `file PSNR 40.7 dB (40.6 to 40.8)`, or `file PSNR about 40.7 dB` of a file that no rays measured.

    psnr_of_encoding: the PSNR of the decoded frames against the drawn ones; None for a file without loss.
    """
    if psnr_of_encoding is None:
        return f"file PSNR {_decibels_text(accuracy.psnr, accuracy.interval)}"
    error = _file_error(accuracy, EncodingErrors(squared_error(psnr_of_encoding)))
    return f"file PSNR about {min(psnr(error), MOST_DB):.1f} dB"


def _decibels_text(value: float, interval: Range) -> str:
    """Return a PSNR with its interval, as text."""
    low, high = interval
    if value >= MOST_DB:
        return f"at least {low:.1f} dB"
    return f"{value:.1f} dB ({low:.1f} {'or more' if high >= MOST_DB else f'to {high:.1f}'})"


def _samples(accuracy: FrameAccuracy) -> ErrorSamples:
    mean = squared_error(accuracy.psnr) if accuracy.mean is None else accuracy.mean
    return ErrorSamples(accuracy.rays, mean, accuracy.variance, accuracy.largest)


def _decibels(samples: ErrorSamples) -> tuple[float, Range]:
    """Return the PSNR and its interval, from low to high."""
    low, high = samples.interval
    return min(psnr(samples.mean), MOST_DB), (psnr(high), min(psnr(low), MOST_DB))
