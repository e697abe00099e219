"""Projections: the exact rays against closed forms and dense sums, and pictures against the exact rays."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from brickwork import AFFINES, placed
from ray_integrals import interpolate, ray_spans
from small_scene import small_tree
from stage_pictures import NUMBER, decibels_of_means, drawn, drawn_by_single_rays, exact

from renderer.frame import Stage, prepare_stage, view_of
from renderer.scene import Scene, parse_scene
from renderer.volume import Array, Float64, Volume

# The share of the tolerance by which the extreme scalar of a ray may be missed.
SLACK_SHARE = 1 / 16

SIZE = (36, 28)
MODES: dict[str, dict[str, Any]] = {
    "maximum": {"type": "maximum"},
    "minimum": {"type": "minimum"},
    "mean": {"type": "mean"},
    "attenuation": {"type": "attenuation", "scale": 0.05, "zero": 0.1},
    "depth": {"type": "maximum", "color_by": "depth"},
}
EACH_MODE = pytest.mark.parametrize("mode", MODES)
CAMERAS: dict[str, dict[str, Any]] = {
    "perspective": {},
    "orthographic": {"projection": "orthographic"},
    "inside": {"distance": 3.0, "near": 0.5, "field_of_view": 70},
}


def scene_of(mode: str, *, tolerance: float = 0.0, camera: str = "perspective", **more: Any) -> Scene:
    """The colour is the value itself, for values from 0 to 1."""
    sections = {
        "transfer_function": {"points": [{"value": 0, "color": "black"}, {"value": 1, "color": "white"}]},
        "mode": MODES[mode],
        "camera": {"path": {"type": "turntable", "frames": 7, "start": -18.4, "elevation": 21}} | CAMERAS[camera],
        "error": {"tolerance": tolerance},
        "output": {"file": "{frame}.png", "size": list(SIZE), "background": "transparent"},
    }
    return parse_scene(small_tree(**sections | more), base=Path())


def stage_of(volume: Volume, scene: Scene) -> Stage:
    return prepare_stage(scene, clock=perf_counter, num_threads=2, volumes=[volume])


def noise(shape: tuple[int, int, int], dtype: npt.DTypeLike = np.float32) -> Array:
    """Voxels from 0 to 1, each by chance; for integers, from 0 to their largest."""
    values = np.random.default_rng(5).random(shape)
    kind = np.dtype(dtype)
    return (values * np.iinfo(kind).max).astype(kind) if kind.kind in "iu" else values.astype(kind)


def dense_samples(stage: Stage, num: int, every: int = 1) -> tuple[Float64, Float64]:
    """The trilinear field at midpoints along rays by nothing but its definition, and the lengths of the rays."""
    volume = stage.layers[0].volume
    span = ray_spans(volume, view_of(stage, NUMBER))
    starts, steps, lengths = (each[::every] for each in (span.index_at_start, span.index_per_length, span.length))
    places = lengths[:, None] * (np.arange(num) + 0.5) / num
    points = starts[:, None] + places[..., None] * steps[:, None]
    points = np.clip(points, 0, np.array(volume.shape_xyz) - 1)
    return interpolate(volume.values.astype(float), points.reshape(-1, 3)).reshape(-1, num), lengths


def number_of(mode: str, samples: Float64, lengths: Float64) -> Float64:
    """Return the colour that a mode gives to samples of rays with these lengths."""
    if mode == "attenuation":
        return np.exp(-0.05 * np.maximum(samples - 0.1, 0).mean(axis=1) * lengths)
    reduce = {"maximum": np.max, "minimum": np.min, "mean": np.mean}[mode]
    return np.asarray(reduce(samples, axis=1))


@EACH_MODE
@pytest.mark.parametrize("affine", AFFINES)
def test_exact_rays_are_those_of_a_constant_volume(mode: str, affine: str) -> None:
    """Closed forms: the constant, Beer and Lambert's law."""
    scene = scene_of(mode)
    stage = stage_of(placed(np.full((5, 6, 7), 0.7, np.float32), AFFINES[affine]), scene)
    image, (_, lengths) = exact(stage), dense_samples(stage, 1)
    is_met = (lengths > 0).reshape(SIZE[::-1])
    assert is_met.any()
    assert not is_met.all()
    assert np.array_equal(image[..., 3] > 0, is_met)
    assert np.all(image[~is_met] == 0)
    wanted = np.exp(-0.05 * (np.float32(0.7) - 0.1) * lengths) if mode == "attenuation" else np.full(lengths.shape, 0.7)
    if mode == "depth":  # the first point counts: nearness times brightness
        assert np.all(image[is_met][:, 0] < 0.7)
    else:
        np.testing.assert_allclose(image[is_met][:, 0], wanted.reshape(SIZE[::-1])[is_met], atol=1e-7)


def test_the_mean_of_a_constant_beside_whose_colour_there_is_no_other_number() -> None:
    points = [{"value": -2, "color": "black"}, {"value": 2, "color": "white"}]
    scene = scene_of("mean", transfer_function={"points": points})
    image = exact(stage_of(placed(np.ones((5, 6, 7)), AFFINES["oblique"]), scene))
    np.testing.assert_allclose(image[image[..., 3] > 0][:, 0], 0.75, atol=1e-7)


@pytest.mark.parametrize("camera", CAMERAS)
def test_exact_rays_are_those_of_dense_samples(camera: str) -> None:
    noisy = placed(noise((6, 5, 7)), AFFINES["oblique"])
    samples, lengths = dense_samples(stage_of(noisy, scene_of("mean", camera=camera)), 3000, every=5)
    is_met = lengths > 0
    assert is_met.any()
    for mode in ("maximum", "minimum", "mean", "attenuation"):
        found = exact(stage_of(noisy, scene_of(mode, camera=camera)))[..., 0].ravel()[::5][is_met]
        wanted = number_of(mode, samples, lengths)[is_met]
        if mode == "maximum":
            assert np.all(found >= wanted - 1e-12)
        if mode == "minimum":
            assert np.all(found <= wanted + 1e-12)
        np.testing.assert_allclose(found, wanted, atol=2e-3, err_msg=mode)


def test_depth_is_where_the_only_maximum_is() -> None:
    values = np.zeros((9, 9, 9), np.float32)
    values[6, 2, 5] = 1
    scene = scene_of("depth")
    stage = stage_of(placed(values), scene)
    image, view = exact(stage), view_of(stage, NUMBER)
    row, column = np.unravel_index(image[..., 0].argmax(), image.shape[:2])
    place = np.array([5.0, 2.0, 6.0])
    volume = stage.layers[0].volume
    x, y, z = view.view_from_world(volume.world_from_index[:3, :3] @ place + volume.world_from_index[:3, 3])
    assert abs(column + 0.5 - SIZE[0] / 2 - view.scale_px * x / -z) < 1
    assert abs(row + 0.5 - SIZE[1] / 2 + view.scale_px * y / -z) < 1
    centre = view.view_from_world(volume.centre)[2]
    share = 0.5 + (centre - z) / (2 * volume.half_diagonal)
    brightness = scene_of("maximum")
    value = exact(stage_of(volume, brightness))[row, column, 0]
    assert image[row, column, 0] == pytest.approx(share * value, abs=0.02)


@EACH_MODE
@pytest.mark.parametrize("affine", ["straight", "oblique"])
@pytest.mark.parametrize("camera", CAMERAS)
def test_single_rays_are_the_exact_rays(mode: str, affine: str, camera: str) -> None:
    """At tolerance 0; over several bricks, which the border clip."""
    scene = scene_of(mode, camera=camera)
    stage = stage_of(placed(noise((35, 18, 40)), AFFINES[affine]), scene)
    image, truth = drawn_by_single_rays(stage), exact(stage)
    assert truth[..., 0].max() > 0.2
    rmse = float(np.sqrt(((image - truth) ** 2).mean()))
    assert rmse < (2e-3 if mode == "depth" else 2e-4), rmse
    if mode in ("maximum", "minimum"):
        assert np.abs(image - truth).max() < 2e-6


@EACH_MODE
@pytest.mark.parametrize(("camera", "least"), [("perspective", 39), ("orthographic", 38), ("inside", 43)])
def test_pictures_are_means_over_pixels(mode: str, camera: str, least: float) -> None:
    """Of noise, a voxel about a pixel; from outside with the sharp edges of its box. One ray a pixel has 24 to 28."""
    stage = stage_of(placed(noise((35, 18, 40)), AFFINES["oblique"]), scene_of(mode, camera=camera))
    assert decibels_of_means(stage) > least


CLIPS = (
    [{"plane": {"point": [10, 8, 6], "normal": [1, -1, 0.4]}}],
    [{"box": [[-100, -100, -100], [18, 9, 14]]}, {"box": [[20, 10, 15], [26, 14, 22]]}],
    [{"plane": {"point": [0, 0, 1], "normal": [0.2, 0, 1]}, "fixed": "camera"}],
)


@EACH_MODE
@pytest.mark.parametrize("clip", CLIPS, ids=["plane", "boxes", "camera"])
def test_what_is_clipped_away_does_not_count(mode: str, clip: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """With any number of threads, at any tolerance."""
    monkeypatch.setattr("renderer.kernels.threads.MIN_PIXELS_PER_THREAD", 1)
    values = noise((35, 18, 40))
    scene, whole = scene_of(mode, clip=clip), scene_of(mode)
    stage = stage_of(placed(values), scene)
    image, truth = drawn_by_single_rays(stage), exact(stage)
    assert np.abs(truth - exact(stage_of(placed(values), whole))).max() > 0.05
    rmse = float(np.sqrt(((image - truth) ** 2).mean()))
    assert rmse < (2e-3 if mode == "depth" else 2e-4), rmse
    for each in (stage, stage_of(placed(values), scene_of(mode, clip=clip, tolerance=0.3))):
        assert np.array_equal(drawn(each, num_threads=3), drawn(each, num_threads=1))


@pytest.mark.parametrize("mode", ["maximum", "minimum"])
def test_a_tolerance_bounds_the_error_of_extremes(mode: str) -> None:
    stage = stage_of(placed(noise((40, 33, 37)), AFFINES["anisotropic"]), scene_of(mode, tolerance=0.14))
    error = np.abs(drawn_by_single_rays(stage) - exact(stage))
    assert error.max() <= SLACK_SHARE * 0.14 + 1e-6
    assert mode == "minimum" or error.max() > 1e-4  # which is made use of


@pytest.mark.parametrize("dtype", [np.uint8, np.int8, np.uint16, np.int32, np.float16, np.float64])
@pytest.mark.parametrize("mode", ["maximum", "minimum"])
def test_every_type_of_number(mode: str, dtype: npt.DTypeLike) -> None:
    values = noise((18, 7, 20), dtype)
    top = float(values.max())
    points = [{"value": 0, "color": "black"}, {"value": top, "color": "white"}]
    scene = scene_of(mode, transfer_function={"points": points})
    stage = stage_of(placed(values), scene)
    assert np.abs(drawn_by_single_rays(stage) - exact(stage)).max() < 2e-6


@pytest.mark.parametrize("factor", [1e-300, 1e-30, 1e30, 1e300])
@pytest.mark.parametrize("mode", sorted({*MODES} - {"attenuation"}))  # whose scale is bounded by the scene
def test_tiny_and_huge_numbers(mode: str, factor: float) -> None:
    points = [{"value": 0, "color": "black"}, {"value": factor, "color": "white"}]
    scene = scene_of(mode, transfer_function={"points": points})
    plain = scene_of(mode)
    values = noise((9, 8, 7), np.float64)
    image = exact(stage_of(placed(values * factor), scene))
    np.testing.assert_allclose(image, exact(stage_of(placed(values), plain)), atol=1e-9)
    found = drawn_by_single_rays(stage_of(placed(values * factor), scene))
    assert np.abs(found - image).max() < (0.05 if mode == "depth" else 3e-3)


def test_what_is_beyond_the_colours_is_at_their_end() -> None:
    values = noise((20, 20, 20)) * 6 - 3
    image = drawn_by_single_rays(stage_of(placed(values), scene_of("maximum")))
    assert image.max() == 1.0
    assert np.mean(image[image[..., 3] > 0][:, 0] == 1.0) > 0.5
    scene = scene_of("maximum")
    assert np.abs(image - exact(stage_of(placed(values), scene))).max() < 1e-5
