"""Measure the accuracy of the pictures of a finished film by new exact rays, and find pictures that are not the film's.

Numbered image files must be as exact as recorded. An encoded film is less exact than its recorded frames, which is no
fault: a frame of it is judged by the usual loss in this film. docs/commands.md says which frames are named.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

from renderer.accuracy import MOST_DB, ROUNDING_ERROR, FrameProber, psnr, spread_evenly, squared_error
from renderer.errors import Problem
from renderer.film import Picture, Pixels, decode_known_film, frame_path
from renderer.frame import FilmAnnotation, FilmStage
from renderer.record.accuracy_records import film_accuracy, frame_accuracy
from renderer.record.film_record import FilmAccuracy, FrameAccuracy, FrameRecord
from renderer.scene import OutputFile

# The number of probed pixels of a frame in the first measurement. It is at least doubled for each further measurement,
# until the interval of the film's PSNR is narrow enough.
_FEWEST_RAYS = 64
# The largest number of probed pixels of a frame in a measurement, if the frame has as many pixels.
_MOST_RAYS = 4096
# At most this many frames are measured, evenly spread over a long film.
_MOST_FRAMES = 240
# A frame of an encoded film is unusual if its squared error, and the squared error that it gained since it was
# recorded, are more than this many times as large as usual in the film. The usual errors count as at least that of
# rounding to 8 bits.
_UNUSUAL = 4.0
# A frame counts as hardly worse than another one, or than its record, if its squared error is at most this many times
# as large.
_HARDLY_WORSE = 2.0
# A film flickers far more than recorded if its flicker is surely more than this many times the upper end of the
# recorded interval.
_FAR_MORE_FLICKER = 1.5
# This many frames before a frame, and as many after it, show nearly the same.
_NUM_BESIDE = 4
# Encoding may add at most this mean squared error, of colours in [0, 1]. The recorded error of encoding does not tell
# it, because it was measured on the first frames alone.
_MOST_OF_ENCODING = 10 ** (-20 / 10)


@dataclass(frozen=True)
class RayOptions:
    """The options of the new exact rays.

    num_threads: the number of threads that compute rays.
    seed: the seed of the choice of pixels; a film job uses seed 0.
    precision_db: measuring ends when each end of the interval is at most this far from the film's PSNR, in decibels; or
        when the film is surely more exact than rounding to 8 bits.
    """

    num_threads: int
    seed: int = 1
    precision_db: float = 0.5


class RayProgress(Protocol):
    """A listener to the progress of the measurement; a listener to a film job can be used, too."""

    def started(self, label: str, num_frames: int) -> None:
        """Take note that the measurement of `num_frames` frames begins."""

    def frame_finished(self, record: FrameRecord) -> None:
        """Take note that a frame has been measured."""


@dataclass(frozen=True)
class FreshAccuracy:
    """The accuracy of a film's pictures by new exact rays.

    num_frames: the number of frames that were measured.
    is_precise: whether the interval is as narrow as RayOptions ask for.
    problems: the problems of pictures that are not the film's own, or less exact than recorded.
    """

    accuracy: FilmAccuracy
    num_frames: int
    is_precise: bool
    problems: Sequence[Problem]


def measure_pictures(
    stage: FilmStage, frames: Sequence[FrameRecord], options: RayOptions, progress: RayProgress
) -> FreshAccuracy:
    """Measure the pictures of frames in the first output; of a long film, only some evenly spread frames."""
    output = stage.scene.output
    rays, most = _Rays(stage, output, frames, options.num_threads, progress), most_rays(output)
    chosen = spread_evenly(frames, _MOST_FRAMES, is_loop=True)
    num_rays, width = min(_FEWEST_RAYS, most), math.inf
    while True:
        measured = rays.measure(chosen, num_rays, options.seed)
        accuracy = film_accuracy(measured)
        assert accuracy is not None, "each frame is measured"
        low, high = accuracy.interval
        width = max(accuracy.psnr - low, high - accuracy.psnr)
        is_precise = width <= options.precision_db or low > psnr(ROUNDING_ERROR)
        if is_precise or num_rays == most:
            break
        num_rays = min(most, 2 * num_rays * max(1, round((width / options.precision_db) ** 2 / 2)))
    is_recorded = output.is_frames and all(frame.accuracy is not None for frame in chosen)
    limits = (_least_as_recorded if is_recorded else _least_usual)(chosen, [_psnr(frame) for frame in measured])
    problems = [*_film_problems(chosen, accuracy, output)]
    # Suspicious frames are measured again with the most rays: few rays are often wrong about one of many frames.
    suspects = {each.frame: least for each, least in zip(measured, limits, strict=True) if _psnr(each) < least}
    for each in rays.measure([each for each in chosen if each.frame in suspects], most, options.seed + 1):
        what = "is not the picture that was recorded" if is_recorded else "is far less exact than others"
        problems += _problems(f"frame {each.frame} {what}", each.accuracy, suspects[each.frame], output, each.frame)
    return FreshAccuracy(replace(accuracy, seed=options.seed), len(chosen), is_precise, problems)


def most_rays(output: OutputFile) -> int:
    """Return the largest number of probed pixels of a frame in a measurement: not more than the frame has."""
    return min(_MOST_RAYS, math.prod(output.size))


@dataclass(frozen=True)
class _Rays:
    """A measurement of the pictures of a film by exact rays. frames: the records of all its frames, ascending."""

    stage: FilmStage
    output: OutputFile
    frames: Sequence[FrameRecord]
    num_threads: int
    progress: RayProgress

    def measure(self, chosen: Sequence[FrameRecord], num_rays: int, seed: int) -> list[FrameRecord]:
        """Return the records of chosen frames, with the accuracy that is measured at `num_rays` pixels of each."""
        if not chosen:
            return []
        prober = FrameProber(self.stage.first, num_rays, seed=seed, num_threads=self.num_threads)
        found, annotation = list[FrameRecord](), FilmAnnotation(self.stage)
        self.progress.started(f"{num_rays} rays a frame", len(chosen))
        for frame, image in self._pictures({frame.frame for frame in chosen}):
            prober = prober.on(self.stage.at(frame.frame))
            covered = annotation.covered(frame.frame, None if frame.accuracy is None else frame.accuracy.psnr)
            found.append(replace(frame, accuracy=frame_accuracy(prober.probe(frame.frame, image, covered))))
            self.progress.frame_finished(found[-1])
        return found

    def _pictures(self, numbers: set[int]) -> Iterator[tuple[FrameRecord, Pixels]]:
        """Yield the records of the frames with these numbers, each with its picture."""
        if self.output.is_frames:
            for frame in (each for each in self.frames if each.frame in numbers):
                yield frame, Picture(file=frame_path(self.output.file, frame.frame)).pixels
            return
        with decode_known_film(self.output, len(self.frames)) as images:
            pairs = zip(self.frames, images, strict=True)
            yield from ((frame, image) for frame, image in pairs if frame.frame in numbers)


def _film_problems(frames: Sequence[FrameRecord], found: FilmAccuracy, output: OutputFile) -> Iterator[Problem]:
    """Yield the problems of a film that is far less exact than recorded, or flickers far more.

    frames: the records of the measured frames. found: the measured accuracy.
    """
    recorded = film_accuracy(frames)
    if recorded is not None:
        may_lose = 0.0 if output.is_frames else _MOST_OF_ENCODING
        least = psnr(_HARDLY_WORSE * squared_error(recorded.interval[0]) + may_lose)
        yield from _problems("far less exact than recorded", found, least, output)
        if output.is_frames and recorded.flicker is not None and found.flicker is not None:
            most, low = _FAR_MORE_FLICKER * recorded.flicker.interval[1], found.flicker.interval[0]
            got, expected = f"at least {low:.1f} levels", f"at most {most:.1f} levels"
            if low > most:
                yield Problem("", "flickers far more than recorded", got, expected, location=str(output.file))


def _problems(
    what: str, found: FilmAccuracy | FrameAccuracy | None, least: float, output: OutputFile, frame: int = 0
) -> Iterator[Problem]:
    """Yield a problem if an accuracy is surely below a PSNR: its whole interval is.

    what: the fault, in words. least: the PSNR. frame: the number of the frame whose file the problem names.
    """
    if found is not None and found.interval[1] < least:
        got, expected = f"at most {found.interval[1]:.1f} dB", f"at least {least:.1f} dB"
        yield Problem("", what, got, expected, location=str(frame_path(output.file, frame)))


def _least_as_recorded(frames: Sequence[FrameRecord], found: Sequence[float]) -> list[float]:
    """Return, for each frame, the PSNR that it must have at least: the lower end of its recorded interval.

    The few rays of a record may have missed large errors. Therefore a frame may also be hardly worse than a frame near
    it that is as exact as recorded.

    found: the measured PSNR of each frame.
    """
    lows = [_low(frame) for frame in frames]
    hardly_worse = [
        psnr(_HARDLY_WORSE * squared_error(value)) if value >= low else math.inf
        for value, low in zip(found, lows, strict=True)
    ]
    return [min([low, *(hardly_worse[at] for at in _beside(k, len(found)))]) for k, low in enumerate(lows)]


def _least_usual(frames: Sequence[FrameRecord], found: Sequence[float]) -> list[float]:
    """Return, for each frame of an encoded film, the PSNR below which it is unusual.

    The error of such a frame is several times as large as usual, and the error that it has gained since it was recorded
    is several times as large as usual. found: the measured PSNR of each frame.
    """
    errors = [squared_error(value) for value in found]
    losses = [error - squared_error(_psnr(frame)) for frame, error in zip(frames, errors, strict=True)]
    lows = [squared_error(_low(frame)) for frame in frames]
    usual = zip(_usual(errors), lows, _usual(losses), strict=True)
    return [psnr(max(_UNUSUAL * error, low + _UNUSUAL * loss)) for error, low, loss in usual]


def _usual(values: Sequence[float]) -> list[float]:
    """Return the usual value for each frame: the median over the film, or over the frames near it if that is more."""
    values = [max(value, ROUNDING_ERROR) for value in values]
    median, num = statistics.median(values), len(values)
    beside = ([values[at] for at in _beside(k, num)] for k in range(num))
    return [max(median, statistics.median_high(near or [median])) for near in beside]


def _beside(k: int, num: int) -> list[int]:
    """Return the indices of the frames near frame `k` of `num` frames, which show nearly the same."""
    return [each for each in range(max(k - _NUM_BESIDE, 0), min(k + _NUM_BESIDE + 1, num)) if each != k]


def _low(frame: FrameRecord) -> float:
    return MOST_DB if frame.accuracy is None else frame.accuracy.interval[0]


def _psnr(frame: FrameRecord) -> float:
    return MOST_DB if frame.accuracy is None else frame.accuracy.psnr
