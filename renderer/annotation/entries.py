"""Draw each entry of an annotation, as a sketch."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from renderer.annotation.facts import AnnotationFacts, ColorBar, FrameFacts
from renderer.annotation.numbers import find_ticks, length_text, plain_text, round_below
from renderer.annotation.sketch import Sketch, grown, polygon, widen
from renderer.annotation.text import Font
from renderer.errors import InputError
from renderer.scene import Color, ColorBarSpec, EntrySpec, LogoSpec, Vector, fill_format, require_file
from renderer.volume import UInt8

# The smallest height of text in a picture, in pixels.
MIN_TEXT_PX = 9
# The largest number of names in a legend. If there are more names, a further row says how many are missing.
MAX_LEGEND_ROWS = 24
# The greatest length of a scale bar, as a share of the picture's width.
_MAX_BAR = 0.2
# The text size of the words "at the target" at a scale bar, as a share of the text size of the bar's length.
_SMALL = 0.75
# The smallest side of the square in which the arrows along the world's axes are drawn, in pixels: letters of
# MIN_TEXT_PX have room in it.
MIN_TRIAD_PX = 52
# The opacity with which a color bar's profile of opacities is drawn, from 0 to 255.
_PROFILE = 150
# The file formats of logos, by their names in Pillow.
_LOGO_FORMATS = ("PNG", "JPEG", "WEBP")
# The largest number of pixels in the file of a logo.
_MAX_LOGO_PIXELS = 64 * 2**20
# The largest ratio of width to height of a logo.
_MAX_LOGO_RATIO = 50
# The letters of directions to which no arrow points (left, posterior, inferior), each with the letter of the opposite
# direction, to which the arrow of this axis points.
_OPPOSITE = {"L": "R", "P": "A", "I": "S"}
# The colours of the arrows along the world's x, y and z axes.
_AXIS_COLORS: tuple[Color, ...] = ((0.95, 0.32, 0.30), (0.30, 0.75, 0.35), (0.30, 0.55, 1.0))


@dataclass(frozen=True)
class Pen:
    """The font and the facts about the film with which all entries of an annotation are drawn."""

    font: Font
    facts: AnnotationFacts

    def px(self, share: float) -> int:
        """Return a share of the picture's height in pixels, at least MIN_TEXT_PX."""
        return max(round(share * self.facts.size[1]), MIN_TEXT_PX)


def draw_text(_: EntrySpec, pen: Pen, px: int, text: str) -> Sketch:
    """Draw a line of text."""
    whole = Sketch()
    if text:
        whole.draw(pen.font.line(text, px).mask, 0, 0)
    return whole


def draw_scale_bar(spec: EntrySpec, pen: Pen, px: int, world_per_pixel: float) -> Sketch:
    """Draw a scale bar of a round length, with the length above it; in perspective, it holds at the camera's target."""
    length = _bar_length(pen, world_per_pixel)
    width, whole = max(round(float(length) / world_per_pixel), 1), Sketch()
    line = pen.font.line(length_text(length, pen.facts.unit), px)
    whole.draw(line.mask, 0, 0)
    if pen.facts.is_perspective:
        small = pen.font.line("at the target", max(round(_SMALL * px), MIN_TEXT_PX))
        whole.draw(small.mask, line.baseline - small.baseline, whole.width + px // 3)
    left = max(whole.width - width, 0) if spec.position.endswith("right") else 0
    whole.fill(line.baseline + max(2, px // 4), left, max(2, px // 6), width)
    return whole


def _bar_length(pen: Pen, world_per_pixel: float) -> Decimal:
    return round_below(_MAX_BAR * pen.facts.size[0] * world_per_pixel)


def draw_color_bars(spec: ColorBarSpec, pen: Pen, px: int, _: object) -> Sketch:
    """Draw the color bars of all layers, or of one layer, side by side."""
    bars = [bar for bar in pen.facts.bars if spec.layer in (None, bar.layer)]
    if not bars:
        raise InputError("no colours of a scalar", expected="a transfer function of values")
    whole = Sketch()
    for number, bar in enumerate(bars):
        _draw_color_bar(whole, whole.width + round(1.4 * px) * (number > 0), spec, pen, px, bar)
    return whole


def draw_legend(_: EntrySpec, pen: Pen, px: int, __: object) -> Sketch:
    """Draw a legend: coloured squares with names, and the number of names for which there is no row."""
    entries, side, frame, whole = pen.facts.legend, round(0.72 * px), max(1, px // 20), Sketch()
    if not entries:
        raise InputError("nothing has a name", expected="labels or volumes with names")
    inside, more = np.full(2 * (side - 2 * frame,), 255, np.uint8), len(entries) - MAX_LEGEND_ROWS
    for number, (name, color) in enumerate(entries[:MAX_LEGEND_ROWS]):
        line, row = pen.font.line(name, px), round(1.45 * px) * number
        whole.draw(line.mask, row, side + px // 2)
        # The rim makes a square visible whose colour is like the background.
        whole.fill(row + line.baseline - side, 0, side, side)
        whole.color(inside, color, row + line.baseline - side + frame, frame)
    if more > 0:
        whole.draw(pen.font.line(f"and {more} more", px).mask, round(1.45 * px) * MAX_LEGEND_ROWS, side + px // 2)
    return whole


def draw_orientation(_: EntrySpec, pen: Pen, px: int, axes: Sequence[Vector]) -> Sketch:
    """Draw arrows along the world's axes, with letters at their ends; nearer arrows cover farther ones."""
    side, letter_px, whole = max(px, MIN_TRIAD_PX), max(px // 6, MIN_TEXT_PX), Sketch()
    reach, half, rim = (side - 2.7 * letter_px) / 2, max(side / 70, 0.6), max(1, letter_px // 8)
    whole.draw(np.zeros((side, side), np.uint8), 0, 0)
    arrows = []
    for axis, name in enumerate(pen.facts.world_axes or "xyz"):
        across, up, near = (-row[axis] if name in _OPPOSITE else row[axis] for row in axes)
        arrows.append((near, axis, _OPPOSITE.get(name, name), across, -up))
    for _near, axis, name, across, down in sorted(arrows):
        color, length = _AXIS_COLORS[axis], max(math.hypot(across, down), 1e-3)
        for corners in _arrow(side / 2, (across / length, down / length), reach * length, half):
            mask, row, column = polygon(corners)
            whole.color(mask, color, row, column)
        line = pen.font.line(name, letter_px)
        # A letter lies beyond the tip of its arrow.
        letter, beyond = grown(line.mask, rim, rim), reach + 0.75 * letter_px / max(length, 0.3)
        row = min(max(round(side / 2 + beyond * down - line.baseline / 2) - rim, 0), side - letter.shape[0])
        column = min(max(round(side / 2 + beyond * across - line.mask.shape[1] / 2) - rim, 0), side - letter.shape[1])
        whole.erase(widen(letter, rim), row, column)
        whole.color(letter, color, row, column)
    return whole


def draw_logo(spec: LogoSpec, _: Pen, height: int, __: object) -> Sketch:
    """Draw the logo, `height` pixels high."""
    whole = Sketch()
    whole.paint = _read_logo(spec.file, height)
    whole.ink = np.zeros_like(whole.paint[..., 3])
    return whole


def _read_logo(file: Path, height: int) -> UInt8:
    """Return the picture in a file, scaled to a height: premultiplied RGBA, uint8 [h, w, 4].

    Raises InputError if the picture is too large, or cannot be read.
    """
    from PIL import Image

    expected = "a picture: PNG, JPEG or WebP"
    require_file(file, expected)
    try:
        with Image.open(file, formats=_LOGO_FORMATS) as picture:
            if picture.width * picture.height > _MAX_LOGO_PIXELS or picture.width > _MAX_LOGO_RATIO * picture.height:
                size = f"{picture.width} x {picture.height} pixels"
                raise InputError("too large for a logo", where=str(file), got=size, expected="at most 64 megapixels")
            width = max(round(height * picture.width / picture.height), 1)
            # With premultiplied colours, transparent pixels do not count in a mean. The Hamming filter has no negative
            # weights, so that edges do not ring.
            scaled = picture.convert("RGBA").convert("RGBa").resize((width, height), Image.Resampling.HAMMING)
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise InputError("this picture cannot be decoded", where=str(file), expected=expected) from error
    return np.array(scaled)


def _text_width(_: Pen, text: str) -> float:
    return len(text)


def _bar_width(pen: Pen, world_per_pixel: float) -> float:
    return float(_bar_length(pen, world_per_pixel)) / world_per_pixel


def _same_width(_: Pen, __: object) -> float:
    return 0.0


class Drawer(NamedTuple):
    """The functions that draw an entry of an annotation.

    find: the content of the entry on a frame, from the entry's keys in the scene. draw: a drawing, from the keys, a
    pen, a size in pixels, and this content. width: a number that is larger for a content whose drawing is wider.
    """

    find: Callable[[Any, FrameFacts], Any]
    draw: Callable[[Any, Pen, int, Any], Sketch]
    width: Callable[[Pen, Any], float] = _same_width


# The drawers of the entries of an annotation, by key.
DRAWERS = {
    "title": Drawer(lambda spec, frame: spec.text, draw_text),
    "logo": Drawer(lambda spec, frame: None, draw_logo),
    "time": Drawer(lambda spec, frame: fill_format(spec.format, frame.numbers), draw_text, _text_width),
    "legend": Drawer(lambda spec, frame: None, draw_legend),
    "color_bar": Drawer(lambda spec, frame: None, draw_color_bars),
    "scale_bar": Drawer(lambda spec, frame: frame.world_per_pixel, draw_scale_bar, _bar_width),
    "accuracy": Drawer(lambda spec, frame: frame.accuracy, draw_text, _text_width),
    "orientation": Drawer(lambda spec, frame: frame.axes, draw_orientation),
}


def _draw_color_bar(whole: Sketch, left: int, spec: ColorBarSpec, pen: Pen, px: int, bar: ColorBar) -> None:
    """Draw a color bar: its label above, a profile of opacities on the left, and ticks with numbers on the right.

    whole: the drawing that the bar is added to. left: the first column of the bar in it. px: the height of text, and
    the width of the bar, in pixels.
    """
    length, width, frame, stroke = round(spec.length * pen.facts.size[1]), px, max(1, px // 20), max(2, px // 4)
    name = bar.name if not bar.unit else f"{bar.name} ({bar.unit})" if bar.name else bar.unit
    label = pen.font.line(spec.label or name or " ", px)
    whole.draw(label.mask, 0, left)
    first, middle = len(label.mask) + px // 2 + frame, left + (round(1.5 * px) + frame if bar.opacities else 0)
    right, inside = middle + frame + width, np.full((1, width), 255, np.uint8)
    for row in range(length):
        sample = (2 * (length - row) - 1) * len(bar.colors) // (2 * length)
        whole.color(inside, bar.colors[sample], first + row, middle + frame)
        if bar.opacities:
            opaque = round(bar.opacities[sample] * (middle - left - frame))
            whole.ink[first + row, middle - opaque : middle] = _PROFILE
    for row in (first - frame, first + length):
        whole.fill(row, left, frame, right + frame - left)
    for column in {left, middle, right}:
        whole.fill(first - frame, column, length + 2 * frame, frame)
    for tick in find_ticks(bar.low, bar.high, min(max(length // (2 * px), 2), 7), is_log=bar.is_log):
        line, row = pen.font.line(plain_text(tick), px), first + round((1 - _share(bar, tick)) * (length - 1))
        whole.fill(row - frame // 2, right + frame, frame, stroke)
        whole.draw(line.mask, row - round(line.baseline / 2), right + frame + stroke + max(2, px // 5))


def _share(bar: ColorBar, value: Decimal) -> float:
    """Return the position of a value on a bar, from 0 at its lower end to 1 at its upper end."""
    low, high, at = bar.low, bar.high, float(value)
    if bar.is_log and low > 0:
        low, high, at = math.log(low), math.log(high), math.log(at)
    return min(max((at - low) / (high - low), 0.0), 1.0) if high > low else 0.5


def _arrow(middle: float, way: tuple[float, float], end: float, half: float) -> list[list[tuple[float, float]]]:
    """Return the corners of two polygons, the shaft and the head of an arrow that starts in the middle of a square.

    middle: the x and the y of the square's middle, in pixels. way: a unit vector along the arrow. end: the length of
    the arrow, in pixels. half: half the width of its shaft, in pixels.
    """
    neck, (x, y) = max(end - 8 * half, 0.0), way

    def at(along: float, beside: float) -> tuple[float, float]:
        return middle + along * x - beside * y, middle + along * y + beside * x

    shaft = [at(-half, half), at(neck, half), at(neck, -half), at(-half, -half)]
    return [shaft, [at(neck, 3.2 * half), at(end, 0.0), at(neck, -3.2 * half)]]
