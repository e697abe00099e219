"""Draw each entry of an annotation: from its keys and what it shows to a sketch."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from decimal import Decimal
from typing import Any

import numpy as np

from renderer.annotation.facts import AnnotationFacts, ColorBar, FrameFacts
from renderer.annotation.logo import read_logo
from renderer.annotation.numbers import find_ticks, length_text, plain_text, round_below
from renderer.annotation.sketch import Sketch, polygon, widen
from renderer.annotation.text import Font, Line
from renderer.scene import Color, ColorBarSpec, EntrySpec, LogoSpec, TitleSpec, Vector, fill_format

MIN_TEXT_PX = 9
MAX_LEGEND_ROWS = 24
# The longest scale bar, by the width of the picture, and the size of the words beside its length.
_MAX_BAR, _SMALL = 0.2, 0.75
# The least side of the triad of axes, with letters of the least size.
_MIN_TRIAD_PX = 52
# The ink of a profile of opacities, of 255.
_PROFILE = 150
_OPPOSITE = {"L": "R", "P": "A", "I": "S"}
_AXIS_COLORS: tuple[Color, ...] = ((0.95, 0.32, 0.30), (0.30, 0.75, 0.35), (0.30, 0.55, 1.0))


@dataclass(frozen=True)
class Pen:
    """What all entries are drawn with: the font, and what they show of the film."""

    font: Font
    facts: AnnotationFacts

    def px(self, share: float) -> int:
        """Return a share of the picture's height in pixels, of text no less than can be read."""
        return max(round(share * self.facts.size[1]), MIN_TEXT_PX)


def draw_text(_: EntrySpec, pen: Pen, px: int, text: str) -> Sketch | None:
    """Draw a line of text; None without a text."""
    return _join([pen.font.line(text, px)]) if text else None


def draw_title(spec: TitleSpec, pen: Pen, px: int, _: object) -> Sketch | None:
    """Draw the title."""
    return draw_text(spec, pen, px, spec.text)


def draw_scale_bar(spec: EntrySpec, pen: Pen, px: int, world_per_pixel: float) -> Sketch:
    """Draw a bar of a round length, and the length over it; in perspective, at which distance it holds."""
    length = round_below(_MAX_BAR * pen.facts.size[0] * world_per_pixel)
    width, thickness, gap = max(round(float(length) / world_per_pixel), 1), max(2, px // 6), max(2, px // 4)
    lines = [pen.font.line(length_text(length, pen.facts.unit), px)]
    if pen.facts.is_perspective:
        lines.append(pen.font.line("at the target", max(round(_SMALL * px), MIN_TEXT_PX)))
    words = _join(lines, px // 3)
    height, words_width = words.size
    whole = Sketch(lines[0].baseline + gap + thickness, max(width, words_width))
    whole = Sketch(max(height, whole.size[0]), whole.size[1])
    is_right = spec.position.endswith("right")
    whole.draw(words.ink, 0, _beside(whole, words_width, is_right and words_width > width))
    whole.fill(lines[0].baseline + gap, _beside(whole, width, is_right), thickness, width)
    return whole


def draw_color_bars(spec: ColorBarSpec, pen: Pen, px: int, _: object) -> Sketch:
    """Draw the bars of transfer functions beside each other."""
    bars = shown_bars(spec, pen.facts)
    return _beside_each_other([_color_bar(spec, pen, px, bar) for bar in bars], round(1.4 * px))


def shown_bars(spec: ColorBarSpec, facts: AnnotationFacts) -> list[ColorBar]:
    """Return the bars that are shown."""
    return [bar for bar in facts.bars if spec.layer in (None, bar.layer)]


def draw_legend(_: EntrySpec, pen: Pen, px: int, __: object) -> Sketch:
    """Draw coloured squares with names, and how many there are beyond the last row."""
    entries, side, pitch = pen.facts.legend, round(0.72 * px), round(1.45 * px)
    lines = [pen.font.line(name, px) for name, _ in entries[:MAX_LEGEND_ROWS]]
    left, more, frame = side + px // 2, len(entries) - MAX_LEGEND_ROWS, max(1, px // 20)
    if more > 0:
        lines.append(pen.font.line(f"and {more} more", px))
    base = max(line.baseline for line in lines)
    height = pitch * (len(lines) - 1) + base + max(len(line.mask) - line.baseline for line in lines)
    whole, square = (
        Sketch(height, left + max(line.width for line in lines)),
        np.full((side - 2 * frame, side - 2 * frame), 255, np.uint8),
    )
    for number, line in enumerate(lines):
        baseline = base + pitch * number
        whole.draw(line.mask, baseline - line.baseline, left)
        if number < MAX_LEGEND_ROWS:
            whole.fill(baseline - side, 0, side, side)  # a frame, for colours like the background
            whole.color(square, entries[number][1], baseline - side + frame, frame)
    return whole


def draw_orientation(_: EntrySpec, pen: Pen, px: int, axes: Sequence[Vector]) -> Sketch:
    """Draw arrows along the world's axes, with letters at their ends; what is nearer is drawn later."""
    side, letter_px = max(px, _MIN_TRIAD_PX), max(px // 6, MIN_TEXT_PX)
    whole, middle = Sketch(side, side), side / 2
    reach, half, rim = (side - 2.7 * letter_px) / 2, max(side / 70, 0.6), max(1, letter_px // 8)
    arrows = []
    for axis, name in enumerate(pen.facts.world_axes or "xyz"):
        sign = -1 if name in _OPPOSITE else 1
        across, up, near = (sign * row[axis] for row in axes)
        arrows.append((near, axis, _OPPOSITE.get(name, name), across, -up))
    for _near, axis, name, across, down in sorted(arrows):
        color, length = _AXIS_COLORS[axis], math.hypot(across, down)
        for corners in _arrow(middle, across, down, reach, half):
            mask, row, column = polygon(corners)
            whole.color(mask, color, row, column)
        line = pen.font.line(name, letter_px)
        beyond = reach + 0.75 * letter_px / max(length, 0.3)  # beside the tip, however short the arrow
        letter = np.pad(line.mask, rim)
        row = round(middle + beyond * down - line.baseline / 2) - rim
        column = round(middle + beyond * across - line.width / 2) - rim
        row, column = (min(max(at, 0), side - n) for at, n in zip((row, column), letter.shape, strict=True))
        whole.erase(widen(letter, rim), row, column)
        whole.color(letter, color, row, column)
    return whole


def draw_logo(spec: LogoSpec, _: Pen, height: int, __: object) -> Sketch:
    """Draw the logo, at this height."""
    pixels = read_logo(spec.file, height)
    whole = Sketch(*pixels.shape[:2])
    whole.paint[:] = pixels
    return whole


@dataclass(frozen=True)
class Drawer:
    """A drawer of an entry: `draw` takes its keys, the pen, its size in pixels, and what `shows` finds for a frame."""

    draw: Callable[[Any, Pen, int, Any], Sketch | None]
    shows: Callable[[Any, FrameFacts], Any] = lambda spec, frame: None
    has_rim: bool = True


DRAWERS = {
    "title": Drawer(draw_title),
    "logo": Drawer(draw_logo, has_rim=False),
    "time": Drawer(draw_text, lambda spec, frame: fill_format(spec.format, frame.numbers)),
    "legend": Drawer(draw_legend),
    "color_bar": Drawer(draw_color_bars),
    "scale_bar": Drawer(draw_scale_bar, lambda _, frame: frame.world_per_pixel),
    "accuracy": Drawer(draw_text, lambda _, frame: frame.accuracy),
    "orientation": Drawer(draw_orientation, lambda _, frame: frame.axes),
}


def _color_bar(spec: ColorBarSpec, pen: Pen, px: int, bar: ColorBar) -> Sketch:
    """Draw a bar: its label above, opacities as a profile to the left of the colours, ticks to the right."""
    length, width, frame = round(spec.length * pen.facts.size[1]), px, max(1, px // 20)
    profile = round(1.5 * px) + frame if bar.opacities else 0
    name = bar.name if not bar.unit else f"{bar.name} ({bar.unit})" if bar.name else bar.unit
    label = pen.font.line(spec.label or name or " ", px)
    ticks = find_ticks(bar.low, bar.high, min(max(length // (2 * px), 2), 7), is_log=bar.is_log)
    lines = [pen.font.line(plain_text(tick), px) for tick in ticks]
    top, right, stroke = len(label.mask) + px // 2, frame + profile + width + frame, max(2, px // 4)
    rows = [top + frame + round((1 - _share(bar, tick)) * (length - 1)) for tick in ticks]
    text_rows = [row - round(line.baseline / 2) for row, line in zip(rows, lines, strict=True)]
    text_column = right + stroke + max(2, px // 5)
    ends = [top + length + 2 * frame, *(row + len(line.mask) for row, line in zip(text_rows, lines, strict=True))]
    whole = Sketch(max(ends), max(label.width, text_column + max((line.width for line in lines), default=0)))
    whole.draw(label.mask, 0, 0)
    left, line_of_color = frame + profile, np.full((1, width), 255, np.uint8)
    for row in range(length):
        sample = (2 * (length - row) - 1) * len(bar.colors) // (2 * length)
        whole.color(line_of_color, bar.colors[sample], top + frame + row, left)
        if profile:
            opaque = round(bar.opacities[sample] * (profile - frame))
            whole.ink[top + frame + row, profile - opaque : profile] = _PROFILE
    for row in (top, top + frame + length):
        whole.fill(row, 0, frame, right)
    for column in {0, profile, right - frame}:
        whole.fill(top, column, length + 2 * frame, frame)
    for row, text_row, line in zip(rows, text_rows, lines, strict=True):
        whole.fill(row - frame // 2, right, frame, stroke)
        whole.draw(line.mask, text_row, text_column)
    return whole


def _share(bar: ColorBar, value: Decimal) -> float:
    """Return where a value is on a bar, from 0 at its lower end to 1."""
    low, high, at = bar.low, bar.high, float(value)
    if bar.is_log and low > 0:
        low, high, at = math.log(low), math.log(high), math.log(at)
    return min(max((at - low) / (high - low), 0.0), 1.0) if high > low else 0.5


def _arrow(middle: float, across: float, down: float, reach: float, half: float) -> list[list[tuple[float, float]]]:
    """Return the corners of an arrow's shaft and head, from the middle of the triad; as short as it is seen."""
    length = math.hypot(across, down)
    if length < 1e-3:
        return [[(middle - half, middle - half), (middle + half, middle - half), (middle + half, middle + half),
                 (middle - half, middle + half)]]  # fmt: skip
    x, y, end = across / length, down / length, reach * length
    neck = max(end - 8 * half, 0.0)

    def at(along: float, beside: float) -> tuple[float, float]:
        return middle + along * x - beside * y, middle + along * y + beside * x

    shaft = [at(-half, half), at(neck, half), at(neck, -half), at(-half, -half)]
    return [shaft, [at(neck, 3.2 * half), at(end, 0.0), at(neck, -3.2 * half)]]


def _join(lines: Sequence[Line], gap: int = 0) -> Sketch:
    """Return lines of text one after the other, on one baseline."""
    base = max(line.baseline for line in lines)
    height = base + max(len(line.mask) - line.baseline for line in lines)
    whole, column = Sketch(height, sum(line.width for line in lines) + gap * (len(lines) - 1)), 0
    for line in lines:
        whole.draw(line.mask, base - line.baseline, column)
        column += line.width + gap
    return whole


def _beside_each_other(parts: Sequence[Sketch], gap: int) -> Sketch:
    heights, widths = zip(*(part.size for part in parts), strict=True)
    whole, column = Sketch(max(heights), sum(widths) + gap * (len(parts) - 1)), 0
    for part in parts:
        height, width = part.size
        whole.ink[:height, column : column + width] = part.ink
        whole.paint[:height, column : column + width] = part.paint
        column += width + gap
    return whole


def _beside(whole: Sketch, width: int, is_right: bool) -> int:
    return whole.size[1] - width if is_right else 0
