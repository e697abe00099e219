"""Which scalars a picture shows: closed forms, and the same by colours that point out one range."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
import pytest
from brickwork import transfer_of
from ray_integrals import look, volume
from small_scene import small_tree

from renderer.accuracy import FrameProber, ScalarRange, scalar_ranges, visible_ranges
from renderer.draw import BrickRasterizer
from renderer.frame import Stage, prepare_stage, render_frames, view_of
from renderer.record import FilmVisibility, FrameRecord, VisibleRange, film_visibility, range_record, visibility_text
from renderer.scene import ShadingSpec, parse_scene
from renderer.transfer import TransferFunction
from renderer.truth import RayIntegrator, SceneRays, TrueLayer, pixel_centres
from renderer.view import View
from renderer.volume import Float64, Volume

GREY = (0.5, 0.5, 0.5)
PICTURE = np.zeros((30, 40, 3), np.uint8)
STEPS = transfer_of(
    *((0.0, GREY, 0.0), (0.2, GREY, 0.0), (0.2, GREY, 0.3), (0.5, GREY, 0.3)),
    *((0.5, GREY, 1.5), (0.8, GREY, 0.4), (0.8, GREY, 0.0), (0.9, GREY, 0.0), (0.9, GREY, 4.0)),
)
SHADING = ShadingSpec(0.3, 0.6, (-1.0, 0.5, 2.0))
GLOSSY = ShadingSpec(0.3, 0.6, (-1.0, 0.5, 2.0), specular=0.4, gradient_opacity=((0.0, 0.2), (0.6, 1.0)))


def noise(shape: tuple[int, int, int] = (6, 7, 8)) -> Volume:
    return volume(np.random.default_rng(3).random(shape))


def rays(
    of: Volume, transfer: TransferFunction, view: View, shading: ShadingSpec | None = None, **options: Any
) -> tuple[Float64, Float64]:
    """RGBA [n, 4] and what each interval shows [n, intervals]."""
    integrator = RayIntegrator([TrueLayer(of, transfer, shading)], **options)
    found = integrator.integrate(view, pixel_centres(view.size), [0.5], by_interval=True)[0]
    return found[:, :4], found[:, 4:]


def noise_view() -> View:
    return look(tuple(noise().centre), 20.0)


@pytest.mark.parametrize("shading", [None, SHADING, GLOSSY], ids=["plain", "lit", "glossy"])
def test_ranges_add_up_to_the_opacity(shading: ShadingSpec | None) -> None:
    """Of any colours, and with no change to what rays gather."""
    view, integrator = noise_view(), RayIntegrator([TrueLayer(noise(), STEPS, shading)])
    radiance, visible = rays(noise(), STEPS, view, shading)
    np.testing.assert_allclose(visible.sum(axis=1), radiance[:, 3], atol=1e-13)
    assert np.array_equal(radiance, integrator.integrate(view, pixel_centres(view.size), [0.5])[0])
    red = replace(STEPS, colors=STEPS.colors * [1, 0, 0])
    assert np.array_equal(visible, rays(noise(), red, view, shading)[1])
    assert np.array_equal(visible, rays(noise(), STEPS, view, shading, num_threads=5)[1])
    assert visible[:, [1, 6, 7]].max() == 0.0
    assert visible.mean(axis=0)[[3, 5, 9]].min() > 1e-3


@pytest.mark.parametrize("interval", [3, 5, 9])
def test_a_range_shows_what_its_colour_shows(interval: int) -> None:
    """White in one range and black in all others: the radiance is what the range shows."""
    view, colors = noise_view(), np.zeros((STEPS.values.size, 3))
    colors[interval - 1 : interval + 1] = 1.0  # the control points at its ends, each one of a step
    radiance, visible = rays(noise(), replace(STEPS, colors=colors), view)
    assert visible[:, interval].max() > 0.1
    np.testing.assert_allclose(radiance[:, :3], visible[:, [interval] * 3], atol=1e-9)


# Ranges that are told


def bounds(transfer: TransferFunction, lowest: float = 0.0, highest: float = 1.0) -> list[tuple[float, float]]:
    return [each[:2] for each in visible_ranges(transfer, lowest, highest)]


def test_ranges_lie_between_control_points() -> None:
    assert bounds(STEPS) == [(0.2, 0.5), (0.5, 0.8), (0.9, np.inf)]
    assert bounds(STEPS, 0.3, 0.6) == [(0.2, 0.5), (0.5, 0.8)]
    assert bounds(STEPS, 0.0, 0.1) == []
    found = [each.opacity for each in visible_ranges(STEPS, 0.0, 1.0)]
    np.testing.assert_allclose(found, -np.expm1([-0.3, -1.5, -4.0]))


def test_what_lies_beyond_the_control_points_has_no_end() -> None:
    ramp = transfer_of((0.2, GREY, 1.0), (0.4, GREY, 0.5), (0.7, GREY, 2.0))
    assert bounds(ramp) == [(-np.inf, 0.4), (0.4, np.inf)]
    assert bounds(transfer_of((0.2, GREY, 1.0))) == [(-np.inf, np.inf)]
    assert bounds(transfer_of((0.2, GREY, 0.0), (0.6, GREY, 0.0))) == []


@pytest.mark.parametrize("factor", [1.0, 1e-300, 1e308])
def test_many_control_points_make_twelve_ranges(factor: float) -> None:
    values = np.linspace(-1, 1, 256)
    ramp = TransferFunction(factor * values, np.ones((256, 3)), np.maximum(values, 0.0), 1.0)
    found = visible_ranges(ramp, -factor, factor)
    assert len(found) == 12
    assert found[-1].high == np.inf
    assert all(one.high == two.low for one, two in pairwise(found))
    widths = [each.high / factor - each.low / factor for each in found[:-1]]
    np.testing.assert_allclose(widths, 1 / 12, atol=1 / 128)
    assert len(visible_ranges(ramp, -factor, 0.1 * factor)) == 12  # of the values that there are


# Frames and films


def stage_of(**sections: Any) -> Stage:
    scene = parse_scene(small_tree(output={"file": "{frame}.png", "size": [40, 30]}, **sections), base=Path())
    return prepare_stage(scene, clock=perf_counter, num_threads=2)


@pytest.mark.slow
def test_a_frame_shows_what_all_its_rays_show() -> None:
    stage = stage_of()
    with BrickRasterizer() as rasterizer:
        (frame,) = render_frames(stage, [3], rasterizer, clock=perf_counter)
    _, everywhere = SceneRays(stage).integrate_by_interval(view_of(stage, 3), pixel_centres((40, 30)), 1.0)
    low, high = everywhere.mean(axis=0)[1:3].tolist()
    found = FrameProber(stage, 20_000).probe(3, frame.image).visible
    assert found == pytest.approx((low, high), rel=0.05)
    assert min(low, high) > 0.01


def test_each_of_several_volumes_has_ranges() -> None:
    """The same one twice, three times as dense: of each pair of ranges, the second shows three times as much."""
    tree = small_tree(output={"file": "{frame}.png", "size": [40, 30]})
    one = tree.pop("volume") | {"transfer_function": tree.pop("transfer_function")}
    scene = parse_scene(tree | {"volumes": [one, one | {"weight": 3}]}, base=Path())
    stage = prepare_stage(scene, clock=perf_counter, num_threads=2)
    num, visible = len(scalar_ranges(stage)) // 2, FrameProber(stage, 900).probe(3, PICTURE).visible
    assert num == 2 and visible[num:] == pytest.approx([3 * each for each in visible[:num]], abs=3e-6)
    assert min(visible) > 0.01 and [each.layer for each in scalar_ranges(stage)] == [0, 0, 1, 1]
    faint = [replace(range_record(each), share=0.0) for each in scalar_ranges(stage)]
    found = visibility_text(FilmVisibility(1.0, tuple(faint)))
    places = [f"values from 90 to 255 of volume {number}, 0 %" for number in (1, 2)]
    assert found == f"hardly seen: {'; '.join(places)} of what is visible"


def test_projections_have_no_visibility() -> None:
    for mode in ("maximum", "mean"):
        stage = stage_of(mode=mode, transfer_function={"colormap": "gray", "range": [0, 255]})
        assert FrameProber(stage, 32).probe(3, PICTURE).visible == ()


ENDS = ((-np.inf, 50.0, 0.5), (50.0, 180.0, 0.1), (180.0, np.inf, 0.5))
RANGES = [range_record(ScalarRange(low, high, opacity, 0)) for low, high, opacity in ENDS]


def frames_of(*visible: tuple[float, ...]) -> list[FrameRecord]:
    return [FrameRecord(number, 0.1, 1, 1, {}, visible=each) for number, each in enumerate(visible)]


def test_frames_of_a_film_count_alike() -> None:
    found = film_visibility(frames_of((0.1, 0.2, 0.0), (0.3, 0.2, 0.0)), RANGES)
    assert found == FilmVisibility(
        0.4,
        (VisibleRange(0.5, 0.5, None, 50.0), VisibleRange(0.5, 0.1, 50.0, 180.0), VisibleRange(0.0, 0.5, 180.0, None)),
    )
    assert film_visibility(frames_of((0.1, 0.2, 0.0), ()), RANGES) is None
    assert film_visibility(frames_of((0.0, 0.0, 0.0)), RANGES) is None
    assert film_visibility(frames_of(()), []) is None
    noisy = film_visibility(frames_of((0.9, 0.2, 0.1)), RANGES)
    assert noisy is not None and noisy.coverage == 1.0


@pytest.mark.parametrize(
    ("visible", "text"),
    [
        ((0.3, 0.3, 0.3), ""),
        ((0.3, 0.0, 0.3), ""),  # meant to be faint
        ((0.3, 0.3, 0.00123), "hardly seen: values from 180, 0.2 % of what is visible"),
        ((0.0, 0.3, 0.0), "hardly seen: values to 50, 0 %; values from 180, 0 % of what is visible"),
    ],
)
def test_what_is_hidden_is_told(visible: tuple[float, ...], text: str) -> None:
    found = film_visibility(frames_of(visible), RANGES)
    assert found is not None
    assert visibility_text(found) == text


def test_hidden_neighbours_are_one_range() -> None:
    shares = [(0.998, 0, 1), (0.001, 1, 2), (0.001, 2, 3)]
    found = FilmVisibility(0.5, tuple(VisibleRange(share, 0.5, low, high) for share, low, high in shares))
    assert visibility_text(found) == "hardly seen: values from 1 to 3, 0.2 % of what is visible"


def test_hidden_labels_of_a_volume_are_named_together() -> None:
    ranges = [VisibleRange(share, 1.0, name=name, layer=0) for name, share in (("a", 0.0), ("b", 1.0), ("c", 0.001))]
    found = visibility_text(FilmVisibility(0.5, tuple(ranges)))
    assert found == "hardly seen: a, c of volume 1, 0.1 % of what is visible"
