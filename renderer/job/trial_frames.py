"""Predict the cost of a film on this machine, in seconds and in bytes, by drawing and encoding some of its frames."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Sequence
from dataclasses import replace
from itertools import islice
from pathlib import Path
from statistics import fmean
from typing import NamedTuple

import numpy as np

from renderer.film import Picture
from renderer.frame import FilmStage, LODCostEstimator, Stopwatch
from renderer.job.events import JobEvents
from renderer.job.executor import FINISHING_STEPS, DrawnFrame, Executor
from renderer.job.forecast import Forecast, LightCost
from renderer.job.plan import make_plan
from renderer.job.trial_encoding import film_bytes, trial_film
from renderer.layers import frames_of_new_layers
from renderer.lighting import solve_bytes
from renderer.record import FrameRecord
from renderer.scene import FilmScene, OutputFile
from renderer.system import overlap
from renderer.volume import Float64

# The number of frames that are drawn at each place along the path to predict the cost of a film. The frames are
# successive: a frame after another one costs less than the first, and several frames are needed to see how many bytes
# an encoder adds for one more.
NUM_NEIGHBOURS = 3


class Trial(NamedTuple):
    """Some successive frames that are drawn to predict the cost of a film.

    frames: the numbers of the drawn frames. num: the number of frames of the film whose cost is predicted from them.
    """

    frames: Sequence[int]
    num: int


def forecast_frames(
    stage: FilmStage, executor: Executor, frames: Sequence[int], start: float, events: JobEvents, num_places: int = 3
) -> Forecast:
    """Predict the cost of a film of these frames by drawing some of them.

    start: the time by `perf_counter` at which the work began.
    num_places: the number of places along the path at which frames are drawn, at least one.
    """
    trials = choose_trials(stage.scene, frames, num_places)
    numbers = [number for trial in trials for number in trial.frames]
    plan = make_plan(LODCostEstimator(stage), sorted({*numbers}), lambda: executor.rasterizer, events)
    events.started("cost", len(numbers))
    output, seconds, costs = stage.scene.output, time.perf_counter() - start, dict[Path, list[tuple[float, ...]]]()
    # As in a film, the pictures of a frame are encoded for the checkpoint while the next frame is drawn.
    with (
        contextlib.closing(executor.draw(plan, numbers)) as drawn,
        contextlib.closing(overlap(drawn, _encode_pictures)) as done,
    ):
        for trial in trials:
            watch, made = Stopwatch(time.perf_counter), list[DrawnFrame]()
            for frame in islice(done, len(trial.frames)):
                made.append(frame)
                events.frame_finished(frame.record)
            following = fmean(_longest_stage(frame.record) for frame in made[1:] or made)
            seconds += watch.lap("frames") + (trial.num - len(made)) * following
            pictures = {frame.record.frame: frame.pictures for frame in made}
            for each in output.files:
                kind = output.kinds.index(each.kind)
                if shown := [pictures[number][kind] for number in trial.frames if each.shows(number)]:
                    costs.setdefault(each.file, []).append((len(shown), trial.num, *film_cost(each, shown, frames)))
    sizes = dict[Path, float]()
    for file, found in costs.items():  # a file is predicted by the trials of which it shows the most frames
        rows = np.array([row for row in found if row[0] == max(found)[0]])
        encoding, sizes[file] = np.average(rows[:, 2:], axis=0, weights=rows[:, 1]).tolist()
        seconds += encoding
    light, exposure = _light_cost(stage), stage.chosen_exposure
    return Forecast(seconds, sizes, brick_memory=executor.brick_memory, light=light, exposure=exposure)


def _light_cost(stage: FilmStage) -> LightCost | None:
    light = stage.groups[0].light
    if light is None:
        return None
    finest = min(layer.volume.finest_spacing for layer in stage.layers)
    z, y, x, _ = light.radiance.shape
    return LightCost(light.cell / finest, (x, y, z), solve_bytes((x, y, z)), stage.seconds.get("light", 0.0))


def _encode_pictures(frame: DrawnFrame) -> DrawnFrame:
    """Encode the pictures of a frame as a checkpoint does; return the frame with the time of encoding in its record."""
    start = time.perf_counter()
    for picture in frame.pictures.values():
        _ = picture.content
    seconds = {**frame.record.seconds, "encode": time.perf_counter() - start}
    return replace(frame, record=replace(frame.record, seconds=seconds))


def _longest_stage(record: FrameRecord) -> float:
    """Return the seconds that one more frame like this one adds to a film.

    Three things happen at the same time, of which the longest counts: a frame is drawn, the frame before it is
    finished, and the frame before these two is encoded.
    """
    finishing = sum(record.seconds.get(step, 0.0) for step in FINISHING_STEPS)
    encoding = record.seconds["encode"]
    return max(record.total_seconds - finishing - encoding, finishing, encoding)


def choose_trials(scene: FilmScene, frames: Sequence[int], num_places: int = 3) -> list[Trial]:
    """Return the trials by which the cost of a film is predicted.

    There are trials of frames for which layers are made anew, and of frames without new layers. Each output file that
    shows only some of the frames adds a trial of the first two frames that it shows.

    frames: the numbers of the film's frames. num_places: the number of places along the path with trials, at least 1.
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
    """Return the predicted seconds to encode a film, and its predicted bytes: float64 [2].

    pictures: some pictures of the film, which are encoded for the prediction. frames: the numbers of the film's frames.
    """
    one, several = np.array([_encode(output, pictures[:1]), _encode(output, pictures)])
    following = one if len(pictures) == 1 else np.maximum(several - one, 0.0) / (len(pictures) - 1)
    total: Float64 = one + (sum(map(output.shows, frames)) - 1) * following
    return total


def _encode(output: OutputFile, pictures: Sequence[Picture]) -> tuple[float, float]:
    """Write a film of these pictures to a temporary folder, and return the seconds and the bytes that it takes."""
    start = time.perf_counter()
    with trial_film(output, pictures) as film:
        return time.perf_counter() - start, float(film_bytes(film))
