"""Predict what a film costs here, in seconds and in bytes, from some of its frames, which are drawn and encoded."""

from __future__ import annotations

import contextlib
import tempfile
import time
from collections.abc import Collection, Mapping, Sequence
from concurrent.futures import Future, wait
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from statistics import fmean
from typing import NamedTuple

import numpy as np

from renderer.accuracy import Glance
from renderer.draw import BrickMemory
from renderer.film import Picture, open_films
from renderer.frame import FilmStage, LODCostEstimator, Stopwatch
from renderer.job.events import JobEvents
from renderer.job.executor import DrawnFrame, Executor
from renderer.job.plan import make_plan
from renderer.layers import frames_of_new_layers
from renderer.scene import FilmScene, OutputFile
from renderer.system import start_threads
from renderer.volume import Float64

# At each place along the path, this many frames are drawn. One follows upon another as in the film: what it costs
# differs from what the first one does, and encoders of video need a few to show what a frame adds.
NUM_NEIGHBOURS = 3


@dataclass(frozen=True)
class Forecast:
    """A prediction of what a film costs: seconds, and the bytes of each output by its file.

    glances: the faults of its pictures, where these were looked at.
    brick_memory: as of an Executor.
    """

    seconds: float
    num_bytes: Mapping[Path, float]
    glances: Sequence[Glance] = ()
    brick_memory: BrickMemory | None = None

    @property
    def seconds_text(self) -> str:
        """Return `2.1 s`, `35 s` or `12 min`."""
        return f"{self.seconds:.2g} s" if self.seconds < 99.5 else f"{self.seconds / 60:.0f} min"

    def bytes_text(self, files: Collection[Path]) -> str:
        """Return `35 kB`, `2.1 MB` or `850 MB`, for some files together."""
        kilobytes = sum(self.num_bytes.get(file, 0.0) for file in files) / 1e3
        number, unit = (kilobytes, "kB") if kilobytes < 99.5 else (kilobytes / 1e3, "MB")
        return f"{number:.2g} {unit}" if number < 99.5 else f"{number:.0f} {unit}"


class Trial(NamedTuple):
    """Some frames of a film that are drawn to predict it, one after the other. num: of frames like them."""

    frames: Sequence[int]
    num: int


def forecast_frames(
    stage: FilmStage, executor: Executor, frames: Sequence[int], start: float, events: JobEvents, num_places: int = 3
) -> Forecast:
    """Predict what a film of these frames costs, by drawing some of them.

    start: of the work, by `perf_counter`. num_places: as of `choose_trials`.
    """
    trials = choose_trials(stage.scene, frames, num_places)
    numbers = [number for trial in trials for number in trial.frames]
    plan = make_plan(LODCostEstimator(stage), sorted({*numbers}), lambda: executor.rasterizer, events)
    events.started("cost", len(numbers))
    output, seconds, costs = stage.scene.output, time.perf_counter() - start, dict[Path, list[tuple[float, ...]]]()
    with contextlib.closing(executor.draw(plan, numbers)) as drawing, start_threads(1) as thread:
        for trial in trials:
            stored, laps, watch = list[Future[DrawnFrame]](), list[float](), Stopwatch(time.perf_counter)
            for frame in islice(drawing, len(trial.frames)):
                wait(stored)  # as in a film, one is stored while the next one is drawn
                stored.append(thread.submit(_store, frame))
                laps.append(watch.lap("frame"))
                events.frame_finished(frame.record)
            seconds += sum(laps) + (trial.num - len(laps)) * fmean(laps[1:] or laps)
            pictures = {each.record.frame: each.pictures for each in (future.result() for future in stored)}
            for each in output.files:
                kind = output.kinds.index(each.kind)
                if shown := [pictures[number][kind] for number in trial.frames if each.shows(number)]:
                    costs.setdefault(each.file, []).append((len(shown), trial.num, *film_cost(each, shown, frames)))
    sizes = dict[Path, float]()
    for file, found in costs.items():  # a film is predicted by the trials of which it shows most
        rows = np.array([row for row in found if row[0] == max(found)[0]])
        encoding, sizes[file] = np.average(rows[:, 2:], axis=0, weights=rows[:, 1]).tolist()
        seconds += encoding
    return Forecast(seconds, sizes, brick_memory=executor.brick_memory)


def _store(frame: DrawnFrame) -> DrawnFrame:
    """Return the frame with its accuracy, and with pictures that are made, and encoded as the checkpoint has them."""
    frame = frame.finished()
    for picture in frame.pictures.values():
        _ = picture.content
    return frame


def choose_trials(scene: FilmScene, frames: Sequence[int], num_places: int = 3) -> list[Trial]:
    """Return trials along the path of a film: of frames for which a layer is made again, of others, and for some files.

    num_places: along the path, at each of which there are trials, one or more. Of files that leave frames out, the
    first ones that they show are drawn, too.
    """
    runs = [run for number in range(len(scene.film_layers)) for run in frames_of_new_layers(scene, number)]
    anew = {frame for first, last in runs for frame in range(first, last + 1)}
    groups = [[frame for frame in frames if (frame in anew) == is_anew] for is_anew in (True, False)]
    num_places, trials = max(1, num_places - all(groups)), list[Trial]()
    for group in groups:
        num = min(num_places, -(-len(group) // NUM_NEIGHBOURS))
        for place in range(num):
            part = group[place * len(group) // num : (place + 1) * len(group) // num]
            middle = max(0, (len(part) - NUM_NEIGHBOURS) // 2)
            trials.append(Trial(part[middle : middle + NUM_NEIGHBOURS], len(part)))
    for each in scene.output.others:
        if (each.every, each.frame) != (1, None) and (first := [*filter(each.shows, frames)][:2]):
            trials.append(Trial(first, len(first)))
    return trials


def film_cost(output: OutputFile, pictures: Sequence[Picture], frames: Sequence[int]) -> Float64:
    """Return the seconds and the bytes that encoding a film of these frames takes, if all are like these pictures."""
    one, several = np.array([_encode(output, pictures[:1]), _encode(output, pictures)])
    following = one if len(pictures) == 1 else np.maximum(several - one, 0.0) / (len(pictures) - 1)
    total: Float64 = one + (sum(map(output.shows, frames)) - 1) * following
    return total


def _encode(output: OutputFile, pictures: Sequence[Picture]) -> tuple[float, float]:
    """Write a film of these pictures alone, and return the seconds and the bytes that it takes."""
    start = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="hsplat-") as folder:
        film = replace(output, file=Path(folder) / output.file.name, every=1, frame=None)
        with open_films([film], [film.kind]) as write:
            for number, picture in enumerate(pictures):
                write(number, {0: picture})
        seconds = time.perf_counter() - start
        return seconds, float(sum(file.stat().st_size for file in Path(folder).iterdir()))
