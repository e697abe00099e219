"""Changes that must not change a picture of splats, to the byte where nothing is computed again."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
import pytest
from splatting import cut_of, in_order, look, place_splats, point_at, volume_of

from renderer.draw import SplatRasterizer
from renderer.pyramid import BLOCK_SIZE, Cut, build_pyramid
from renderer.scene import ControlPoint, ErrorSpec, PyramidSpec, SplatSpec, TransferSpec
from renderer.splats import make_splats
from renderer.transfer import make_transfer_function
from renderer.view import View, visible_order
from renderer.volume import Float32

# Blocks that one task of a thread makes.
BLOCKS_PER_TASK = 2048

FOOTPRINTS = ("gaussian", "gouraud")
SHAPE = (9, 8, 11)


@pytest.fixture(scope="module")
def cut() -> Cut:
    """Noise on a ramp, levels mixed."""
    z, y, x = np.indices(SHAPE)
    values = (8 * (x + y + z) + np.random.default_rng(2).integers(0, 40, SHAPE)).astype(np.uint8)
    mixed = cut_of(volume_of(values), 0.7, tolerance=0.25)
    assert len(np.unique(mixed.levels)) >= 3
    return mixed


def view_of(cut: Cut, projection: str = "perspective", **camera: object) -> View:
    return look(projection, **{"target": cut.volume.centre, "distance": 25.0, **camera})  # type: ignore[arg-type]


def draw(gl: SplatRasterizer, cut: Cut, view: View, spec: SplatSpec) -> Float32:
    batch = make_splats(cut, spec)
    return gl.rasterize([batch], [visible_order(batch, view)], view)


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_a_frame_does_not_depend_on_what_was_drawn_before(rasterizer, cut: Cut, footprint: str) -> None:
    """Nor on whose context it is: other size, other footprint, other numbers of splats in between; a fresh context."""
    spec = SplatSpec(footprint)  # type: ignore[arg-type]
    first = draw(rasterizer, cut, view_of(cut), spec)
    assert first[..., 3].max() > 0.9
    assert draw(rasterizer, cut, view_of(cut), spec).tobytes() == first.tobytes()
    for other in FOOTPRINTS:
        draw(rasterizer, cut, view_of(cut, "orthographic", size=(33, 70)), SplatSpec(other))  # type: ignore[arg-type]
        batch = place_splats(np.zeros((5, 3)), 30.0, spec=SplatSpec(other, angular=5))  # type: ignore[arg-type]
        rasterizer.rasterize([batch], [in_order(batch)], look(near=2.0))
    assert draw(rasterizer, cut, view_of(cut), spec).tobytes() == first.tobytes()
    with SplatRasterizer() as fresh:
        assert draw(fresh, cut, view_of(cut), spec).tobytes() == first.tobytes()


# Outside and inside the volume, parallel, and through a wide angle, where footprints are linearised beside the image.
CULLING_VIEWS = {
    "perspective": {"field_of_view": 8.0},
    "orthographic": {"projection": "orthographic", "field_of_view": 8.0},
    "wide": {"distance": 7.0, "field_of_view": 80.0, "target": (12.0, 6.0, 5.0)},
}


@pytest.mark.parametrize("footprint", FOOTPRINTS)
@pytest.mark.parametrize("name", CULLING_VIEWS)
def test_what_is_culled_would_have_left_nothing(rasterizer, cut: Cut, footprint: str, name: str) -> None:
    """Drawn or not, first or last: a splat that `visible_order` leaves out changes no byte."""
    view = view_of(cut, **{"size": (40, 30), **CULLING_VIEWS[name]})  # type: ignore[arg-type]
    images = with_and_without_culled(rasterizer, cut, view, footprint, at_least=20)
    assert images[0][..., 3].max() > 0.5
    for image in images[1:]:
        assert image.tobytes() == images[0].tobytes()


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_splats_beside_the_image_are_culled_by_what_would_be_drawn(rasterizer, cut: Cut, projection: str) -> None:
    """Large opaque ones around a wide angle, whose linearised footprints are larger than their true images."""
    view = view_of(cut, projection, distance=10.0, field_of_view=90.0, size=(160, 120))
    away = np.random.default_rng(4).uniform([-150, -150, 5], [310, 270, 12], (3000, 3))
    batch = place_splats([point_at(view, *point) for point in away], 1.0, 40.0)
    order = visible_order(batch, view)
    culled = np.setdiff1d(in_order(batch), order)
    assert len(culled) > 500
    assert not rasterizer.rasterize([batch], [culled], view).any()


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_what_the_near_plane_culls_would_have_left_next_to_nothing(rasterizer, cut: Cut, footprint: str) -> None:
    """What is cut off further out than a footprint reaches is that share of its optical depth: here at most 4 a cell,
    of up to 4 cells that overlap."""
    batch = make_splats(cut, SplatSpec(footprint))  # type: ignore[arg-type]
    bound = 4 * 4 * 0.5 * math.erfc(batch.footprint.cutoff / math.sqrt(2))
    view = view_of(cut, "orthographic", distance=1.0, size=(40, 30))
    images = with_and_without_culled(rasterizer, cut, view, footprint, at_least=20)
    assert images[0][..., 3].max() > 0.5
    for image in images[1:]:
        np.testing.assert_allclose(image, images[0], rtol=0, atol=bound)


def with_and_without_culled(gl: SplatRasterizer, cut: Cut, view: View, footprint: str, at_least: int) -> list[Float32]:
    """The picture of what `visible_order` keeps, and with the rest before it and after it."""
    batch = make_splats(cut, SplatSpec(footprint))  # type: ignore[arg-type]
    order = visible_order(batch, view)
    culled = np.setdiff1d(in_order(batch), order)
    assert len(culled) >= at_least
    orders = order, np.concatenate([culled, order]), np.concatenate([order, culled])
    return [gl.rasterize([batch], [each], view) for each in orders]


@pytest.mark.parametrize("footprint", FOOTPRINTS)
@pytest.mark.parametrize("batch_size", [1, 7])
def test_batches_of_any_size_draw_the_same(rasterizer, cut: Cut, monkeypatch, footprint: str, batch_size: int) -> None:
    spec = SplatSpec(footprint)  # type: ignore[arg-type]
    whole = draw(rasterizer, cut, view_of(cut), spec)
    monkeypatch.setattr("renderer.draw.splats.splat_rasterizer.BATCH_SIZE", batch_size)
    assert draw(rasterizer, cut, view_of(cut), spec).tobytes() == whole.tobytes()


@pytest.mark.parametrize("footprint", FOOTPRINTS)
def test_nothing_to_draw_is_transparent_black(rasterizer: SplatRasterizer, cut: Cut, footprint: str) -> None:
    spec = SplatSpec(footprint)  # type: ignore[arg-type]
    empty = cut_of(volume_of(np.zeros(SHAPE, np.uint8)), 0.7)
    assert len(empty) == 0
    draw(rasterizer, cut, view_of(cut), spec)
    image = draw(rasterizer, empty, view_of(empty), spec)
    assert image.shape == (48, 64, 4)
    assert not image.any()
    batch = make_splats(cut, spec)
    assert not rasterizer.rasterize([batch], [in_order(batch)[:0]], view_of(cut)).any()


def test_equal_depths_are_drawn_in_the_order_of_their_cells() -> None:
    """Seen along an axis whole layers are at one depth, also far from the world's origin and from the eye."""
    cut = cut_of(volume_of(np.full((4, 5, 6), 200, np.uint8)), 0.5)
    batch = make_splats(cut, SplatSpec())
    for projection, distance in (("orthographic", 50.0), ("orthographic", 1e9), ("perspective", 1e6)):
        view = view_of(cut, projection, distance=distance, azimuth=0, elevation=0, field_of_view=60)
        order = visible_order(batch, view)
        np.testing.assert_array_equal(order, np.lexsort((np.arange(len(cut)), -cut.cells[:, 1])))


@pytest.mark.parametrize("measure", ["optical", "rms"])
def test_a_pyramid_does_not_depend_on_the_number_of_threads(measure: Literal["optical", "rms"]) -> None:
    """Several tasks of blocks, of which the last is not full."""
    values = np.random.default_rng(1).integers(0, 256, (97, 161, 170), np.uint8)
    values[:, 40:90] = 0
    points = ControlPoint(60.0, (0.1, 0.5, 0.9), 0.0), ControlPoint(255.0, (1.0, 0.3, 0.1), 0.7)
    volume, transfer = volume_of(values), make_transfer_function(TransferSpec(points), 1.0)
    pyramids = [
        build_pyramid(volume, transfer, spec=PyramidSpec(), error=ErrorSpec(measure=measure), num_threads=num_threads)
        for num_threads in (1, 2, 3)
    ]
    assert -(-97 // BLOCK_SIZE) * -(-161 // BLOCK_SIZE) * -(-170 // BLOCK_SIZE) > 2 * BLOCKS_PER_TASK
    for pyramid in pyramids[1:]:
        for level, expected in zip(pyramid.levels, pyramids[0].levels, strict=True):
            for array, expected_array in zip(level, expected, strict=True):
                assert array.tobytes() == expected_array.tobytes()
