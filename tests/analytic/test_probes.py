"""The error of a frame by a few exact rays: unbiased, the same on every run, and within the stated interval."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from small_scene import engine_block, small_tree

from renderer.accuracy import (
    ErrorSamples,
    FrameProber,
    choose_pixels,
    compute_truth,
    error_products,
    error_samples,
    estimate_flicker,
    first_of_pair,
    measure_flicker,
    pool_accuracies,
    pool_samples,
    psnr,
    sampled_accuracy,
)
from renderer.draw import open_rasterizer
from renderer.film import over_background
from renderer.frame import Frame, Stage, prepare_stage, render_frames
from renderer.scene import Scene, parse_scene
from renderer.volume import UInt8

Picture = UInt8
SIZES = ((64, 48, 3), (37, 53, 3), (8, 8, 4), (1, 1, 3), (5, 200, 4))


def edgy_picture(shape: tuple[int, ...]) -> Picture:
    """A picture with an edge and a flat part."""
    picture = np.zeros(shape, np.uint8)
    picture[:, shape[1] // 3 :] = np.random.default_rng(1).integers(0, 255, shape[2])
    picture[: shape[0] // 2, shape[1] // 2 :] //= 3
    return picture


@pytest.mark.parametrize("shape", SIZES, ids=str)
def test_means_are_those_of_all_pixels(shape: tuple[int, int, int]) -> None:
    """Horvitz and Thompson: a quantity over the chance of its pixel has the mean over the picture."""
    picture, height, width = edgy_picture(shape), shape[0], shape[1]
    quantity = np.random.default_rng(2).exponential(size=height * width)
    means = []
    for seed in range(400):
        chosen = choose_pixels(picture, 32, (seed,))
        assert 0 <= chosen.numbers.min() <= chosen.numbers.max() < height * width
        means.append((chosen.factors * quantity[chosen.numbers]).mean())
    assert abs(np.mean(means) - quantity.mean()) <= 4 * np.std(means) / np.sqrt(len(means)) + 1e-12
    everywhere = np.mean([choose_pixels(picture, 32, (seed,)).factors.mean() for seed in range(400)])
    assert everywhere == pytest.approx(1.0, abs=0.05)


def test_every_pixel_may_be_chosen_and_edges_are_more_often() -> None:
    picture = np.zeros((16, 16, 3), np.uint8)
    picture[:8, :3] = 200
    numbers = np.concatenate([choose_pixels(picture, 64, (seed,)).numbers for seed in range(400)])
    counts = np.bincount(numbers, minlength=256).reshape(16, 16)
    assert counts.min() > 0
    assert counts[:8, 2].mean() > 5 * counts[9:, 9:].mean()


def test_the_choice_follows_from_the_seed_and_the_picture() -> None:
    picture = edgy_picture((40, 40, 3))
    for one, two in zip(choose_pixels(picture, 9, (0, 5)), choose_pixels(picture.copy(), 9, (0, 5)), strict=True):
        assert np.array_equal(one, two)
    assert not np.array_equal(choose_pixels(picture, 9, (0, 5)).numbers, choose_pixels(picture, 9, (0, 6)).numbers)


@pytest.mark.parametrize("num", [16, 64, 1024])
@pytest.mark.parametrize("spread", [0.5, 1.0, 1.7])  # of the logarithm
def test_intervals_hold_for_skewed_samples(num: int, spread: float) -> None:
    random, mean = np.random.default_rng(7), np.exp(spread**2 / 2)
    intervals = np.array([error_samples(random.lognormal(0, spread, num)).interval for _ in range(1000)])
    assert np.mean((intervals[:, 0] <= mean) & (mean <= intervals[:, 1])) >= 0.93


def test_an_interval_without_any_error_is_not_a_promise() -> None:
    low, high = error_samples(np.zeros(64)).interval
    assert low == 0.0
    assert 60 < psnr(high) < 80
    assert psnr(low) == np.inf


def test_accuracies_of_samples() -> None:
    """RMSE and PSNR have the same interval, and several frames that of their samples together."""
    samples = [ErrorSamples(1024, 1e-4, 2e-8, 9e-4), ErrorSamples(1024, 3e-4, 1e-7, 2e-3)]
    found = pool_accuracies([sampled_accuracy(each) for each in samples])
    assert found == sampled_accuracy(pool_samples(samples))
    figures = found.everywhere
    assert figures["rmse"] == pytest.approx(np.sqrt(2e-4))
    assert figures["rmse_low"] < figures["rmse"] < figures["rmse_high"]
    for one, other in (("", ""), ("_low", "_high"), ("_high", "_low")):
        assert figures[f"psnr{one}"] == pytest.approx(-20 * np.log10(figures[f"rmse{other}"]))
    assert found.on_volume == {}


def test_pictures_together() -> None:
    """Their mean squared errors count alike, however many rays each has; more rays narrow the interval."""
    one, two = ErrorSamples(64, 1e-4, 1e-8, 9e-4), ErrorSamples(256, 3e-4, 1e-8, 2e-3)
    both = pool_samples([one, two])
    assert (both.num, both.mean, both.largest) == (320, pytest.approx(2e-4), 2e-3)
    assert both.variance / both.num == pytest.approx((1e-8 / 64 + 1e-8 / 256) / 4)
    many = pool_samples([one] * 100)
    assert many.mean == pytest.approx(one.mean)
    assert many.variance == pytest.approx(one.variance)
    assert np.log(np.divide(*many.interval[::-1])) < np.log(np.divide(*one.interval[::-1])) / 5


# Frames

OUTPUT = {"file": "{frame}.png", "size": [80, 60]}
VARIANTS: dict[str, dict[str, Any]] = {
    "plain": {},
    "lit": {"shading": {"ambient": 0.3, "diffuse": 0.7, "light": [1, -1, 1]}},
    "transparent": {"output": OUTPUT | {"background": "transparent"}},
    "white": {"output": OUTPUT | {"background": "white"}},
    "gaussian": {"splat": {"footprint": "gaussian"}},
}
SLOW = ("lit", "transparent", "white")


def scene_of(**sections: Any) -> Scene:
    start = {"volume": engine_block(48, 48, 24), "error": {"tolerance": 0.5}, "output": OUTPUT}
    return parse_scene(small_tree(**start | sections), base=Path())


def drawn(stage: Stage, number: int) -> Frame:
    with open_rasterizer(stage.scene) as rasterizer:
        (frame,) = render_frames(stage, [number], rasterizer, clock=perf_counter)
    return frame


@pytest.mark.parametrize(
    "variant", [pytest.param(name, marks=[pytest.mark.slow] if name in SLOW else []) for name in VARIANTS]
)
def test_rays_measure_the_error_of_a_frame(variant: str) -> None:
    scene = scene_of(**VARIANTS[variant])
    stage = prepare_stage(scene, clock=perf_counter, num_threads=2)
    frame = drawn(stage, 3)
    truth = compute_truth(stage, 3, 1e-4).picture
    shown = frame.image / 255
    picture = shown[..., :3] * shown[..., 3:] if shown.shape[2] == 4 else shown
    exact = FrameProber(stage, 3000).exact_pixels(3, frame.image)
    probe = exact.compare_image(frame.image)
    assert probe.samples.mean == pytest.approx(((picture - truth) ** 2).mean(), abs=4 * probe.samples.deviation)
    assert probe.samples.deviation < 0.1 * probe.samples.mean
    assert probe.largest_error <= np.abs(picture - truth).max() + 0.03  # of rays where edges cross a pixel
    unrounded = over_background(frame.radiance, scene.output.background)
    probe = exact.compare_radiance(frame.radiance)
    assert probe.samples.mean == pytest.approx(((unrounded - truth) ** 2).mean(), abs=4 * probe.samples.deviation)


@pytest.mark.slow
def test_rays_converge_where_they_are_asked_to() -> None:
    """Through the same places, with light, too; rays of one step leave an error."""
    scene = scene_of(**VARIANTS["lit"])
    stage = prepare_stage(scene, clock=perf_counter, num_threads=2)
    frame = drawn(stage, 3)
    exact, converged, quick = (
        FrameProber(stage, 200, tolerance=tolerance).exact_pixels(3, frame.image).means.colors
        for tolerance in (1e-9, 1e-6, None)
    )
    assert np.abs(converged - exact).max() < 1e-6
    assert np.abs(quick - exact).max() > 1e-6


@pytest.mark.slow
def test_an_exact_picture_has_no_error_that_probes_could_tell() -> None:
    """Its means, by other rays, differ by the variances of both: what probes find is that of the picture alone."""
    stage = prepare_stage(scene_of(), clock=perf_counter, num_threads=2)
    truth, frame = compute_truth(stage, 3, 1e-6), drawn(stage, 3)
    found = [
        FrameProber(stage, 300, seed=seed).exact_pixels(3, frame.image).compare_picture(truth.picture).samples
        for seed in range(40)
    ]
    means = [each.mean for each in found]
    own = float(truth.means.variances.mean())
    assert abs(np.mean(means) - own) < 4 * np.std(means) / np.sqrt(len(means))
    assert own < 1e-6 and min(means) < 0
    intervals = np.array([each.interval for each in found])
    assert np.mean((intervals[:, 0] <= own) & (own <= intervals[:, 1])) >= 0.95


def test_figures_do_not_depend_on_the_number_of_threads() -> None:
    stage = prepare_stage(scene_of(**VARIANTS["lit"]), clock=perf_counter, num_threads=2)
    frame = drawn(stage, 5)
    found = [FrameProber(stage, 300, num_threads=num).probe(5, frame.image) for num in (1, 2, 5)]
    assert found[0] == found[1] == found[2]
    assert FrameProber(stage, 300, seed=1).probe(5, frame.image) != found[0]


@pytest.mark.slow
def test_shared_probes_measure_the_change_of_errors() -> None:
    """As whole exact pictures do; the errors of frames that turn, at a coarse tolerance, are partly the same."""
    stage = prepare_stage(scene_of(), clock=perf_counter, num_threads=2)
    first = next(first for frame in range(9) if (first := first_of_pair(frame, 8)) is not None)
    frames = [drawn(stage, first), drawn(stage, first + 1)]
    truths = [compute_truth(stage, frame.number, 1e-4) for frame in frames]
    exact = measure_flicker(*(truth.errors_of(frame.image / 255) for truth, frame in zip(truths, frames, strict=True)))
    assert exact is not None
    found = []
    for seed in range(20):
        probes = [FrameProber(stage, 400, seed=seed).probe(frame.number, frame.image) for frame in frames]
        shared = [probe.shared for probe in probes if probe.shared is not None]
        products = error_products(*shared)
        assert products is not None and shared[0].first == first
        found.append(estimate_flicker(pool_samples([probe.samples for probe in probes]), products))
    assert 255 * np.mean([rms for rms, _ in found]) == pytest.approx(exact.rms, rel=0.1)
    assert sum(low <= exact.rms / 255 <= high for _, (low, high) in found) >= 19
    assert 255 * np.median([high for _, (_, high) in found]) < 1.5 * exact.rms
