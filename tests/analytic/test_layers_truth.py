"""Exact rays through several layers: against closed forms, an independent sum, and the rays through one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from brickwork import transfer_of
from ray_integrals import COLORFUL, look, oblique, ray_spans, volume

from renderer.scene import ClipSpec, PlaneSpec, ShadingSpec
from renderer.transfer import TransferFunction
from renderer.truth import RayIntegrator, TrueLayer, pixel_centres, rays_through
from renderer.view import View
from renderer.volume import Float64, Volume

LIT = ShadingSpec(0.3, 0.6, (-1.0, 0.5, 2.0))
GLOSSY = ShadingSpec(0.3, 0.6, "camera", specular=0.4, gradient_opacity=((0.0, 0.2), (0.6, 1.0)))
LIGHTS = pytest.mark.parametrize("shading", [None, LIT, GLOSSY], ids=["plain", "lit", "glossy"])


def noise(affine: Float64, seed: int = 3) -> Volume:
    return volume(np.random.default_rng(seed).uniform(-0.5, 1.5, (5, 6, 4)), affine)


def turned() -> Float64:
    """Turned about z by 30 degrees, and shifted."""
    affine = np.eye(4)
    sine, cosine = 0.5, np.sqrt(0.75)
    affine[:2, :2] = [[cosine, -sine], [sine, cosine]]
    affine[:3, 3] = [2.0, -1.0, 0.7]
    return affine


ONE, OTHER = TrueLayer(noise(oblique()), COLORFUL, weight=0.6), TrueLayer(noise(turned(), 4), COLORFUL, weight=0.8)


def view_of(size: tuple[int, int] = (20, 14), **camera: object) -> View:
    return look((3.5, 1.0, 3.0), 14.0, size, **camera)


def rays(layers: Sequence[TrueLayer], view: View, step: float = 0.25, *, adds: bool = False) -> Float64:
    """RGBA [n, 4]."""
    return RayIntegrator(layers, adds=adds).integrate(view, pixel_centres(view.size), [step])[0]


def even(extinction: float, color: tuple[float, float, float]) -> TransferFunction:
    return transfer_of((0.0, color, extinction))


@LIGHTS
@pytest.mark.parametrize("adds", [False, True])
def test_halves_of_a_layer_are_the_layer(shading: ShadingSpec | None, adds: bool) -> None:
    whole = TrueLayer(noise(oblique()), COLORFUL, shading)
    halves = [whole._replace(weight=0.5)] * 2
    expected = rays([whole], view_of(), adds=adds)
    np.testing.assert_allclose(rays(halves, view_of(), adds=adds), expected, atol=1e-13)
    assert 0.5 < expected[:, 3].max() < 1.0


@pytest.mark.parametrize("nothing", [even(0.0, (1, 1, 1)), COLORFUL])
def test_an_empty_layer_changes_nothing(nothing: TransferFunction) -> None:
    """With no extinction, or far away: to the last place, but for where rays begin."""
    affine = turned()
    if nothing is COLORFUL:
        affine[:3, 3] += [400.0, 0.0, 0.0]
    empty = TrueLayer(noise(affine), nothing)
    np.testing.assert_allclose(rays([ONE, empty], view_of()), rays([ONE], view_of()), atol=1e-13)


@pytest.mark.parametrize("adds", [False, True])
@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_boxes_that_overlap(projection: str, adds: bool) -> None:
    """Even fogs: three parts of a ray, each with a constant colour and extinction."""
    extinctions, weights = np.array([0.3, 0.5]), np.array([0.9, 0.4])
    colors = np.array([(1.0, 0.2, 0.0), (0.1, 0.4, 1.0)])
    volumes = [volume(np.zeros((5, 4, 6)), oblique()), volume(np.zeros((6, 5, 4)), turned())]
    layers = [
        TrueLayer(of, even(tau, tuple(color)), weight=weight)
        for of, tau, color, weight in zip(volumes, extinctions, colors, weights, strict=True)
    ]
    view = view_of(projection=projection)
    expected = np.zeros((view.size[0] * view.size[1], 4))
    spans = [ray_spans(of, view) for of in volumes]
    origins, directions, _ = rays_through(np.zeros(3), view, pixel_centres(view.size))
    num_overlaps = 0
    for i in range(len(expected)):
        enters, leaves = np.zeros(2), np.zeros(2)
        for k, (of, span) in enumerate(zip(volumes, spans, strict=True)):
            at = of.world_from_index[:3, :3] @ span.index_at_start[i] + of.world_from_index[:3, 3]
            enters[k] = (at - origins[i]) @ directions[i]
            leaves[k] = enters[k] + span.length[i]
        num_overlaps += min(leaves) - max(enters) > 0.1
        depth = 0.0
        ends = np.sort([*enters, *leaves])
        for start, end in pairwise(ends):
            is_inside = (enters <= start) & (end <= leaves)
            taus = is_inside * weights * extinctions * (end - start)
            if taus.sum() > 0.0:
                shown = taus.sum() if adds else np.exp(-depth) * -np.expm1(-taus.sum())
                expected[i, :3] += shown * (taus @ colors) / taus.sum()
                depth += taus.sum()
        expected[i, 3] = -np.expm1(-depth)
    assert num_overlaps > 30
    np.testing.assert_allclose(rays(layers, view, adds=adds), expected, atol=1e-12)


@pytest.mark.parametrize("adds", [False, True])
def test_the_error_falls_with_the_eighth_power_of_the_step(adds: bool) -> None:
    """Two cells of length 8 that overlap partly; 8 is due, 7.5 to 8.1 were seen."""
    affine = turned()
    affine[:3, :3] *= 8.0
    cells = [np.random.default_rng(seed).uniform(0, 1, (2, 2, 2)) for seed in (7, 8)]
    ramp = transfer_of((0, (0, 1, 0.5), 0.01), (1, (1, 0, 0.2), 0.12))
    blue = transfer_of((0, (0, 0, 1), 0.12), (1, (0.5, 0.3, 1), 0.01))
    layers = [
        TrueLayer(volume(cells[0], np.diag([8.0, 8.0, 8.0, 1.0])), ramp, weight=0.6),
        TrueLayer(volume(cells[1], affine), blue, weight=0.5),
    ]
    view, steps = look((4.0, 4.0, 4.0), 60.0, (8, 8), field_of_view=10.0), [1.0, 0.5, 0.25, 1 / 32]
    images = RayIntegrator(layers, adds=adds).integrate(view, pixel_centres(view.size), steps)[..., :3]
    errors = [np.abs(image - images[-1]).max() for image in images[:-1]]
    if adds:  # polynomials of degree 6, which the quadrature integrates exactly
        assert max(errors) < 1e-14
    else:
        orders = np.log2(np.divide(errors[:-1], errors[1:]))
        assert orders.min() > 7.0, errors


@LIGHTS
def test_what_layers_show_is_reported_layer_by_layer(shading: ShadingSpec | None) -> None:
    """It adds up to the opacity, and behind one another each layer shows what it does alone."""
    far = turned()
    far[:3, 3] += 100.0 * view_of().forward
    view, num_own = view_of(), COLORFUL.values.size + 1
    front, behind = ONE._replace(shading=shading), TrueLayer(noise(far), even(0.5, (1, 1, 1)))

    def visible(*layers: TrueLayer) -> Float64:
        found = RayIntegrator(layers).integrate(view, pixel_centres(view.size), [0.5], by_interval=True)[0]
        np.testing.assert_allclose(found[:, 4:].sum(axis=1), found[:, 3], atol=1e-13)
        return found[:, 4:]

    both, through = visible(behind, front), 1.0 - rays([front], view_of(), 0.5)[:, 3:]
    np.testing.assert_allclose(both[:, 2:], visible(front), atol=1e-12)
    np.testing.assert_allclose(both[:, :2], visible(behind) * through, atol=1e-12)
    assert both.shape == (280, 2 + num_own)
    overlapping = visible(front, OTHER)
    np.testing.assert_allclose(visible(OTHER, front), np.roll(overlapping, num_own, axis=1), atol=1e-13)


@LIGHTS
def test_light_falls_on_each_layer_alone(shading: ShadingSpec | None) -> None:
    """Added up, layers show what each shows alone: each has its own gradient and light."""
    layers = [ONE._replace(shading=LIT), OTHER._replace(shading=shading)]
    alone = [rays([layer], view_of(), 1 / 16, adds=True) for layer in layers]
    both = rays(layers, view_of(), 1 / 16, adds=True)
    np.testing.assert_allclose(both[:, :3], alone[0][:, :3] + alone[1][:, :3], atol=1e-5)
    np.testing.assert_allclose(1 - both[:, 3], (1 - alone[0][:, 3]) * (1 - alone[1][:, 3]), atol=1e-5)
    image, convergence = RayIntegrator(layers).converge(view_of(), pixel_centres(view_of().size), 1e-5)
    np.testing.assert_allclose(image, rays(layers, view_of(), 1 / 64), atol=1e-5)
    assert convergence.change[-1] < 1e-5


def test_a_plane_of_one_layer_leaves_the_other_whole() -> None:
    plane = ClipSpec(plane=PlaneSpec((3.5, 1.0, 3.0), (1.0, 0.3, 0.0)))
    shown = [layer._replace(transfer=even(0.3, (1, 1, 1))) for layer in (ONE, OTHER)]
    clipped = [shown[0]._replace(clip=(plane,)), shown[1]]
    view = view_of()
    clipped_view = replace(view, clip=(plane,))

    def depths(layers: Sequence[TrueLayer], view: View) -> Float64:
        return np.asarray(-np.log1p(-rays(layers, view)[:, 3]))

    one, other = depths(shown[:1], clipped_view), depths(shown[1:], view)
    np.testing.assert_allclose(depths(clipped, view), one + other, atol=1e-12)
    np.testing.assert_allclose(
        rays(shown, clipped_view), rays([a._replace(clip=(plane,)) for a in shown], view), atol=1e-13
    )
    assert np.abs(depths(shown[:1], view) - one).max() > 0.1
    assert one.max() > 0.1


def test_voxels_without_data_in_one_layer() -> None:
    values = ONE.volume.values.copy()
    values[1:3, 2:4, 1] = np.nan
    holes = ONE._replace(volume=volume(values, oblique()))
    alone = [rays([layer], view_of(), adds=True) for layer in (holes, OTHER)]
    both = rays([holes, OTHER], view_of(), adds=True)
    np.testing.assert_allclose(both[:, :3], alone[0][:, :3] + alone[1][:, :3], atol=1e-12)
    assert np.isfinite(rays([holes, OTHER], view_of())).all()
    assert np.abs(both - rays([ONE, OTHER], view_of(), adds=True)).max() > 0.01
    absent = ONE._replace(volume=volume(np.full_like(values, np.nan), oblique()))
    np.testing.assert_allclose(rays([absent, OTHER], view_of()), rays([OTHER], view_of()), atol=1e-13)


def test_nothing_ends_a_ray_where_light_adds_up() -> None:
    """A wall of an optical depth of 1e9 and a faint fog behind it."""
    far = np.eye(4)
    far[:3, 3] = 100.0 * view_of().forward
    wall = TrueLayer(volume(np.zeros((9, 9, 9))), even(1e9, (1, 0, 0)))
    fog = TrueLayer(volume(np.zeros((9, 9, 9)), far), even(1e-3, (0, 1, 0)))
    both, alone = (rays(layers, view_of(), adds=True)[:, 1] for layers in ([wall, fog], [fog]))
    np.testing.assert_allclose(both, alone, atol=1e-13)
    assert alone.max() > 1e-3
    is_hidden = rays([wall], view_of())[:, 3] > 1.0 - 1e-11
    assert is_hidden.any()
    np.testing.assert_array_equal(rays([wall, fog], view_of())[is_hidden, 1], 0.0)


def test_a_thin_shell_in_a_fog() -> None:
    """Far thinner than a step: half of it is seen through the fog before it."""
    ramp = volume(np.arange(4.0).reshape(4, 1, 1) * np.ones((4, 9, 9)))
    shell = transfer_of((1.5 - 1e-7, (0, 1, 0), 0.0), (1.5, (0, 1, 0), 1e7), (1.5 + 1e-7, (0, 1, 0), 0.0))
    column = TrueLayer(ramp, shell), TrueLayer(volume(np.zeros((4, 9, 9))), even(0.4, (1, 0, 0)))
    view = look((4.0, 4.0, 1.5), 20.0, (1, 1), projection="orthographic")
    cosine = abs(view.forward[2])
    (found,) = rays(column, view)
    assert found[3] == pytest.approx(-np.expm1(-(1.0 + 1.6) / cosine), abs=1e-8)
    assert found[1] == pytest.approx(np.exp(-0.8 / cosine) * -np.expm1(-1.0 / cosine), abs=1e-7)
