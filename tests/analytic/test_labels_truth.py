"""Exact rays through labels and masks: against the rule, written down once more in numpy, and against closed forms."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from brickwork import transfer_of
from ray_integrals import interpolate, look, oblique, ray_spans, shade

from renderer.kernels import IndexRays, kernels
from renderer.scene import ClipSpec, PlaneSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.truth import RayIntegrator, TrueLayer, optics_of, pixel_centres
from renderer.view import View
from renderer.volume import Array, Float64, Volume, make_volume

LIT = ShadingSpec(0.3, 0.6, (-1.0, 0.5, 2.0))
GLOSSY = ShadingSpec(0.3, 0.6, "camera", specular=0.4, two_sided=True)
VIEWER = np.array([0.6, 0.48, 0.64])
# Of numbers: 0 shows nothing, others have a red of their own.
EXTINCTIONS = (0.0, 0.5, 0.05, 2.0, 0.0, 0.8, 0.3)


def steps(*extinctions: float) -> TransferFunction:
    colors = [(k / len(extinctions), 1.0 - k / len(extinctions), 0.5) for k in range(len(extinctions))]
    points = [(k + end, colors[k], tau) for k, tau in enumerate(extinctions) for end in (-0.5, 0.5)]
    return transfer_of(*points)


def labels_of(values: Array, affine: Float64 | None = None) -> Volume:
    made = make_volume(np.ascontiguousarray(values, np.uint8), np.eye(4) if affine is None else affine, "labels")
    return replace(made, is_labels=True)


def scattered(*, affine: Float64 | None = None) -> Volume:
    """5^3 labels at random, some of them in groups."""
    return labels_of(np.random.default_rng(5).choice(7, (5, 5, 5), p=[0.3, 0.3, 0.1, 0.1, 0.05, 0.1, 0.05]), affine)


def seen(layer: TrueLayer, origins: Float64, directions: Float64, end: float) -> Float64:
    """RGBA [n, 4] of rays in index space, from their origins up to a length."""
    radiance, parts, one = np.empty((len(origins), 1, 4)), np.tile([0.0, end], (len(origins), 1, 1)), np.ones(1)
    rays = IndexRays(origins, np.ascontiguousarray(np.broadcast_to(directions, origins.shape)), parts, removed=())
    kernels().integrate_rays(
        layers=[optics_of(layer)], fog=None, adds=False, rays=[rays], max_steps=one, radiance=radiance
    )
    return radiance[:, 0]


def winners(of: Volume, index: Float64) -> Float64:
    """The label at [n, 3] points (x, y, z), by its definition; ties apart."""
    nearest = np.floor(index + 0.5).astype(int)
    t = index - nearest
    tents = np.maximum(-t, 0), 1 - abs(t), np.maximum(t, 0)
    splines = (0.5 - t) ** 2 / 2, 0.75 - t**2, (0.5 + t) ** 2 / 2
    weights = [0.2 * tent + 0.8 * spline for tent, spline in zip(tents, splines, strict=True)]
    sums, padded = np.zeros((len(index), 256)), np.pad(of.values, 2, mode="edge")
    for at in np.ndindex(3, 3, 3):
        x, y, z = (nearest + at + 1).T
        sums[np.arange(len(index)), padded[z, y, x]] += np.prod([weights[k][:, i] for i, k in enumerate(at)], axis=0)
    return sums.argmax(axis=1)


def gradients(of: Volume, index: Float64, shading: ShadingSpec) -> Float64:
    """The gradients in the world at [n, 3] points of index space, by their definition."""
    opacities = np.pad(-np.expm1(-np.array(EXTINCTIONS)[of.values] * of.finest_spacing), 3)
    for axis in range(3):
        opacities = np.apply_along_axis(np.convolve, axis, opacities, np.array([1, 4, 6, 4, 1]) / 16, "same")
    differences = [each[3:-3, 3:-3, 3:-3] for each in np.gradient(opacities)[::-1]]
    clipped = np.clip(index, 0, np.array(of.shape_xyz) - 1)
    along_index = np.stack([interpolate(each, clipped) for each in differences], axis=1)
    index_from_world = np.linalg.inv(of.world_from_index[:3, :3])
    light = np.zeros(3) if isinstance(shading.light, str) else np.array(shading.light) / np.linalg.norm(shading.light)
    return along_index @ index_from_world - 0.05 * np.abs(index_from_world).max() * light


def points_along(of: Volume, view: View, num: int) -> Iterator[tuple[Float64, Float64, float]]:
    """For each ray, points [num, 3] of index space in the middle of steps, its direction and its length inside."""
    span, last = ray_spans(of, view), np.array(of.shape_xyz) - 0.5 - 1e-9
    for at, along, length in zip(span.index_at_start, span.index_per_length, span.length, strict=True):
        # Also inside where a ray misses the volume.
        yield np.clip(at + ((np.arange(num) + 0.5) / num * length)[:, None] * along, -0.5, last), along, length


LIGHTS = pytest.mark.parametrize("shading", [None, LIT, GLOSSY], ids=["plain", "lit", "glossy"])


@LIGHTS
def test_the_label_at_a_point_has_the_largest_sum_of_weights(shading: ShadingSpec | None) -> None:
    """And its light is that of the smoothed opacities' gradient."""
    of, tf = scattered(affine=oblique()), steps(*EXTINCTIONS)
    points = np.random.default_rng(6).uniform(-0.5, 4.5, (3000, 3))
    direction = np.linalg.solve(oblique()[:3, :3], -VIEWER)
    short = seen(TrueLayer(of, tf, shading), points, direction, 1e-8)
    colors, extinctions = tf.classify(winners(of, points))
    if shading is not None:
        colors = shade(shading, colors, gradients(of, points, shading), VIEWER)
    np.testing.assert_allclose(short[:, 3], extinctions * 1e-8, rtol=1e-6)
    np.testing.assert_allclose(short[:, :3], colors * short[:, 3:], rtol=1e-5, atol=0)


@LIGHTS
def test_pictures_are_riemann_sums(shading: ShadingSpec | None) -> None:
    of, tf, view, num = scattered(affine=oblique()), steps(*EXTINCTIONS), look((5.0, 1.0, 5.0), 14.0, (8, 6)), 4000
    image = RayIntegrator([TrueLayer(of, tf, shading)]).integrate(view, pixel_centres(view.size), [0.125])[0]
    for (index, along, length), found in zip(points_along(of, view, num), image, strict=True):
        color, tau = tf.classify(winners(of, index))
        depth = tau * length / num
        if shading is not None:
            color = shade(shading, color, gradients(of, index, shading), -oblique()[:3, :3] @ along)
        before = np.cumsum(depth) - depth
        expected = [*(np.exp(-before) * -np.expm1(-depth)) @ color, -np.expm1(-depth.sum())]
        np.testing.assert_allclose(found, expected, rtol=0, atol=3e-4)
    assert np.ptp(image[:, 3]) > 0.5


def lengths_inside(mask: Volume, view: View, *clips: ClipSpec) -> Float64:
    """World lengths [n] of rays in an even volume, which is larger, and in a mask."""
    even = labels_of(np.ones((2, 2, 2)), np.diag([50.0, 50.0, 50.0, 1.0]))
    layer = TrueLayer(replace(even, mask=mask), steps(0, 0.1), clip=clips)
    image = RayIntegrator([layer]).integrate(view, pixel_centres(view.size), [1.0])[0]
    return -np.log1p(-image[:, 3]) / 0.1


def test_a_mask_leaves_what_is_inside_of_it() -> None:
    """Also with a clip plane; a ray has many parts."""
    mask = labels_of(np.random.default_rng(3).random((12, 9, 11)) < 0.5, oblique())
    view, num = look((9.0, 1.0, 14.0), 60.0, (10, 8), field_of_view=10.0), 5000
    expected = []
    for index, _, length in points_along(mask, view, num):
        is_left = index @ mask.world_from_index[0, :3] + mask.world_from_index[0, 3] < 9.0
        expected.append(length * (winners(mask, index) * is_left).mean())
    found = lengths_inside(mask, view, ClipSpec(PlaneSpec((9.0, 0.0, 0.0), (1.0, 0.0, 0.0))))
    np.testing.assert_allclose(found, expected, rtol=0, atol=5e-3)
    assert (found > 0.0).sum() > 30
