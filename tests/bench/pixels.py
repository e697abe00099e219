"""What do several rays of a pixel give films? `python tests/bench/pixels.py DATA` writes the page of it.

Two neighbouring frames of suggested turntables are drawn as they are, and with one ray in each pixel at half of the
tolerance, which was the default when a pixel had one ray. Both are compared with the mean over each pixel. The page is
docs/benchmarks/pixels.md.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from measuring import PAGES, THREADS, SampledTruth, machine_line, parser_of, section, write_page

import renderer
from renderer.accuracy import (
    TRUTH_TOLERANCE,
    Truth,
    compute_truth,
    measure_flicker,
    psnr,
)
from renderer.bricks import ScreenSampling
from renderer.draw import BrickRasterizer
from renderer.film import over_background
from renderer.frame import FilmStage, Frame, Stopwatch, draw_frame, make_draw_list, make_primitive, prepare_stage
from renderer.scene import Scene
from renderer.volume import Float64, UInt8

PAGE = PAGES / "pixels.md"
FRAMES = (7, 8)
# The tolerance of a suggested film.
TOLERANCE = 0.1
# The tolerance of a suggested film when a pixel had one ray.
BEFORE_TOLERANCE = 0.05
# The largest side of a picture that is compared with a whole truth, which alone tells flicker.
LARGEST_WHOLE = 64
REPEATS = 5
SIDES = (512, 256, 64)
SUBJECTS: Mapping[str, str] = {
    "engine, CT": "engine.nhdr",
    "bonsai, CT": "bonsai.nhdr",
    "labels of a head": "medical/PD25_labels.nii.gz",
    "head, T1 atlas": "medical/PD25_T1.nii.gz",
    "head, CT, oblique": "medical/CT_pitch.nii.gz",
    "chest, CT": "medical/LIDC2.mha",
}
VESSELS = "vessels, a formula"
COLUMNS = " | ".join(["volume", *(f"{side} x {side}: dB, dB, time" for side in SIDES), "flicker"])


class Figures(NamedTuple):
    """The accuracy of two frames in decibels, the seconds of one, and the flicker between both, if it is known."""

    psnr: float
    seconds: float
    flicker: float | None


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    text = (
        "Decibels of frames 7 and 8 against the mean over the pixel, of one ray and as they are, and processor time by "
        "that of one ray. *Flicker*, of both: the change of the error of a pixel between both frames that 1 % of the "
        "object's pixels exceed, of 255 levels."
    )
    lines = [machine_line(), "", *section("Several rays of a pixel", text, COLUMNS)]
    for name in (*SUBJECTS, VESSELS):
        volume = vessels() if name == VESSELS else data / SUBJECTS[name]
        scenes = [renderer.suggest_scene(volume, size=(side, side)) for side in SIDES]
        lines.append(f"| {name} | {' | '.join(cell for scene in scenes for cell in measured(scene))} |")
        print(lines[-1], flush=True)
        write_page(PAGE, lines)


def measured(scene: Scene) -> Iterator[str]:
    """Yield the cell of a scene, and that of its flicker if its pictures are compared with whole truths."""
    is_whole = max(scene.output.size) <= LARGEST_WHOLE
    with prepare_stage(scene, clock=time.process_time, num_threads=THREADS, any_tolerance=True) as stage:
        compare = whole_comparison(stage) if is_whole else sampled_comparison(stage)
        one = figures(stage, BEFORE_TOLERANCE, compare, single)
        now = figures(stage, TOLERANCE, compare, lambda sampling: sampling)
    yield f"{one.psnr:.1f}, {now.psnr:.1f}, {now.seconds / one.seconds:.2f}"
    if one.flicker is not None and now.flicker is not None:
        yield f"{one.flicker:.0f}, {now.flicker:.0f}"


def single(sampling: ScreenSampling) -> ScreenSampling:
    """Return a sampling with one ray in each pixel."""
    return replace(sampling, contrast_threshold=math.inf, spread_threshold=math.inf, is_scouted=False)


Comparison = Callable[[list[Float64]], tuple[float, float | None]]


def figures(
    stage: FilmStage, tolerance: float, compare: Comparison, change: Callable[[ScreenSampling], ScreenSampling]
) -> Figures:
    """Draw both frames several times, and compare their pictures. change: of the screen sampling."""
    lod = make_primitive(stage.first).make_lod(tolerance, lambda _: None)
    lod = replace(lod, batches=[replace(each, screen_sampling=change(each.screen_sampling)) for each in lod.batches])

    def draw(number: int) -> Frame:
        watch = Stopwatch(time.process_time)
        return draw_frame(make_draw_list(stage.first, lod, number, watch), rasterizer, watch)

    with BrickRasterizer(num_threads=THREADS) as rasterizer:
        drawn = [draw(number) for number in FRAMES]
        taken = list[float]()
        for _ in range(REPEATS):
            begin = time.process_time()
            draw(FRAMES[0])
            taken.append(time.process_time() - begin)
    found, flicker = compare([over_background(each.radiance, stage.scene.background) for each in drawn])
    return Figures(found, statistics.median(taken), flicker)


def whole_comparison(stage: FilmStage) -> Comparison:
    """Return a function that compares pictures of both frames with whole truths."""
    truths = [compute_truth(stage, number, TRUTH_TOLERANCE, num_threads=THREADS) for number in FRAMES]

    def compare(pictures: list[Float64]) -> tuple[float, float | None]:
        errors = [squared_error(truth, picture) for truth, picture in zip(truths, pictures, strict=True)]
        flicker = measure_flicker(*(truth.errors_of(each) for truth, each in zip(truths, pictures, strict=True)))
        return psnr(statistics.fmean(errors)), flicker and flicker.p99

    return compare


def squared_error(truth: Truth, picture: Float64) -> float:
    """Return the mean squared error of a picture, free of the truth's own."""
    return float(np.mean((picture - truth.means.colors) ** 2 - truth.means.variances))


def sampled_comparison(stage: FilmStage) -> Comparison:
    """Return a function that compares pictures of both frames with exact rays through some pixels."""
    truth = SampledTruth(stage, FRAMES)
    return lambda pictures: (truth.psnr(pictures), None)


def vessels() -> UInt8:
    """Return a tree of vessels in noise, [200, 200, 200]: tubes whose radii fall from 4 to 0.45 voxels."""
    random = np.random.default_rng(3)
    volume = np.zeros((200, 200, 200), np.float32)

    def ball(centre: Float64, radius: float) -> None:
        low = np.maximum(np.floor(centre - radius - 1).astype(int), 0)
        high = np.minimum(np.ceil(centre + radius + 2).astype(int), 200)
        if (low >= high).any():
            return
        places = np.stack(np.meshgrid(*(np.arange(*ends) for ends in zip(low, high, strict=True)), indexing="ij"), -1)
        part = volume[tuple(slice(*ends) for ends in zip(low, high, strict=True))]
        np.maximum(part, np.clip(radius + 0.5 - np.linalg.norm(places - centre, axis=-1), 0, 1) * 200, out=part)

    def branch(place: Float64, direction: Float64, radius: float, depth: int) -> None:
        for _ in range(int(random.uniform(25, 60))):
            direction = direction + random.normal(0, 0.12, 3)
            direction /= np.linalg.norm(direction)
            place = place + direction
            ball(place, radius)
        for _ in range((depth > 0) * (2 if depth < 5 else 3)):
            branch(place, direction + random.normal(0, 0.7, 3), max(0.45, radius * 0.75), depth - 1)

    branch(np.array([100.0, 100, 30]), np.array([0, 0, 1.0]), 4.0, 6)
    branch(np.array([100.0, 100, 170]), np.array([0, 0, -1.0]), 3.0, 6)
    return np.clip(volume + random.normal(0, 3, volume.shape) + 10, 0, 255).astype(np.uint8)


if __name__ == "__main__":
    main()
