"""Measure how exact the pictures of a finished film are by fresh exact rays, and find those that are not its own.

Numbered frames are the pictures whose accuracy was recorded. What an encoder does to pictures is no mistake: an encoded
film is judged by what is usual in it. docs/commands.md says what is found, and how often that is wrong.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from renderer.accuracy import MOST_DB, ROUNDING_ERROR, FrameProber, psnr, spread_evenly, squared_error
from renderer.errors import Problem
from renderer.film import Picture, Pixels, decode_known_film, frame_path
from renderer.frame import Stage
from renderer.job.events import JobEvents
from renderer.job.film_accuracy import film_accuracy, frame_accuracy
from renderer.job.pictures import PictureMaker
from renderer.job.record import FilmAccuracy, FrameAccuracy, FrameRecord
from renderer.scene import OutputFile
from renderer.system import num_cores

# The rays of a frame are at least doubled until the film is known well enough. Of a long film some frames are measured.
_FEWEST_RAYS, MOST_RAYS, _MOST_FRAMES = 64, 4096, 240
# A frame of an encoded film may lose this many times what is usual; usual is no less than rounding to 8 bits.
_UNUSUAL = 4.0
# This many times the error is hardly worse: than that of a numbered frame beside it, or than was recorded of a film.
_HARDLY_WORSE = 2.0
# How many frames on each side of a frame show nearly the same.
_NUM_BESIDE = 4
# The mean squared error that encoding may add. What is recorded of it is that of the first frames alone.
_MOST_OF_ENCODING = 10 ** (-20 / 10)


@dataclass(frozen=True)
class RayOptions:
    """Options of fresh rays. seed: of the choice of pixels; that of rendering is 0.

    precision_db: how far each end of the interval may be from the film's PSNR.
    """

    seed: int = 1
    precision_db: float = 0.5


@dataclass(frozen=True)
class MeasuredFilm:
    """A measurement of a film by fresh rays.

    num_frames: how many they measured. problems: pictures that are not its own.
    """

    accuracy: FilmAccuracy
    num_frames: int
    is_precise: bool
    problems: Sequence[Problem]


def measure_film(
    stage: Stage, output: OutputFile, frames: Sequence[FrameRecord], options: RayOptions, events: JobEvents
) -> MeasuredFilm:
    """Measure these frames, which have pictures; of a long film some that are evenly spread."""
    rays, chosen = _Rays(stage, output, frames, events), spread_evenly(frames, _MOST_FRAMES, is_loop=True)
    num_rays, width = _FEWEST_RAYS, math.inf
    while True:
        measured = rays.measure(chosen, num_rays, options.seed)
        accuracy = film_accuracy(measured)
        assert accuracy is not None, "each frame is measured"
        width = max(accuracy.psnr - accuracy.interval[0], accuracy.interval[1] - accuracy.psnr)
        is_precise = width <= options.precision_db or accuracy.largest_error == 0.0
        if is_precise or num_rays == MOST_RAYS:
            break
        num_rays = min(MOST_RAYS, 2 * num_rays * max(1, round((width / options.precision_db) ** 2 / 2)))
    is_recorded = output.is_frames and all(frame.accuracy is not None for frame in chosen)
    limits = (_least_as_recorded if is_recorded else _least_usual)(chosen, [_psnr(frame) for frame in measured])
    problems = [*_film_problems(chosen, accuracy, output)]
    # Suspects are measured again: few rays are often wrong about one of many frames.
    suspects = {each.frame: least for each, least in zip(measured, limits, strict=True) if _psnr(each) < least}
    for each in rays.measure([each for each in chosen if each.frame in suspects], MOST_RAYS, options.seed + 1):
        what = "is not the picture that was recorded" if is_recorded else "is far less exact than others"
        problems += _problems(f"frame {each.frame} {what}", each.accuracy, suspects[each.frame], output, each.frame)
    return MeasuredFilm(replace(accuracy, seed=options.seed), len(chosen), is_precise, problems)


@dataclass(frozen=True)
class _Rays:
    """Exact rays through the pictures of a film. frames: all that have pictures, in their order."""

    stage: Stage
    output: OutputFile
    frames: Sequence[FrameRecord]
    events: JobEvents

    def measure(self, chosen: Sequence[FrameRecord], num_rays: int, seed: int) -> list[FrameRecord]:
        """Return the records of chosen frames with the accuracy that so many rays through each find."""
        if not chosen:
            return []
        prober, found = FrameProber(self.stage, num_rays, seed=seed, num_threads=num_cores()), list[FrameRecord]()
        maker = PictureMaker(self.stage)
        self.events.started(f"{num_rays} rays a frame", len(chosen))
        for frame, image in self._pictures({frame.frame for frame in chosen}):
            prober, covered = prober.on(self.stage.at(frame.frame)), maker.covered(frame.frame, frame)
            found.append(replace(frame, accuracy=frame_accuracy(prober.probe(frame.frame, image, covered))))
            self.events.frame_finished(found[-1])
        return found

    def _pictures(self, numbers: set[int]) -> Iterator[tuple[FrameRecord, Pixels]]:
        """Yield the frames of these numbers with their pictures."""
        if self.output.is_frames:
            for frame in (each for each in self.frames if each.frame in numbers):
                yield frame, Picture(file=frame_path(self.output.file, frame.frame)).pixels
            return
        with decode_known_film(self.output, len(self.frames)) as images:
            pairs = zip(self.frames, images, strict=True)
            yield from ((frame, image) for frame, image in pairs if frame.frame in numbers)


def _film_problems(frames: Sequence[FrameRecord], found: FilmAccuracy, output: OutputFile) -> Iterator[Problem]:
    """Yield a problem where a film is far less exact than recorded, by more than what encoding may do to it."""
    recorded = film_accuracy(frames)
    if recorded is not None:
        may_lose = 0.0 if output.is_frames else _MOST_OF_ENCODING
        least = psnr(_HARDLY_WORSE * squared_error(recorded.interval[0]) + may_lose)
        yield from _problems("far less exact than recorded", found, least, output)


def _problems(
    what: str, found: FilmAccuracy | FrameAccuracy | None, least: float, output: OutputFile, frame: int = 0
) -> Iterator[Problem]:
    """Yield a problem where a whole interval lies below the least PSNR. frame: in whose file it is."""
    if found is not None and found.interval[1] < least:
        got, expected = f"at most {found.interval[1]:.1f} dB", f"at least {least:.1f} dB"
        yield Problem("", what, got, expected, location=str(frame_path(output.file, frame)))


def _least_as_recorded(frames: Sequence[FrameRecord], found: Sequence[float]) -> list[float]:
    """Return for each frame the lower end of the PSNR that was recorded for this picture.

    Few rays may have missed large errors, and recorded a frame as better than it is. Such a frame is hardly worse than
    some frame beside it that is as recorded.
    """
    lows = [_low(frame) for frame in frames]
    hardly_worse = [
        psnr(_HARDLY_WORSE * squared_error(value)) if value >= low else math.inf
        for value, low in zip(found, lows, strict=True)
    ]
    return [min([low, *(hardly_worse[at] for at in _beside(k, len(found)))]) for k, low in enumerate(lows)]


def _least_usual(frames: Sequence[FrameRecord], found: Sequence[float]) -> list[float]:
    """Return for each frame the PSNR below which it is unusual.

    Its error is several times as large as usual, and it has lost several times as much as usual from what was recorded.
    """
    errors = [squared_error(value) for value in found]
    losses = [error - squared_error(_psnr(frame)) for frame, error in zip(frames, errors, strict=True)]
    lows = [squared_error(_low(frame)) for frame in frames]
    usual = zip(_usual(errors), lows, _usual(losses), strict=True)
    return [psnr(max(_UNUSUAL * error, low + _UNUSUAL * loss)) for error, low, loss in usual]


def _usual(values: Sequence[float]) -> list[float]:
    """Return for each frame the median of the film or, where that is more, of the frames beside it."""
    values = [max(value, ROUNDING_ERROR) for value in values]
    median, num = statistics.median(values), len(values)
    beside = ([values[at] for at in _beside(k, num)] for k in range(num))
    return [max(median, statistics.median_high(near or [median])) for near in beside]


def _beside(k: int, num: int) -> list[int]:
    """Return the places of the frames beside one, which show nearly the same."""
    return [each for each in range(max(k - _NUM_BESIDE, 0), min(k + _NUM_BESIDE + 1, num)) if each != k]


def _low(frame: FrameRecord) -> float:
    return MOST_DB if frame.accuracy is None else frame.accuracy.interval[0]


def _psnr(frame: FrameRecord) -> float:
    return MOST_DB if frame.accuracy is None else frame.accuracy.psnr
