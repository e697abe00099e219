"""Overlays: which lines there are, and that they are drawn as an independent float64 drawing has them."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from film_stages import PLAIN, stage_of
from splatting import cut_of, look, volume_of

from renderer.bricks import BRICK_LEVELS, BrickCut
from renderer.draw import Lines, Rasterizer, draw_lines, make_edges, make_outline, tick_step
from renderer.frame import render_frames, view_of
from renderer.pyramid import Cut
from renderer.scene import AnnotationSpec, ClipSpec, ModeSpec, PlaneSpec, Scene, SplatSpec
from renderer.view import View
from renderer.volume import make_volume

# Cells of a smaller side, in pixels, have no lines.
MIN_SIDE_PX = 3.0

LINE_OPACITY = 0.8

# The opacity of lines: this share of the side of their cell in pixels, and at most LINE_OPACITY.
LINE_COVER = 0.75

# The colours of cells, from the finest level on.
LEVEL_COLORS = tuple(
    tuple(channel / 255 for channel in bytes.fromhex(color))
    for color in ("ed730c", "f95b30", "fe414c", "fb2767", "f01483", "dc1e9f", "be33b8", "9446cd", "5354dc", "055ebf")
)

# Each line at a pixel is rounded to float32.
PRECISION = 1e-5


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


def in_world(edges: Lines) -> list[tuple[int, tuple[float, ...], tuple[float, ...]]]:
    return [
        (int(v[6]), *(tuple(np.round(edges.origin + edges.model_unit * v[k : k + 3].astype(float), 5)) for k in (0, 3)))
        for v in edges.vertices
    ]


def test_every_edge_of_every_cell_is_there_once(cut: Cut) -> None:
    assert {0, 1} <= set(cut.levels.tolist())
    there = in_world(make_edges(cut, 0))
    assert Counter(there) == Counter(edges_of_boxes(cut))
    assert [level for level, _, _ in there] == sorted((level for level, _, _ in there), reverse=True)


def test_edges_of_bricks_are_those_of_their_nodes_in_the_colours_of_their_cells() -> None:
    volume = volume_of(np.zeros((20, 40, 70), np.uint8))
    levels = np.array([1, 0, 0], np.uint8)
    cells = np.array([[1, 0, 0], [0, 0, 0], [1, 2, 1]], np.int32)
    cut = BrickCut(levels, cells, np.zeros((3, 2, 3)), np.zeros(3), volume)
    nodes = Cut(levels + np.uint8(BRICK_LEVELS), cells, np.zeros((3, 4), np.float32), volume)
    found, expected = make_edges(cut, BRICK_LEVELS), make_edges(nodes, 0)
    np.testing.assert_array_equal(found.vertices[:, :6], expected.vertices[:, :6])
    np.testing.assert_array_equal(found.vertices[:, 6], expected.vertices[:, 6] - BRICK_LEVELS)
    sides = (each.voxel_side * 2.0 ** each.vertices[:, 6] for each in (found, expected))
    np.testing.assert_allclose(*sides)


def drawn(lines: Lines, view: View) -> np.ndarray:
    """The lines over nothing: float32 [h, w, 4]."""
    image = np.zeros((view.size[1], view.size[0], 4), np.float32)
    draw_lines(lines, view, image)
    return image


def test_an_empty_cut_has_no_edges() -> None:
    nothing = cut_of(volume_of(np.zeros((2, 2, 2), np.uint8)), 0.5)
    edges = make_edges(nothing, 0)
    assert len(edges) == 0
    assert not drawn(edges, look()).any()


def draw_reference(edges: Lines, view: View) -> np.ndarray:
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
def test_lines_are_where_they_should_be(cut: Cut, name: str) -> None:
    edges = make_edges(cut, 0)
    image = drawn(edges, VIEWS[name])
    assert np.abs(image - draw_reference(edges, VIEWS[name])).max() < PRECISION
    assert image[..., 3].max() > 0.1


@pytest.mark.parametrize("side", [*np.geomspace(1e-7, 3e7, 80), 0.4, 4.0, 5.0, 10.0, 20.0, 1e5])
def test_ticks_are_few_and_round(side: float) -> None:
    step = tick_step(side)
    mantissa = step / 10 ** math.floor(math.log10(step) + 1e-9)
    assert any(math.isclose(mantissa, round_number) for round_number in (1, 2, 5))
    assert 4 <= sum(number * step < side * (1 - 1e-6) for number in range(1, 20)) < 10


def test_the_outline_is_that_of_the_box_with_ticks_at_round_distances() -> None:
    """A box of 35 x 9 x 4 in a skewed world: ticks at 5, 10, ... along its first axis and at 5 along the second."""
    world_from_index = np.eye(4)
    world_from_index[:3, :3] = np.array([[3.0, 4.0, 0.0], [-4.0, 3.0, 0.0], [3.0, 0.0, 4.0]]).T / 5
    world_from_index[:3, 3] = 7, -2, 30
    volume = make_volume(np.zeros((4, 9, 35), np.uint8), world_from_index, "skewed")
    outline = make_outline(volume)
    ends = outline.vertices[:, :6].reshape(-1, 2, 3) * outline.model_unit + outline.origin
    a, b = np.moveaxis((ends - world_from_index[:3, 3]) @ np.linalg.inv(world_from_index[:3, :3]).T + 0.5, 1, 0)
    lengths = np.abs(b - a).max(axis=1)
    assert (np.sum(np.abs(b - a) > 1e-4, axis=1) == 1).all()
    edges, strokes = lengths > 2, lengths < 2
    corners = np.stack(np.meshgrid([0, 35], [0, 9], [0, 4], indexing="ij"), axis=-1).reshape(-1, 3)
    expected = {(*p, *q) for p in corners for q in corners if np.sum(p != q) == 1 and (p <= q).all()}
    assert Counter(map(tuple, np.round(np.column_stack([a, b])[edges], 3))) == Counter(expected)
    marks = [(5 * k, 0, 0) for k in range(1, 7)] + [(0, 5, 0)]
    assert Counter(map(tuple, np.round(a[strokes], 3))) == Counter(2 * marks)
    is_long = a[strokes][:, 0].round() == 25
    np.testing.assert_allclose(lengths[strokes], np.where(is_long, 0.04, 0.02) * 35, rtol=1e-4)


@pytest.mark.parametrize("projection", ["perspective", "orthographic"])
def test_the_outline_has_one_opacity(projection: str) -> None:
    view = look(projection, distance=60, size=(300, 200))
    outline = make_outline(volume_of(np.zeros((3, 4, 5), np.uint8)))
    image = drawn(outline, view)
    assert np.abs(image - draw_reference(outline, view)).max() < PRECISION
    assert image[..., 3].max() > 0.7 * LINE_OPACITY
    np.testing.assert_allclose(image[..., :3], image[..., 3:] * np.array(LEVEL_COLORS[1]), atol=1e-6)


@pytest.mark.parametrize(
    "changes",
    [{"mode": ModeSpec("maximum")}, {"mode": ModeSpec("minimum")}, {"mode": ModeSpec("maximum", color_by="depth")},
        {"mode": ModeSpec("mean")}, {"clip": (ClipSpec(PlaneSpec((15.0, 13.0, 9.0), (0.0, 0.0, 1.0))),)},
        {"splat": SplatSpec("gaussian")}],
)  # fmt: skip
def test_the_outline_is_drawn_over_any_picture(
    rasterizer_for: Callable[[Scene], Rasterizer], changes: dict[str, Any]
) -> None:
    scene = replace(PLAIN, camera=replace(PLAIN.camera, distance=90.0), **changes)
    (below,), (above,) = (
        render_frames(stage_of(each), [1], rasterizer_for(each), clock=itertools.count().__next__)
        for each in (scene, replace(scene, annotation=AnnotationSpec(bounds=True)))
    )
    stage = stage_of(scene)
    expected = below.radiance.copy()
    draw_lines(make_outline(stage.layers[0].volume), view_of(stage, 1), expected)
    np.testing.assert_array_equal(above.image, below.image)
    np.testing.assert_array_equal(above.radiance_with_lines(), expected)
    assert 100 < (expected != below.radiance).any(axis=2).sum() < 1000


def test_colors_are_ordered_and_legible_on_black_and_on_white() -> None:
    linear = np.where((c := np.array(LEVEL_COLORS)) <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(luminance) < 0).all()
    assert ((luminance + 0.05) / 0.05).min() > 3
    assert (1.05 / (luminance + 0.05)).min() > 2.9
