"""The overlay: which edges there are, and that they are drawn as an independent float64 drawing has them."""

from __future__ import annotations

import itertools
from collections import Counter

import numpy as np
import pytest
from splatting import cut_of, look, volume_of

from renderer.bricks import BRICK_LEVELS, BrickCut
from renderer.draw import CellEdges, GLRasterizer, make_edges
from renderer.draw.constants import LEVEL_COLORS, LINE_COVER, LINE_OPACITY, MIN_SIDE_PX
from renderer.pyramid import Cut
from renderer.view import View

# Positions are float32: a vertex is 1e-5 px off on these images and alpha as much, once for each line at a pixel.
PRECISION = 2e-4


@pytest.fixture(scope="module")
def cut() -> Cut:
    """Cells of several levels in a volume of 5 x 4 x 3 voxels, whose border cuts some; one corner is empty."""
    values = np.full((3, 4, 5), 150, np.uint8)
    values[0, 0, 0] = 255
    values[2, 2:, 2:] = 0
    return cut_of(volume_of(values), 0.9, tolerance=0.3)


def boxes(cut: Cut) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """Level, low and high corner of each cell in world units, level by level as the cut has them."""
    shape, edges = np.array(cut.volume.shape_xyz), cut.volume.world_from_index[:3, :3]
    found = []
    for level, cell in zip(cut.levels.tolist(), cut.cells, strict=True):
        low, high = cell * 2**level, np.minimum((cell + 1) * 2**level, shape)
        place = cut.volume.world_from_index[:3, 3]
        found.append((level, edges @ (low - 0.5) + place, edges @ (high - 0.5) + place))
    return found


def edges_of_boxes(cut: Cut) -> set[tuple[int, tuple[float, ...], tuple[float, ...]]]:
    """Every edge of every cell once: level and both ends, world units."""
    found = set()
    for level, low, high in boxes(cut):
        corners = list(itertools.product(*zip(low, high, strict=True)))
        for a, b in itertools.combinations(corners, 2):
            if sum(x != y for x, y in zip(a, b, strict=True)) == 1:
                found.add((level, tuple(np.round(a, 5)), tuple(np.round(b, 5))))
    return found


def in_world(edges: CellEdges) -> list[tuple[int, tuple[float, ...], tuple[float, ...]]]:
    return [
        (int(v[6]), *(tuple(np.round(edges.origin + edges.model_unit * v[k : k + 3].astype(float), 5)) for k in (0, 3)))
        for v in edges.vertices
    ]


def test_every_edge_of_every_cell_is_there_once(cut: Cut) -> None:
    assert {0, 1} <= set(cut.levels.tolist())
    there = in_world(make_edges(cut))
    assert Counter(there) == Counter(edges_of_boxes(cut))
    assert [level for level, _, _ in there] == sorted((level for level, _, _ in there), reverse=True)


def test_edges_of_bricks_are_those_of_their_nodes_in_the_colours_of_their_cells() -> None:
    volume = volume_of(np.zeros((20, 40, 70), np.uint8))
    levels = np.array([1, 0, 0], np.uint8)
    cells = np.array([[1, 0, 0], [0, 0, 0], [1, 2, 1]], np.int32)
    cut = BrickCut(levels, cells, np.zeros((3, 2, 3)), np.zeros(3), volume)
    nodes = Cut(levels + np.uint8(BRICK_LEVELS), cells, np.zeros((3, 4), np.float32), volume)
    found, expected = make_edges(cut), make_edges(nodes)
    np.testing.assert_array_equal(found.vertices[:, :6], expected.vertices[:, :6])
    np.testing.assert_array_equal(found.vertices[:, 6], expected.vertices[:, 6] - BRICK_LEVELS)
    sides = (each.voxel_side * 2.0 ** each.vertices[:, 6] for each in (found, expected))
    np.testing.assert_allclose(*sides)


def test_an_empty_cut_has_no_edges(rasterizer: GLRasterizer) -> None:
    nothing = cut_of(volume_of(np.zeros((2, 2, 2), np.uint8)), 0.5)
    edges = make_edges(nothing)
    assert len(edges) == 0
    assert not rasterizer.rasterize_edges(edges, look()).any()


def draw_reference(edges: CellEdges, view: View) -> np.ndarray:
    """float64 [h, w, 4]: one line after the other over all pixels, clipped to the eye's side, in world units."""
    width, height = view.size
    x, y = np.meshgrid(np.arange(width) + 0.5, np.arange(height) + 0.5)
    image = np.zeros((height, width, 4))
    is_perspective = view.projection == "perspective"
    for vertex in edges.vertices.astype(np.float64):
        level = int(vertex[6])
        side = edges.voxel_side * 2**level
        ends = []
        for k in (0, 3):
            world = edges.origin + edges.model_unit * vertex[k : k + 3]
            ends.append(view.view_from_world(world))
        nearest = max(view.near, 1e-5 * edges.model_unit) if is_perspective else view.near
        ends.sort(key=lambda point: point[2])  # the farther one first
        far, close = ends
        if -far[2] <= nearest:
            continue
        if -close[2] < nearest:
            close = far + (close - far) * ((nearest + far[2]) / (far[2] - close[2]))
        px_per_unit = view.scale_px / (np.array([-far[2], -close[2]]) if is_perspective else np.ones(2))
        a, b = (
            np.array([width / 2 + scale * p[0], height / 2 - scale * p[1]])
            for p, scale in zip((far, close), px_per_unit, strict=True)
        )
        offset = np.stack([x, y], axis=-1) - a
        share = np.clip(offset @ (b - a) / max((b - a) @ (b - a), 1e-30), 0, 1)
        distance = np.linalg.norm(offset - share[..., None] * (b - a), axis=-1)
        side_px = side * edges.model_unit * ((1 - share) * px_per_unit[0] + share * px_per_unit[1])
        alpha = np.clip(1 - distance, 0, 1) * np.minimum(LINE_COVER * side * side_px, LINE_OPACITY)
        alpha *= side_px >= MIN_SIDE_PX
        color = LEVEL_COLORS[min(level, len(LEVEL_COLORS) - 1)]
        image = image * (1 - alpha[..., None]) + alpha[..., None] * np.append(color, 1)
    return image


VIEWS = {
    "perspective": look(distance=14),
    "orthographic": look("orthographic", distance=9),
    "cut by the near plane": look("orthographic", distance=9, near=9.3, azimuth=5),
    "along an axis": look("orthographic", distance=12, azimuth=0, elevation=0),
    "from inside": look(distance=0.6, field_of_view=80),
    "from inside, cut by the near plane": look(distance=0.6, field_of_view=80, near=0.5),
    "small": look(distance=60),
}


@pytest.mark.parametrize("name", VIEWS)
def test_lines_are_where_they_should_be(rasterizer: GLRasterizer, cut: Cut, name: str) -> None:
    edges = make_edges(cut)
    image = rasterizer.rasterize_edges(edges, VIEWS[name])
    assert np.abs(image - draw_reference(edges, VIEWS[name])).max() < PRECISION
    assert image[..., 3].max() > 0.1


@pytest.mark.parametrize("batch_bytes", [32, 7 * 28])
def test_batches_leave_no_trace(
    rasterizer: GLRasterizer, cut: Cut, monkeypatch: pytest.MonkeyPatch, batch_bytes: int
) -> None:
    edges, view = make_edges(cut), look(distance=14)
    whole = rasterizer.rasterize_edges(edges, view)
    monkeypatch.setattr("renderer.draw.gl.raster.BATCH_SIZE", 1)
    monkeypatch.setattr("renderer.draw.gl.raster.VERTEX_BYTES", batch_bytes)
    assert rasterizer.rasterize_edges(edges, view).tobytes() == whole.tobytes()


def test_colors_are_ordered_and_legible_on_black_and_on_white() -> None:
    linear = np.where((c := np.array(LEVEL_COLORS)) <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance) < 0).all()
    assert ((luminance + 0.05) / 0.05).min() > 3
    assert (1.05 / (luminance + 0.05)).min() > 2.9
