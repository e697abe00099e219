"""The error of a frame in scattered light by paths through a few pixels: unbiased, and within the stated interval."""

from __future__ import annotations

from dataclasses import replace
from hashlib import blake2b
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import engine_block, small_tree

import renderer
from renderer.accuracy import ExactRays, FrameProber, Truth, compute_truth, find_tolerances, open_prober, pool_samples
from renderer.draw import open_rasterizer
from renderer.errors import InputError
from renderer.film import over_background, over_black, quantize
from renderer.frame import Frame, Stage, prepare_stage, render_frames, view_of
from renderer.scene import MetricTarget, parse_scene
from renderer.transfer import linear_of_srgb, srgb_of_linear
from renderer.truth import PixelLight, ScenePaths
from renderer.volume import Float64

NUMBER = 3
LIGHT = {"environment": "outdoor", "key": {"direction": [1, -1, 1]}, "exposure": -1}
GRADIENT = {"top": "#4060a0", "bottom": "#c0b090"}
OUTPUT = {"file": "film.mp4", "size": [32, 32], "background": GRADIENT}
# An estimate may differ from the truth by this many of its standard errors.
FOUR = 4.0


def stage_of(light: Any = LIGHT, *, points: Any = None, **output: Any) -> Stage:
    more = {} if points is None else {"transfer_function": {"points": points}}
    tree = small_tree(volume=engine_block(24, 24, 12), error={"tolerance": 0.5}, output=OUTPUT | output, **more)
    film = parse_scene(tree | ({} if light is None else {"light": light}), base=Path())
    stage = prepare_stage(film, clock=lambda: 0.0, num_threads=2, any_tolerance=True)
    assert isinstance(stage, Stage)
    return stage


def drawn(stage: Stage) -> Frame:
    with open_rasterizer(stage.scene) as rasterizer:
        (frame,) = render_frames(stage, [NUMBER], rasterizer, clock=lambda: 0.0)
    return frame


def error_of(picture: Float64, truth: Truth) -> float:
    return float(((picture - truth.means.colors) ** 2 - truth.means.variances).mean())


def intervals_hold(num_repeats: int, num_probes: int, standard_error: float) -> tuple[float, float, float]:
    """Return the error of a frame by a whole converged picture, the mean of estimates, and how many intervals hold it.

    The mean of estimates is returned as its difference from the error, in standard errors.
    """
    stage = stage_of()
    frame = drawn(stage)
    truth = compute_truth(stage, NUMBER, 1e-4, standard_error=standard_error)
    exact = error_of(frame.unrounded, truth)
    found = [
        FrameProber(stage, num_probes, seed=seed).exact_pixels(NUMBER, frame.image).compare_radiance(frame.radiance)
        for seed in range(num_repeats)
    ]
    means = np.array([each.samples.mean for each in found])
    intervals = np.array([each.samples.interval for each in found])
    held = np.mean((intervals[:, 0] <= exact) & (exact <= intervals[:, 1]))
    # Squares of the noise of the converged picture, whose mean is subtracted, add to the difference.
    noise = standard_error**2 / np.sqrt(truth.means.colors.size / 3)
    spread = np.hypot(means.std() / np.sqrt(num_repeats), noise)
    return exact, float((means.mean() - exact) / spread), float(held)


def test_probes_estimate_the_error_of_a_whole_picture() -> None:
    exact, deviations, held = intervals_hold(20, 64, 0.004)
    assert 1e-5 < exact < 2e-4
    assert abs(deviations) < FOUR
    assert held >= 0.95


@pytest.mark.slow
def test_intervals_hold_the_error_against_converged_light() -> None:
    """Of 16, 64 and 256 probes, 19 times of 20."""
    for num_probes, num_repeats in ((16, 200), (64, 100), (256, 50)):
        exact, deviations, held = intervals_hold(num_repeats, num_probes, 0.001)
        assert exact > 1e-5
        assert abs(deviations) < FOUR
        assert held >= 0.95


def test_converged_pictures_have_the_standard_error_that_they_state() -> None:
    stage = stage_of(LIGHT | {"exposure": -4})  # shown colours have less noise than linear light
    paths, view, shares = ScenePaths(stage), view_of(stage, NUMBER), list[float]()
    one, other = (
        paths.converge(view, stage.scene.background, 0.001, seed=(seed,), on_progress=shares.append).means
        for seed in (1, 2)
    )
    stated = np.sqrt((one.variances + other.variances).mean())
    assert np.sqrt(((one.colors - other.colors) ** 2).mean()) == pytest.approx(stated, rel=0.1)
    assert 0.0006 < np.sqrt(one.variances.mean()) < 0.0011
    assert shares[-1] == 1.0


@pytest.mark.parametrize(
    ("kind", "limit"),
    [
        ({"file": "film.mp4"}, 2e-5),
        ({"file": "f{frame}.png", "pixel_format": "rgb48"}, 1e-8),
        ({"file": "f{frame}.png", "background": "transparent"}, 1e-4),
        ({"file": "f{frame}.exr"}, 1e-8),
        ({"file": "f{frame}.exr", "background": "transparent"}, 1e-8),
    ],
    ids=["8 bits", "16 bits", "transparent", "floats", "transparent floats"],
)
def test_a_picture_of_any_kind_has_the_error_of_its_radiance(kind: dict[str, Any], limit: float) -> None:
    """They are composited in linear light, and compared as they are shown."""
    stage = stage_of(**kind)
    frame = drawn(stage)
    exact = FrameProber(stage, 64).exact_pixels(NUMBER, frame.image)
    of_radiance = exact.compare_radiance(frame.radiance).samples.mean
    assert exact.compare_image(frame.image).samples.mean == pytest.approx(of_radiance, abs=limit)
    assert exact.compare_picture(frame.unrounded).samples.mean == pytest.approx(of_radiance, abs=1e-12)
    assert of_radiance < 0.01


def test_matter_without_light_shows_the_background_by_its_opacity() -> None:
    """Black matter scatters nothing: paths show the encoded mean of what passes, as an exact closed form."""
    tree = small_tree(volume=engine_block(24, 24, 12), output=OUTPUT, light=LIGHT, error={"tolerance": 0.01})
    tree["transfer_function"] = {
        "points": [{"value": at, "color": "black", "opacity": opacity} for at, opacity in ((50, 0.0), (255, 0.3))]
    }
    stage = prepare_stage(parse_scene(tree, base=Path()), clock=lambda: 0.0, num_threads=2)
    frame = drawn(stage.first)
    exact = FrameProber(stage.first, 200).exact_pixels(NUMBER, frame.image)
    at = exact.chosen.numbers
    top, bottom = ([*bytes.fromhex(GRADIENT[end][1:])] for end in ("top", "bottom"))
    row = (at // 32 + 0.5)[:, None] / 32
    behind = linear_of_srgb((np.array(top) * (1 - row) + np.array(bottom) * row) / 255)
    left = 1 - frame.radiance[..., 3].reshape(-1, 1)[at]
    np.testing.assert_allclose(exact.means.colors, srgb_of_linear(left * behind), atol=0.02)
    assert exact.compare_radiance(frame.radiance).samples.mean < 3e-5


def test_visible_ranges_are_those_of_the_scene_without_light() -> None:
    lit, plain = stage_of(), stage_of(light=None)
    image = drawn(lit).image
    visible, expected = (FrameProber(stage, 100).exact_pixels(NUMBER, image).visible for stage in (lit, plain))
    assert visible == expected
    assert len(visible) == 2


def test_figures_do_not_depend_on_the_number_of_threads() -> None:
    stage = stage_of()
    frame = drawn(stage)
    found = [FrameProber(stage, 50, num_threads=num).probe(NUMBER, frame.image) for num in (1, 2, 5)]
    assert found[0] == found[1] == found[2]
    assert FrameProber(stage, 50, seed=1).probe(NUMBER, frame.image) != found[0]


def test_films_have_half_as_many_probes_as_by_rays() -> None:
    counts = []
    for light in (None, LIGHT):
        tree = small_tree(frames=120, volume=engine_block(9, 9, 9), error={}, output=OUTPUT | {"size": [2048, 1024]})
        film = parse_scene(tree | ({} if light is None else {"light": light}), base=Path())
        prober = open_prober(prepare_stage(film, clock=lambda: 0.0, num_threads=2), 2)
        assert prober is not None
        counts.append(prober.exact_pixels(0, np.zeros((1024, 2048, 3), np.uint8)).chosen.numbers.size)
    assert counts == [128, 64]


def test_halves_are_shown_without_the_bias_of_the_encoding() -> None:
    """Of noisy parts, of a tenth of the light, a plain encoding of their mean is too dark by a known amount."""
    random, num = np.random.default_rng(1), 200_000
    light = 0.1 * np.array([1.0, 2.0, 4.0])
    parts = np.ones((2, 2, num, 4))
    parts[..., :3] = light * random.gamma(20.0, 1 / 20.0, (2, 2, num, 3))
    pixels = PixelLight(parts, np.zeros((num, 4)), 16)
    shown = pixels.shown(np.zeros((num, 3)), 1.0)
    errors = shown.colors - srgb_of_linear(light)
    plain = srgb_of_linear(pixels.colors[:, :3]) - srgb_of_linear(light)
    assert plain.mean() < -8e-4
    assert abs(errors.mean()) < 0.1 * abs(plain.mean())
    # The variances are those of the means, and (a - x1)(a - x2) has the squared error of a without the noise.
    assert shown.variances.mean() == pytest.approx((errors**2).mean(), rel=0.02)
    wrong = srgb_of_linear(light) + 0.03
    assert ((wrong - shown.colors) ** 2 - shown.variances).mean() == pytest.approx(0.03**2, rel=0.02)
    assert pixels.shown(np.zeros((num, 3)), 2.0).colors.mean(axis=0)[0] == pytest.approx(srgb_of_linear(0.2), abs=1e-3)


def test_srgb_of_linear_light() -> None:
    encoded = np.concatenate([np.arange(65536) / 65535, [0.0404, 0.0405]])
    found = srgb_of_linear(linear_of_srgb(encoded))
    np.testing.assert_allclose(found, encoded, rtol=0, atol=3e-7)  # of the two parts, which do not quite meet
    linear = np.arange(4097) / 4096
    expected = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(srgb_of_linear(linear), expected, rtol=4e-15)
    assert blake2b(srgb_of_linear(linear).tobytes(), digest_size=8).hexdigest() == "2c70681da0c6d3a3"


@pytest.mark.parametrize("background", [None, (0.2, 0.4, 0.6)])
@pytest.mark.parametrize("depth", [8, 16, 32])
def test_pictures_of_linear_light_are_read_as_they_were_made(
    depth: int, background: tuple[float, float, float] | None
) -> None:
    radiance = np.random.default_rng(2).random((20, 20, 4), np.float32)
    radiance[..., 3] = 0.5 + radiance[..., 3] / 2
    radiance[..., :3] *= radiance[..., 3:]
    picture = over_black(quantize(radiance, background, depth, is_linear=True), is_linear=True)[..., :3]
    expected = over_background(radiance, background, is_linear=True)
    np.testing.assert_allclose(picture, expected, atol={8: 0.006, 16: 3e-5, 32: 1e-6}[depth])


@pytest.mark.slow
def test_tolerances_are_found_for_an_accuracy_or_the_grid_of_light_is_named() -> None:
    # Cells of a voxel do not resolve how far light reaches into opaque matter.
    stage = stage_of(
        points=[{"value": 90, "opacity": 0, "color": "white"}, {"value": 100, "opacity": 1, "color": "white"}]
    )
    with open_rasterizer(stage.scene) as rasterizer:

        def find(psnr: float) -> Any:
            want = MetricTarget("psnr", psnr)
            reference = ExactRays(stage, want, num_threads=2)
            return find_tolerances(
                stage, [NUMBER], reference, rasterizer, is_constant=True, clock=lambda: 0.0, on_trial=lambda _: None
            )

        coarse, impossible = find(20), find(60)
    assert coarse.is_reachable and coarse.worst.value > 20 and coarse.by_frame[NUMBER] > 0
    assert not impossible.is_reachable
    error = impossible.shortfall(stage.scene, where="error.psnr", hint="want less")
    assert "light is found on a grid of its own, which no tolerance makes finer" in str(error)


def test_an_exact_picture_has_its_standard_error() -> None:
    shares = list[float]()
    scene = replace(stage_of().scene)
    picture = renderer.integrate(scene, NUMBER, standard_error=0.005, on_progress=shares.append)
    assert picture.shape == (32, 32, 3) and picture.dtype == np.float32
    assert 0.002 < picture.standard_error < 0.0055
    assert np.isnan((2 * picture).standard_error)
    assert shares[-1] == 1.0 and min(shares) > 0
    with pytest.raises(InputError, match="standard error is not positive"):
        renderer.integrate(scene, standard_error=0.0)


def test_samples_of_a_film_state_its_accuracy() -> None:
    stage = stage_of()
    prober = open_prober(stage, 2)
    assert prober is not None
    frame = drawn(stage)
    probes = [prober.probe(NUMBER, frame.image), prober.probe(NUMBER + 1, frame.image)]
    pooled = pool_samples([each.samples for each in probes])
    assert 0 < pooled.interval[0] < pooled.mean < pooled.interval[1]
