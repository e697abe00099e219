"""Draw the lines of an overlay over a picture, compiled.

A line is one pixel wide: its opacity falls linearly to 0 at one pixel from its centre, round at the ends.
"""

from __future__ import annotations

import math

import numpy as np

from renderer.compiled import jit
from renderer.draw.overlay import Lines
from renderer.view import ModelView, View, model_view
from renderer.volume import Float32, Float64

# An end of a line that is nearer to the eye plane is not divided by its depth.
MIN_LINE_DEPTH = 1e-5
# Where cells have a side of s model units and of p pixels, up to 2 / s of them lie behind one another, and the lines of
# one layer cover about 2 / p of the image: together they are a fog. Therefore a line's opacity is LINE_COVER * s * p,
# at most LINE_OPACITY, which bounds the total for cells of any size. Cells under MIN_SIDE_PX have no lines.
LINE_COVER, LINE_OPACITY, MIN_SIDE_PX = 0.75, 0.8, 3.0
# Colours of lines by level, the finest first, the last for all levels beyond: from orange to blue in even steps of
# lightness (CIE L* 62 to 41) and hue, as saturated as sRGB allows. The contrast to black and to white is at least 3
# (WCAG 2.2, 1.4.11, for graphics), except 2.97 of level 0 to white.
LEVEL_COLORS = tuple(
    tuple(channel / 255 for channel in bytes.fromhex(color))
    for color in ("ed730c", "f95b30", "fe414c", "fb2767", "f01483", "dc1e9f", "be33b8", "9446cd", "5354dc", "055ebf")
)


def draw_lines(lines: Lines, view: View, image: Float32) -> None:
    """Draw lines over an image, one over the other in their order: float32 [height, width, 4], premultiplied RGBA."""
    camera = model_view(lines, view)
    if camera.perspective:
        camera = camera._replace(near=max(camera.near, MIN_LINE_DEPTH))
    vertices = lines.vertices[: _num_large_enough(lines, camera)]
    _draw_lines(vertices, lines.voxel_side, np.insert(LEVEL_COLORS, 3, 1.0, axis=1), camera, image)


def _num_large_enough(lines: Lines, camera: ModelView) -> int:
    """Return how many of the first lines may belong to cells of MIN_SIDE_PX or more; the model's radius is 1."""
    eye_distance = float(np.linalg.norm(camera.view_from_model[:, 3]))
    nearest = max(eye_distance - 1, camera.near) if camera.perspective else 1.0
    sides_px = lines.voxel_side * np.exp2(lines.vertices[:, 6]) * (camera.scale_px / nearest)
    return int(np.count_nonzero(sides_px >= MIN_SIDE_PX))


@jit
def _draw_lines(vertices: Float32, voxel_side: float, colors: Float64, camera: ModelView, image: Float32) -> None:
    """Project lines, less what is nearer than the near plane, and draw them. colors: float64 [n, 4], by level."""
    m, ends, ends_px = camera.view_from_model, np.empty((2, 3)), np.empty((2, 3))
    for i in range(len(vertices)):
        for k in range(2):
            x, y, z = vertices[i, 3 * k], vertices[i, 3 * k + 1], vertices[i, 3 * k + 2]
            for row in range(3):
                ends[k, row] = m[row, 0] * x + m[row, 1] * y + m[row, 2] * z + m[row, 3]
        beyond = -ends[:, 2] - camera.near
        if max(beyond[0], beyond[1]) <= 0.0:
            continue
        for k in range(2):
            if beyond[k] < 0.0:
                ends[k] += (ends[1 - k] - ends[k]) * (beyond[k] / (beyond[k] - beyond[1 - k]))
            scale = camera.scale_px / -ends[k, 2] if camera.perspective else camera.scale_px
            ends_px[k, 0] = 0.5 * camera.size[0] + scale * ends[k, 0]
            ends_px[k, 1] = 0.5 * camera.size[1] - scale * ends[k, 1]
            ends_px[k, 2] = scale
        level = int(vertices[i, 6])
        _draw_line(ends_px, voxel_side * 2.0**level, colors[min(level, len(colors) - 1)], image)


@jit
def _draw_line(ends_px: Float64, side: float, color: Float64, image: Float32) -> None:
    """Draw a line. ends_px: float64 [2, 3], column and row, and pixels per model unit there. side: of its cell."""
    height, width = image.shape[:2]
    x, y, scale = ends_px[0]
    along_x, along_y, scale_change = ends_px[1] - ends_px[0]
    square = along_x * along_x + along_y * along_y
    first, last = _pixels_near(y, y + along_y, height)
    for row in range(first, last):
        offset_y = row + 0.5 - y
        # The part of the line that is less than a pixel above or below.
        shares = (0.0, 1.0)
        if along_y != 0.0:
            shares = (_clamp((offset_y - 1.0) / along_y), _clamp((offset_y + 1.0) / along_y))
        left, right = _pixels_near(x + shares[0] * along_x, x + shares[1] * along_x, width)
        for column in range(left, right):
            offset_x = column + 0.5 - x
            share = _clamp((offset_x * along_x + offset_y * along_y) / square) if square > 0.0 else 0.0
            coverage = 1.0 - math.hypot(offset_x - share * along_x, offset_y - share * along_y)
            side_px = side * (scale + share * scale_change)  # inverse depth is linear on the image
            if coverage > 0.0 and side_px >= MIN_SIDE_PX:
                alpha = coverage * min(LINE_COVER * side * side_px, LINE_OPACITY)
                for channel in range(4):
                    image[row, column, channel] += alpha * (color[channel] - image[row, column, channel])


@jit
def _clamp(share: float) -> float:
    return min(max(share, 0.0), 1.0)


@jit
def _pixels_near(one_end: float, other_end: float, size: int) -> tuple[int, int]:
    """Return the half-open range of pixels, of `size` in a row or column, that a line between two places may touch."""
    low, high = math.floor(min(one_end, other_end) - 1.0), math.ceil(max(one_end, other_end) + 1.0)
    return int(max(low, 0)), int(min(high, size))
