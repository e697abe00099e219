"""Draw with masks, and colour the masks at the end, in whole numbers: the same bytes on every machine."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.scene import Color
from renderer.transfer import linear_of_srgb
from renderer.volume import Float32, UInt8

# The largest number of pixels of a drawing. No picture has more pixels.
_MAX_PIXELS = 2**28
# The number of samples along each side of a pixel by which a polygon is drawn, so that its edges are smooth.
_SAMPLES = 4
# The opacity of a rim where it meets the drawing, from 0 to 255; outwards, it fades.
_RIM = 190


class Patch(NamedTuple):
    """A patch: a small picture that is put over a frame's picture.

    rgba: premultiplied RGBA, float32 [h, w, 4]. row, column: the place of the first pixel of the patch in the picture.
    """

    rgba: Float32
    row: int
    column: int


class Sketch:
    """A drawing that grows to the right and down as it is drawn on.

    ink: the mask of everything that gets the entry's colour, uint8 [h, w]. paint: a picture over the ink, with its own
        colours, as premultiplied RGBA, uint8 [h, w, 4].
    """

    def __init__(self) -> None:
        """Begin with an empty drawing."""
        self.ink, self.paint = np.zeros((0, 0), np.uint8), np.zeros((0, 0, 4), np.uint8)

    @property
    def height(self) -> int:
        """Return the number of rows of the drawing, in pixels."""
        return self.ink.shape[0]

    @property
    def width(self) -> int:
        """Return the number of columns of the drawing, in pixels."""
        return self.ink.shape[1]

    def draw(self, mask: UInt8, row: int, column: int) -> None:
        """Add a mask, uint8 [h, w], to the ink. row, column: the place of the mask's first pixel in the drawing."""
        part = self._part(row, column, *mask.shape)
        self.ink[part] = np.maximum(self.ink[part], mask)

    def fill(self, row: int, column: int, height: int, width: int) -> None:
        """Add a filled rectangle to the ink."""
        self.draw(np.full((height, width), 255, np.uint8), row, column)

    def color(self, mask: UInt8, color: Color, row: int, column: int) -> None:
        """Paint a mask in a colour, over the paint that is there."""
        part = self._part(row, column, *mask.shape)
        self.paint[part] = _over(self.paint[part], _colored(mask, color))

    def erase(self, mask: UInt8, row: int, column: int) -> None:
        """Take paint away where a mask is above 0; all of it where the mask is 255."""
        part = self._part(row, column, *mask.shape)
        self.paint[part] = self.paint[part] * (255 - mask[..., None].astype(np.uint32)) // 255

    def _part(self, row: int, column: int, height: int, width: int) -> tuple[slice, slice]:
        """Return the slices of a rectangle in the drawing, which is enlarged if it does not hold the rectangle.

        Raises InputError if the drawing would have more than _MAX_PIXELS.
        """
        more = max(row + height - self.height, 0), max(column + width - self.width, 0)
        if any(more):
            require_room(self.height + more[0], self.width + more[1])
            self.ink, self.paint = grown(self.ink, 0, *more), grown(self.paint, 0, *more)
        return slice(row, row + height), slice(column, column + width)

    def finish(self, color: Color, rim: int) -> Float32:
        """Return the drawing in a colour, with a rim of `rim` pixels: float32 [h + 2 rim, w + 2 rim, 4].

        The rim is black around a light colour and white around a dark one, so that the drawing is readable over any
        picture.
        """
        opposite = (0.0, 0.0, 0.0) if is_light(color) else (1.0, 1.0, 1.0)
        ink, paint = (grown(each, rim, rim) for each in (self.ink, self.paint))
        layers = _over(_colored(widen(np.maximum(ink, paint[..., 3]), rim), opposite), _colored(ink, color))
        return np.asarray(_over(layers, paint) / np.float32(255), np.float32)


def require_room(height: int, width: int) -> None:
    """Raise InputError if a drawing of this size would have more than _MAX_PIXELS."""
    if height * width > _MAX_PIXELS:
        raise InputError("does not fit into the picture", got=f"{width} x {height} pixels", expected="a smaller size")


def is_light(color: Color) -> bool:
    """Return whether a colour is so light that black is more readable on it than white."""
    red, green, blue = color
    return 0.299 * red + 0.587 * green + 0.114 * blue > 0.5


def _colored(mask: UInt8, color: Color) -> UInt8:
    """Return a mask in a colour: premultiplied RGBA, uint8 [h, w, 4]."""
    whole = np.array([*(round(255 * part) for part in color), 255], np.uint32)
    return np.asarray((mask[..., None] * whole + 127) // 255, np.uint8)


def _over(below: UInt8, above: UInt8) -> UInt8:
    """Return the picture `above` composited over the picture `below`, both premultiplied RGBA, uint8 [h, w, 4]."""
    rest = 255 - above[..., 3:].astype(np.uint32)
    return np.asarray(above + (below * rest + 127) // 255, np.uint8)


def widen(mask: UInt8, rim: int) -> UInt8:
    """Return a mask that is wider by `rim` pixels on each side, and softer there."""
    (height, width), padded, side = mask.shape, grown(mask, rim, rim), (rim + 1) ** 2
    by_weight: dict[int, UInt8] = {}
    for down in range(2 * rim + 1):
        for across in range(2 * rim + 1):
            weight = max(_RIM * (side - (down - rim) ** 2 - (across - rim) ** 2) // side, 0)
            part = padded[down : down + height, across : across + width]
            by_weight[weight] = np.maximum(by_weight.get(weight, part), part)
    # The maximum of all neighbours with one weight is taken before it is weighted, because a multiplication is much
    # slower than a comparison.
    scaled = [(np.arange(256) * weight // 255).astype(np.uint8)[part] for weight, part in by_weight.items()]
    return np.asarray(np.maximum.reduce(scaled))


def grown(array: UInt8, before: int, after: int, across: int | None = None) -> UInt8:
    """Return an array with zeros around it.

    before: the number of rows above the array, and of columns to its left. after: the number of rows below the array,
    and of columns to its right. across: the number of columns to its right, if it is not `after`.
    """
    more = before + (after if across is None else across)
    larger = np.zeros((len(array) + before + after, array.shape[1] + more, *array.shape[2:]), np.uint8)
    larger[before : before + len(array), before : before + array.shape[1]] = array
    return larger


def polygon(corners: Sequence[tuple[float, float]]) -> tuple[UInt8, int, int]:
    """Return the mask of a convex polygon, uint8 [h, w], and the row and the column of the mask's first pixel.

    corners: the corners (x, y) of the polygon, in pixels.
    """
    points = np.array([[round(2 * _SAMPLES * part) for part in corner] for corner in corners])
    left, top = (points.min(axis=0) // (2 * _SAMPLES)).tolist()
    width, height = (points.max(axis=0) // (2 * _SAMPLES) + 1 - (left, top)).tolist()
    # x, y: the centres of the samples, in units of half a sample's width.
    x, y = (2 * _SAMPLES * first + 2 * np.arange(_SAMPLES * num) + 1 for first, num in ((left, width), (top, height)))
    sides = [
        (end[0] - start[0]) * (y[:, None] - start[1]) - (end[1] - start[1]) * (x - start[0])
        for start, end in zip(points, np.roll(points, -1, axis=0), strict=True)
    ]
    inside = (np.minimum.reduce(sides) >= 0) | (np.maximum.reduce(sides) <= 0)
    counts = inside.reshape(height, _SAMPLES, width, _SAMPLES).sum(axis=(1, 3))
    return np.asarray(counts * 255 // _SAMPLES**2, np.uint8), top, left


def draw_annotation(image: Float32, patches: Sequence[Patch], *, is_linear: bool = False) -> None:
    """Put patches over a picture, which is changed in place.

    image: premultiplied RGBA, float32 [h, w, 4]. is_linear: whether it is linear light.
    """
    for rgba, row, column in patches:
        # The rim of an entry near the picture's edge may reach beyond the edge.
        top, left = max(-row, 0), max(-column, 0)
        part = image[row + top : row + len(rgba), column + left : column + rgba.shape[1]]
        above = rgba[top : top + part.shape[0], left : left + part.shape[1]]
        part *= 1 - above[..., 3:]
        part += _in_linear_light(above) if is_linear else above


def _in_linear_light(rgba: Float32) -> Float32:
    """Return a patch in linear light, premultiplied RGBA as before."""
    alpha = rgba[..., 3:]
    straight = np.divide(rgba[..., :3], alpha, out=np.zeros_like(rgba[..., :3]), where=alpha > 0)
    return np.concatenate([alpha * linear_of_srgb(straight), alpha], axis=2).astype(np.float32)
