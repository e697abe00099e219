"""Light that scatters, by Monte Carlo, against closed forms, exact rays, and itself; errors in standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from hashlib import blake2b
from typing import Any

import numpy as np
import pytest
from brickwork import transfer_of
from ray_integrals import look, oblique, volume
from scipy.special import expn

from renderer.errors import RenderError
from renderer.lighting import LightSources
from renderer.scene import ClipSpec, PlaneSpec, TurntablePath, Vector
from renderer.transfer import TransferFunction
from renderer.truth import (
    PathTracer,
    RayIntegrator,
    TrueLayer,
    light_of_pixels,
    pixel_centres,
    states_of,
)
from renderer.view import View
from renderer.volume import Array, Float64, Volume

UP = (0.0, 0.0, 1.0)
EVEN = (1.0, 0.0, 0.0)
# An estimate may differ from the truth by this many of its standard errors: one correct estimate in 16000 differs by
# more, and seeds are fixed.
FOUR = 4.0
# The side of slabs that are as good as endless, in depths.
WIDE = 1e4


def sources(
    bands: Sequence[float] = (0.0, 0.0, 0.0), *, key: Vector = UP, radius: float = 0.01, irradiance: float = 0.0
) -> LightSources:
    bands_rgb = np.outer(np.array(bands), np.ones(3))
    return LightSources((0.6, 0.0, 0.8), bands_rgb, key, radius, np.full(3, irradiance))


def even(extinction: float, albedo: float) -> TransferFunction:
    return transfer_of(*((at, (albedo, albedo, albedo), extinction) for at in (0.0, 1.0)))


def slab(depth: float, albedo: float, *, thickness: float = 1.0, z: float = 0.0) -> TrueLayer:
    """Even matter of an optical depth, endless in x and y, whose lowest points have the given z."""
    affine = np.diag([WIDE * thickness, WIDE * thickness, thickness, 1.0])
    affine[2, 3] = z + thickness / 2
    return TrueLayer(volume([[[1.0]]], affine), even(depth / thickness, albedo))


def down(layer: TrueLayer, size: tuple[int, int] = (1, 1), elevation: float = 90.0, **more: Any) -> View:
    """Straight down, with eight world units across the picture."""
    target = tuple(layer.volume.centre.tolist())
    path = TurntablePath(1, 0.0, elevation)
    view = look(target, 100.0, size, projection="orthographic", path=path, **more)  # type: ignore[arg-type]
    return replace(view, scale_px=size[0] / 8.0)


def traced(
    layers: Sequence[TrueLayer],
    light: LightSources,
    num: int,
    *,
    view: View | None = None,
    seed: int = 1,
    paths: int = 1,
) -> tuple[Float64, Float64]:
    """The mean of rays through the middle of the picture, [4], and its standard error."""
    seen = down(layers[0]) if view is None else view
    places = np.tile(np.array(seen.size) / 2, (num, 1))
    states = states_of(np.zeros(num, np.int64), (seed,))
    found = PathTracer(layers, light).trace(seen, places, states, paths)
    return found.mean(axis=0), found.std(axis=0) / np.sqrt(num)


def h_function(albedo: float, at: float) -> float:
    """Chandrasekhar's H-function for isotropic scattering, by iterating its equation."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    mu, weights = (nodes + 1) / 2, weights / 2
    h = np.ones_like(mu)

    def next_h(x: Float64) -> Float64:
        return np.asarray(1 / (np.sqrt(1 - albedo) + albedo / 2 * ((weights * mu * h) / (x[:, None] + mu)).sum(axis=1)))

    for _ in range(300):
        h = next_h(mu)
    return float(next_h(np.array([at]))[0])


def random_field(affine: Float64 | None = None, shape: tuple[int, int, int] = (6, 7, 5)) -> Volume:
    return volume(np.random.default_rng(3).uniform(0, 1, shape), affine)


def box_of_labels(affine: Float64 | None = None) -> Volume:
    values = np.random.default_rng(7).choice(3, (6, 7, 5)).astype(np.uint8)
    return replace(volume(values, affine), values=values, is_labels=True)


def test_white_furnace() -> None:
    """Matter that absorbs nothing in even light of 1 shows 1: every path brings exactly 1 back."""
    field, labels = random_field(oblique()), box_of_labels(np.diag([1.0, 1.0, 3.0, 1.0]))
    ramp = transfer_of((0.0, (1, 1, 1), 0.0), (1.0, (1, 1, 1), 3.0))
    view = look(tuple(field.centre.tolist()), 20.0, (6, 5))  # type: ignore[arg-type]
    tracer = PathTracer([TrueLayer(field, ramp), TrueLayer(labels, ramp, weight=0.4)], sources(EVEN))
    found = tracer.trace(view, pixel_centres(view.size), states_of(np.arange(30), (1,)), 3)
    assert found[:, 3].max() > 0.9
    np.testing.assert_allclose(found[:, :3], found[:, 3:] * np.ones(3), rtol=1e-13)


def test_an_absorbing_slab_is_black_and_its_opacity_is_exact() -> None:
    found, _ = traced([slab(1.2, 0.0)], sources(EVEN, irradiance=3.0), 2)
    np.testing.assert_allclose(found, [0, 0, 0, -np.expm1(-1.2)], atol=1e-14)


@pytest.mark.parametrize("shares", [(1.0,), (0.75, 0.25)])
@pytest.mark.parametrize("depth", [0.01, 1.2])
def test_a_slab_that_scatters_once(depth: float, shares: tuple[float, ...]) -> None:
    """Even light at a depth t of a slab T: (E2(t) + E2(T - t)) / 2. Layers scatter by their extinctions."""
    albedo = 1e-4
    nodes, weights = np.polynomial.legendre.leggauss(200)
    t = (nodes + 1) / 2 * depth
    mean = (expn(2, t) + expn(2, depth - t)) / 2
    exact = albedo * np.sum(weights / 2 * depth * mean * np.exp(-t))
    layers = [slab(share * depth, albedo / shares[0] if k == 0 else 0.0) for k, share in enumerate(shares)]
    found, error = traced(layers, sources(EVEN), 20000)
    assert error[0] < 0.01 * exact
    assert found[0] == pytest.approx(exact, abs=FOUR * error[0])


@pytest.mark.parametrize("bands", [(1.0, 0.0, 0.0), (1.0, 0.8, 0.0), (1.0, -0.8, 0.0), (1.0, 0.0, 1.2)])
def test_a_sky_over_a_dark_half_space(bands: tuple[float, float, float]) -> None:
    """At the cosine m, the sky has the mean sum b_l P_l(0.8) P_l(m), of which a m / (m + 1) is seen."""
    albedo = 1e-4
    nodes, weights = np.polynomial.legendre.leggauss(64)
    mu, of_axis = (nodes + 1) / 2, (1.0, 0.8, 1.5 * 0.8**2 - 0.5)
    sky = np.polynomial.legendre.legval(mu, np.multiply(bands, of_axis))
    exact = albedo / 2 * np.sum(weights / 2 * sky * mu / (1 + mu))
    found, error = traced([slab(60.0, albedo)], sources(bands), 20000)
    assert error[0] < 0.02 * exact
    assert found[0] == pytest.approx(exact, abs=FOUR * error[0])


@pytest.mark.parametrize(
    ("layers", "albedo", "brightness"),
    [
        ([slab(60.0, 0.5)], 0.5, 0.0983),
        ([slab(60.0, 0.9)], 0.9, 0.3852),
        ([slab(45.0, 1.0), slab(15.0, 0.6)], 0.9, 0.3852),
    ],
)
def test_half_space(layers: list[TrueLayer], albedo: float, brightness: float) -> None:
    """Lit and seen straight down: albedo / 8 H(1)^2, for an irradiance of pi (Chandrasekhar 1950)."""
    exact = albedo / 8 * h_function(albedo, 1.0) ** 2
    assert exact == pytest.approx(brightness, abs=1e-3)
    found, error = traced(layers, sources(irradiance=np.pi), 20000)
    assert error[0] < 0.01 * exact
    assert found[0] == pytest.approx(exact, abs=FOUR * error[0])


def test_half_space_aslant_and_reciprocity() -> None:
    """Light at cosine m0, seen at cosine m: a m0 / (m + m0) H(m) H(m0) / 4; light and eye may change places."""
    albedo, layer = 0.8, slab(60.0, 0.8)
    aslant = down(layer, elevation=30.0)
    eye = tuple((-aslant.forward).tolist())
    assert eye[2] == pytest.approx(0.5)
    per_cosine = albedo / (1.0 + 0.5) * h_function(albedo, 1.0) * h_function(albedo, 0.5) / 4
    seen_aslant = traced([layer], sources(irradiance=np.pi), 20000, view=aslant)
    lit_aslant = traced([layer], sources(key=eye, irradiance=np.pi), 20000)  # type: ignore[arg-type]
    for (found, error), cosine in ((seen_aslant, 1.0), (lit_aslant, 0.5)):
        assert error[0] < 0.01 * found[0]
        assert found[0] / cosine == pytest.approx(per_cosine, abs=FOUR * error[0] / cosine)


@pytest.mark.parametrize(("radius", "tilt"), [(40.0, 0.0), (90.0, 0.0), (45.0, 45.0), (45.0, -30.0)])
def test_a_key_light_has_a_radius(radius: float, tilt: float) -> None:
    """A dark half-space under a disc: the mean of m / (1 + m) over the disc, m the cosine to the vertical."""
    albedo, (away, up) = 1e-4, (np.sin(np.radians(tilt)), np.cos(np.radians(tilt)))
    nodes, weights = np.polynomial.legendre.leggauss(64)
    cosine = 1 - (nodes[:, None] + 1) / 2 * (1 - np.cos(np.radians(radius)))
    m = up * cosine + away * np.sqrt(1 - cosine**2) * np.cos(2 * np.pi * np.arange(64) / 64)
    exact = albedo / 4 * (weights / 2) @ (m / (1 + m)).mean(axis=1)
    light = sources(key=(away, 0.0, up), radius=radius, irradiance=np.pi)
    found, error = traced([slab(60.0, albedo)], light, 100000)
    assert error[0] < 0.007 * exact
    assert found[0] == pytest.approx(exact, abs=FOUR * error[0])


def test_energy_is_never_gained() -> None:
    """In even light of 1, matter of any albedo shows at most its opacity."""
    field = random_field(np.diag([1.0, 1.0, 10.0, 1.0]))
    layer = TrueLayer(field, transfer_of((0.0, (0.2, 0.9, 1.0), 0.1), (1.0, (1.0, 0.5, 1.0), 4.0)))
    view = down(layer, (12, 12))
    found = PathTracer([layer], sources(EVEN)).trace(view, pixel_centres(view.size), states_of(np.arange(144), (1,)), 4)
    assert np.all(found[:, :3] <= found[:, 3:] * (1 + 1e-13))
    means = found.mean(axis=0)
    assert 0.2 * means[3] < means[0] < 0.9 * means[3]


def _masked(mask: Array) -> Volume:
    field = random_field(oblique())
    of_field = replace(volume(mask, oblique()), values=mask, is_labels=True)
    return replace(field, mask=of_field)


FIELD = random_field(oblique())
HOLES = np.where(np.random.default_rng(11).uniform(0, 1, (6, 7, 5)) < 0.2, np.nan, random_field().values)
MASK = np.random.default_rng(5).choice(2, (6, 7, 5)).astype(np.uint8)
# One voxel of 1, which all macrocells share: the largest extinction of each is far above that of most of its points.
PEAK = np.pad([[[1.0]]], [(3, 2), (3, 3), (3, 1)])
HAZE = transfer_of((0.0, (0, 0, 0), 0.42), (1.0, (0, 0, 0), 1.2))
BOX = tuple(tuple((FIELD.centre + end).tolist()) for end in (-1.2, 1.0))
PLANE = PlaneSpec(tuple(FIELD.centre.tolist()), (0.3, -0.2, 1.0))
RAMP = transfer_of((0.0, (0, 0, 0), 0.0), (0.4, (0, 0, 0), 0.03), (0.4, (0, 0, 0), 0.2), (1.0, (0, 0, 0), 0.1))
STEPS = transfer_of((0.5, (0, 0, 0), 0.0), (0.5, (0, 0, 0), 0.1), (1.5, (0, 0, 0), 0.1), (1.5, (0, 0, 0), 0.3))


@pytest.mark.parametrize(
    "layer",
    [
        TrueLayer(FIELD, RAMP),
        TrueLayer(FIELD, RAMP, weight=0.3),
        TrueLayer(random_field(np.diag([1.0, 1.0, 10.0, 1.0])), RAMP, weight=0.1),
        TrueLayer(volume([[[0.7]]], np.diag([8.0, 8.0, 4.0, 1.0])), RAMP),
        TrueLayer(random_field(shape=(9, 10, 11)), RAMP),
        TrueLayer(volume(PEAK), HAZE),
        TrueLayer(volume(HOLES, oblique()), RAMP),
        TrueLayer(box_of_labels(oblique()), STEPS, weight=0.8),
        TrueLayer(_masked(MASK), RAMP),
        TrueLayer(FIELD, RAMP, clip=(ClipSpec(box=BOX),)),
        TrueLayer(FIELD, RAMP, clip=(ClipSpec(box=BOX, invert=True),)),
        TrueLayer(FIELD, RAMP, clip=(ClipSpec(plane=PLANE),)),
    ],
    ids=["oblique", "weight", "uneven", "one", "even", "peak", "absent", "labels", "mask", "box", "inverted", "plane"],
)
def test_light_through_an_absorbing_wall(layer: TrueLayer) -> None:
    """A dark floor below a wall, lit from the eye, shows a / 8 times the square of the exact transmittance."""
    albedo, view = 1e-4, down(layer, (6, 6))
    floor = slab(1e3, albedo, z=float(layer.volume.centre[2]) - 60.0)
    exact = RayIntegrator([layer]).integrate(view.clipped(layer.clip), pixel_centres(view.size), [1.0])[0, :, 3]
    assert 0.3 < exact.max() < 0.97
    num = 2000
    places, pixels = np.repeat(pixel_centres(view.size), num, axis=0), np.repeat(np.arange(36), num)
    tracer = PathTracer([layer, floor], sources(irradiance=np.pi))
    found = tracer.trace(view, places, states_of(pixels, (1,)), 1)[:, 0].reshape(36, num) / (albedo / 8)
    errors = found.std(axis=1) / np.sqrt(num)
    expected = (1 - exact) ** 2
    assert abs((found.mean(axis=1) - expected).sum()) < FOUR * np.sqrt((errors**2).sum())
    np.testing.assert_array_less(abs(found.mean(axis=1) - expected), FOUR * errors + 1e-9)
    assert np.sqrt((errors**2).mean()) < 0.03


def test_two_layers_are_one_of_summed_extinctions() -> None:
    """Light, albedo and extinction of a field are the same as those of two thirds and one third of it."""
    field = random_field(oblique())
    ramp = transfer_of((0.0, (0.5, 0.9, 0.2), 0.2), (1.0, (0.9, 0.6, 0.8), 3.0))
    view, light = down(TrueLayer(field, ramp), (8, 8)), sources((0.8, 0.3, 0.1), radius=14.0, irradiance=2.0)
    found = [
        light_of_pixels(PathTracer(layers, light), view, np.arange(64), seed=(1,), standard_error=0.0, most_paths=300)
        for layers in (
            [TrueLayer(field, ramp)],
            [TrueLayer(field, ramp, weight=2 / 3), TrueLayer(field, ramp, weight=1 / 3)],
        )
    ]
    one, two = found
    # Both have the same rays, so that opacities differ by rounding alone.
    np.testing.assert_allclose(one.colors[:, 3], two.colors[:, 3], atol=1e-13)
    errors = np.hypot(one.standard_errors[:, :3], two.standard_errors[:, :3])
    assert np.sqrt((errors**2).mean()) < 0.02
    mean_error = np.sqrt((errors**2).sum(axis=0)) / 64
    np.testing.assert_array_less(abs((one.colors - two.colors)[:, :3].mean(axis=0)), FOUR * mean_error)


def picture(num_threads: int) -> Float64:
    field, ramp = random_field(shape=(9, 10, 11)), transfer_of((0.0, (0.5, 0.9, 0.2), 0.0), (1.0, (0.9, 0.6, 0.8), 3.0))
    layer, light = TrueLayer(field, ramp), sources((0.8, 0.3, 0.1), key=(0.0, 0.6, 0.8), radius=14.0, irradiance=2.0)
    view = down(layer, (24, 24))
    tracer = PathTracer([layer], light, num_threads=num_threads)
    return tracer.trace(view, pixel_centres(view.size), states_of(np.arange(576), (4, 2)), 2)


def test_the_same_bytes_with_any_number_of_threads_and_on_every_machine() -> None:
    one = picture(1)
    assert one.tobytes() == picture(3).tobytes()
    assert blake2b(one.tobytes(), digest_size=8).hexdigest() == "dffa435b29e0663d"


def test_light_that_is_not_scattered_on_its_way_is_scattered_once() -> None:
    """A half-space under a key light: albedo / 4 times the irradiance over pi, over 1 + 1, whatever the albedo."""
    light = sources(irradiance=np.pi)._replace(scattering=0.0)
    found, error = traced([slab(60.0, 0.9)], light, 20000)
    assert found[0] == pytest.approx(0.9 / 4 / 2, abs=FOUR * error[0])
    half, error = traced([slab(60.0, 0.9)], light._replace(scattering=0.5), 20000)
    whole, _ = traced([slab(60.0, 0.45)], light._replace(scattering=1.0), 20000)
    assert half[0] == pytest.approx(2 * whole[0], abs=2 * FOUR * error[0])


def test_other_seeds_have_other_paths() -> None:
    """Paths, too, and not only their places, which make no difference in even matter."""
    layer = slab(1.0, 0.5)
    tracer, view, pixels = PathTracer([layer], sources((1.0, 0.5, 0.0))), down(layer, (2, 1)), np.arange(2)
    seeds = ((1, 3), (2, 3), (1, 4))
    found = [light_of_pixels(tracer, view, pixels, seed=seed, standard_error=0.0, most_paths=8) for seed in seeds]
    assert len({*np.concatenate([each.halves[:, :, 0].ravel() for each in found]).tolist()}) == 12


def test_halves_give_the_squared_error_without_the_noise() -> None:
    """The standard error of pixels is as stated; (a - x1)(a - x2) has the squared error of a as its mean."""
    field, ramp = random_field(oblique()), transfer_of((0.0, (0.9, 0.9, 0.9), 0.2), (1.0, (0.9, 0.9, 0.9), 3.0))
    view, light = down(TrueLayer(field, ramp), (16, 16)), sources(EVEN, irradiance=2.0, radius=14.0)
    tracer, pixels = PathTracer([TrueLayer(field, ramp)], light), np.arange(256)
    found = light_of_pixels(tracer, view, pixels, seed=(1,), standard_error=0.02, most_paths=10**4)
    assert 0.01 < found.standard_error < 0.022
    truth = light_of_pixels(tracer, view, pixels, seed=(2,), standard_error=0.0, most_paths=2000)
    assert truth.num_paths > 4 * found.num_paths
    errors = np.hypot(found.standard_errors, truth.standard_errors)[:, 0]
    differences = (found.colors - truth.colors)[:, 0]
    # The mean of the squares of 256 differences, about a half of which are not 0.
    assert (differences**2).mean() == pytest.approx((errors**2).mean(), rel=0.5)
    wrong = truth.colors[:, 0] + 0.01
    first, second = found.halves[:, :, 0]
    products = (wrong - first) * (wrong - second)
    spread = products.std() / np.sqrt(256)
    assert products.mean() == pytest.approx(1e-4, abs=FOUR * spread)
    assert ((wrong - found.colors[:, 0]) ** 2).mean() > 1e-4 + FOUR * spread


def test_voxels_that_are_colours_are_refused() -> None:
    colors = np.zeros((1, 1, 1, 3), np.uint8)
    with pytest.raises(RenderError, match="whose voxels are colours"):
        PathTracer([TrueLayer(replace(volume([[[1.0]]]), colors=colors), even(1.0, 0.5))], sources())
