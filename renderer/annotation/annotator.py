"""Place the entries of an annotation around a picture, and draw them for each frame."""

from __future__ import annotations

import math
from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

from renderer.annotation.entries import DRAWERS, MIN_TEXT_PX, MIN_TRIAD_PX, Pen
from renderer.annotation.facts import AnnotationFacts, FrameFacts, Side
from renderer.annotation.sketch import Patch, Sketch, is_light, polygon
from renderer.annotation.text import Font
from renderer.errors import InputError, Problem
from renderer.scene import AnnotationSpec, Color, EntrySpec, NamesSpec
from renderer.volume import UInt8

# The distance of entries from the edges of the picture, as a share of the picture's shorter side.
_MARGIN = 0.04
# The distance between entries, as a share of the picture's shorter side.
_GAP = 0.02
# The largest width of the rim around an entry, in pixels.
_MAX_RIM_PX = 4

# The sides of the picture with names of labels, in the order of `AnnotationFacts.names`.
_SIDES: tuple[Side, Side] = ("left", "right")
# The largest distance between names in a column, as a multiple of their height. In columns as compact as the object,
# lines cross less: on a turntable of 16 nuclei, 4.8 crossings a frame at 1.8, 5.4 at 2.5 and 6.6 at 5.
_PITCH = 2.0
# The radius of the dot at the end of a line, as a multiple of half the line's width.
_DOT = 4.0
# The length of the pieces in which a line is drawn, in pixels.
_PIECE_PX = 128
# The opacity of a name whose label is not visible on a frame.
_FAINT = 0.4
# The factors of a picture's size that are tried for an entry without room.
_LARGER = (1.25, 1.5, 2, 3, 4, 6, 8)
# The least sizes of entries in pixels, where they are not those of a text.
_LEAST_PX = {"orientation": MIN_TRIAD_PX}

# The place of a drawing in the picture: the row and the column of the drawing's first pixel.
Place = tuple[int, int]


class Annotator:
    """A painter of the annotation of a film, which draws each entry again only when it changes.

    An annotator is made for one `spec` and its `facts`, in which `annotation_problems` has found no problem.

    margin: the distance of entries from the edges of the picture, in pixels.
    """

    def __init__(self, spec: AnnotationSpec, facts: AnnotationFacts) -> None:
        """Read the font. Raises InputError if it cannot be read."""
        self._spec, self._entries, self._facts = spec, spec.entries, facts
        self._pen, self.margin = Pen(Font(spec.font), facts), round(_MARGIN * min(facts.size))
        num = 2 * len(self._entries)  # for each entry, the current drawing and the drawing before it
        self._drawn, self._finished = lru_cache(num)(self._draw), lru_cache(num)(self._finish)
        self._finished_name = lru_cache(sum(map(len, facts.names)))(self._finish_name)

    def patches(self, frame: FrameFacts) -> list[Patch]:
        """Return the patches to put over the picture of a frame, in the order of drawing."""
        sketches = {key: self.sketch(key, frame) for key in self._entries}
        patches = [self._finished(key, sketches[key], place) for key, place in self.places(sketches).items()]
        return [*patches, *self._name_patches(frame)]

    def sketch(self, key: str, frame: FrameFacts) -> Sketch:
        """Return the drawing of an entry on a frame; empty if there is nothing to show.

        key: the key of the entry in the annotation. Raises InputError if the entry cannot be drawn.
        """
        find = DRAWERS[key].find
        return self._drawn(key, find(self._entries[key], frame))

    def _draw(self, key: str, shown: Any) -> Sketch:
        return DRAWERS[key].draw(self._entries[key], self._pen, self._pen.px(self._spec.size_of(key)), shown)

    def widest(self, key: str, frames: Sequence[FrameFacts]) -> FrameFacts:
        """Return the frame on which an entry is the widest; the first one on which it cannot be drawn, if there is one.

        Few drawings are made for this: digits are equally wide, and a scale bar's length is a number.
        """
        drawer, widest = DRAWERS[key], (-1.0, frames[0])
        for frame in frames:
            try:
                width = drawer.width(self._pen, drawer.find(self._entries[key], frame))
            except InputError:
                return frame
            if width > widest[0]:
                widest = width, frame
        return widest[1]

    def places(self, sketches: Mapping[str, Sketch]) -> dict[str, Place]:
        """Return the place of each drawing. Drawings at one position, such as a corner, are stacked from the edge on.

        sketches: the drawings of entries, by key.
        """
        places, by_position = dict[str, Place](), dict[str, list[str]]()
        for key in sketches:
            by_position.setdefault(self._entries[key].position, []).append(key)
        (width, height), margin, gap = self._facts.size, self.margin, round(_GAP * min(self._facts.size))
        for position, keys in by_position.items():
            room = height - sum(sketches[key].height + gap for key in keys) + gap
            row = {"t": margin, "b": room - margin}.get(position[0], room // 2)
            for key in reversed(keys) if position[0] == "b" else keys:
                room = width - sketches[key].width
                column = {"left": margin, "right": room - margin}.get(position.split("-")[-1], room // 2)
                places[key] = row, column
                row += sketches[key].height + gap
        return places

    def _finish(self, key: str, sketch: Sketch, place: Place) -> Patch:
        """Return the drawing of an entry as a patch: in the entry's colour, with a rim, at its place in the picture."""
        spec, (row, column) = self._entries[key], place
        rim = 0 if key == "logo" else min(max(self._pen.px(self._spec.size_of(key)) // 12, 1), _MAX_RIM_PX)
        return Patch(sketch.finish(self._color(spec, row + sketch.height / 2), rim), row - rim, column - rim)

    @cached_property
    def name_places(self) -> dict[tuple[Side, int], NamePlace]:
        """Return the places of the names of labels, by side and rank: an even column at each side.

        Columns lie between the entries at the top and at the bottom of their side. Raises InputError if names do not
        fit into a column.
        """
        found, px = dict[tuple[Side, int], NamePlace](), self._name_px
        width, height = self._facts.size
        for side, names in zip(_SIDES, self._facts.names if self._spec.names is not None else (), strict=False):
            lines = [self._pen.font.line(text, px).mask for text, _ in names]
            if not lines:
                continue
            across, down = max(line.shape[1] for line in lines), len(lines[0])
            top, bottom = self._name_rows(side)
            if not self._has_columns(px):
                got = f"{len(lines)} names at the {side}, at most {across} x {down} pixels each"
                expected = f"a third of the width of {width} pixels, and {max(bottom - top, 0)} pixels of the height"
                hint = "a smaller size, a larger picture, or fewer labels"
                raise InputError("do not fit beside the object", got=got, expected=expected, hint=hint)
            pitch = min((bottom - top) / len(lines), _PITCH * down)
            length = round(pitch * len(lines))
            first = min(max((height - length) // 2, top), bottom - length)
            for rank, line in enumerate(lines):
                row = first + round((rank + 0.5) * pitch - down / 2)
                left, inner = self.margin + across - line.shape[1], self.margin + across + px // 3
                column = left if side == "left" else width - self.margin - across
                found[side, rank] = NamePlace(row, column, line, inner if side == "left" else width - inner)
        return found

    @property
    def names_share(self) -> float:
        """Return the share of the picture's width that the columns of names take."""
        width = self._facts.size[0]
        ends = {side: place.inner for (side, _), place in self.name_places.items()}
        return sum(inner if side == "left" else width - inner for side, inner in ends.items()) / width

    @cached_property
    def _name_px(self) -> int:
        """Return the height of names in pixels: their own or that of texts or, if these do not fit, one that fits."""
        spec = self._spec.names
        if spec is not None and spec.size is not None:
            return self._pen.px(spec.size)
        sizes = range(MIN_TEXT_PX, self._pen.px(self._spec.size) + 1)
        num_fitting = bisect_left(sizes, True, key=lambda px: not self._has_columns(px))
        return sizes[max(num_fitting - 1, 0)]

    def _has_columns(self, px: int) -> bool:
        """Return whether names of a height fit into columns of a third of the picture's width."""
        for side, names in zip(_SIDES, self._facts.names, strict=True):
            (top, bottom), down = self._name_rows(side), len(self._pen.font.line(" ", px).mask)
            across = max((self._pen.font.line(text, px).mask.shape[1] for text, _ in names), default=0)
            if names and (len(names) * down > bottom - top or 3 * (across + self.margin) > self._facts.size[0]):
                return False
        return True

    def _name_rows(self, side: Side) -> tuple[int, int]:
        """Return the first row and the last that a column may take, between the entries above it and below it."""
        ends, gap = dict.fromkeys(("top", "bottom"), self.margin), round(_GAP * min(self._facts.size))
        for end in ends:
            for position in (end, f"{end}-{side}"):
                keys = [key for key, entry in self._entries.items() if entry.position == position]
                taken = self.margin + sum(self._height(key) + gap for key in keys)
                ends[end] = max(ends[end], taken)
        return ends["top"], self._facts.size[1] - ends["bottom"]

    def _height(self, key: str) -> int:
        """Return the height of an entry in pixels, which is the same on all frames."""
        if key in ("title", "time", "accuracy"):
            return len(self._pen.font.line(" ", self._pen.px(self._spec.size_of(key))).mask)
        with suppress(InputError):
            return self.sketch(key, FrameFacts()).height
        return 0

    def _name_patches(self, frame: FrameFacts) -> Iterator[Patch]:
        """Yield lines to labels, in their colours, then the names. A name without a visible label is faint."""
        px, spec = self._name_px, self._spec.names
        if spec is None:
            return
        half = max(px / 24, 0.6)
        for (side, rank), anchor in frame.anchors.items():
            _, color = self._facts.names[_SIDES.index(side)][rank]
            yield from Leader(self.name_places[side, rank].start, anchor, half).patches(color)
        for key in self.name_places:
            name = self._finished_name(key)
            yield name if key in frame.anchors else name._replace(rgba=_FAINT * name.rgba)

    def _finish_name(self, key: tuple[Side, int]) -> Patch:
        """Return a name as a patch. key: its side and rank."""
        place, spec, px = self.name_places[key], self._spec.names, self._name_px
        assert spec is not None
        rim, sketch = min(max(px // 12, 1), _MAX_RIM_PX), Sketch()
        sketch.draw(place.line, 0, 0)
        color = self._color(spec, place.start[1])
        return Patch(sketch.finish(color, rim), place.row - rim, place.column - rim)

    def _color(self, spec: EntrySpec | NamesSpec, row: float) -> Color:
        """Return the colour of an entry: its own, that of all entries, or else a readable one.

        The readable colour is white on a dark background, and black on a light or transparent one.

        row: the row of the entry's middle, for a background whose colour changes with height.
        """
        for color in (spec.color, self._spec.color):
            if color != "auto":
                return color
        if self._facts.background is None:
            return 0.0, 0.0, 0.0
        share = row / self._facts.size[1]
        red, green, blue = (a + share * (b - a) for a, b in zip(*self._facts.background, strict=True))
        return (0.0, 0.0, 0.0) if is_light((red, green, blue)) else (1.0, 1.0, 1.0)


class NamePlace(NamedTuple):
    """The place of a name: its first row and column, its mask, and the column where its line begins."""

    row: int
    column: int
    line: UInt8
    inner: int

    @property
    def start(self) -> tuple[float, float]:
        """Return the place (x, y) where the line begins, in pixels."""
        return self.inner, self.row + len(self.line) / 2


class Leader(NamedTuple):
    """A straight line with a dot at its end. start, end: (x, y), in pixels. half: half the line's width, in pixels."""

    start: tuple[float, float]
    end: tuple[float, float]
    half: float

    def patches(self, color: Color) -> Iterator[Patch]:
        """Yield the line in pieces, as the box around a long line has many more pixels than the line."""
        along = int(abs(self.end[1] - self.start[1]) > abs(self.end[0] - self.start[0]))
        reach = _DOT * self.half + 2
        lowest = math.floor(min(self.start[along], self.end[along]) - reach)
        for first in range(lowest, math.ceil(max(self.start[along], self.end[along]) + reach), _PIECE_PX):
            yield from self._piece(along, first, first + _PIECE_PX, color)

    def _piece(self, along: int, first: int, last: int, color: Color) -> Iterator[Patch]:
        """Yield the part of the line with its rim from one column, or row, to another. along: 1 for rows."""
        (x, y), (end_x, end_y), half = self.start, self.end, self.half
        whole, reach = self.end[along] - self.start[along], 2 * half + 4
        shares = [(edge - self.start[along]) / whole if whole else share for share, edge in enumerate((first, last))]
        more = reach / max(abs(whole), 1e-9)
        low, high = max(min(shares) - more, 0.0), min(max(shares) + more, 1.0)
        shapes = list[list[tuple[float, float]]]()
        if low < high:
            length = max(math.hypot(end_x - x, end_y - y), 1e-9)
            aside = -half * (end_y - y) / length, half * (end_x - x) / length
            corners = ((low, 1), (high, 1), (high, -1), (low, -1))
            shapes.append(
                [(x + t * (end_x - x) + k * aside[0], y + t * (end_y - y) + k * aside[1]) for t, k in corners]
            )
        if first - reach < self.end[along] + _DOT * half and self.end[along] - _DOT * half < last + reach:
            turns = [math.pi * k / 8 for k in range(16)]
            shapes.append(
                [(end_x + _DOT * half * math.cos(turn), end_y + _DOT * half * math.sin(turn)) for turn in turns]
            )
        if not shapes:
            return
        masks, sketch = [polygon(corners) for corners in shapes], Sketch()
        top, left = min(row for _, row, _ in masks), min(column for _, _, column in masks)
        for mask, row, column in masks:
            sketch.draw(mask, row - top, column - left)
        rgba, top, left = sketch.finish(color, 1), top - 1, left - 1
        own = slice(max(first - (top if along else left), 0), max(last - (top if along else left), 0))
        if along:
            yield Patch(rgba[own], top + own.start, left)
        else:
            yield Patch(rgba[:, own], top, left + own.start)


def annotation_problems(spec: AnnotationSpec, facts: AnnotationFacts, frames: Sequence[FrameFacts]) -> list[Problem]:
    """Return the problems of an annotation on the given frames: files that cannot be read, entries without room.

    Entries are drawn on the frames on which one of them is the widest.
    """
    try:
        annotator = Annotator(spec, facts)
    except InputError as error:
        return [_problem("font", error)]
    found: dict[str, Problem] = {}
    widest = [annotator.widest(key, frames) for key in spec.entries]
    for frame in {each.frame: each for each in (frames[0], *widest)}.values():
        sketches: dict[str, Sketch] = {}
        for key in spec.entries:
            try:
                sketches[key] = annotator.sketch(key, frame)
            except InputError as error:
                found.setdefault(key, _problem(key, error))
        for lack in _name_problems(annotator, spec, sketches):
            found.setdefault("names", _problem("names", lack))
        for key, lack in _without_room(annotator, facts, sketches):
            if key not in found:
                found[key] = replace(_problem(key, lack), hint=_room_hint(spec, facts, frame, key))
    return list(found.values())


def _name_problems(annotator: Annotator, spec: AnnotationSpec, sketches: Mapping[str, Sketch]) -> Iterator[InputError]:
    """Yield what keeps names from being drawn: no labels, no side, no room, or an entry in their place."""
    if spec.names is None:
        return
    try:
        names = annotator.name_places
    except InputError as error:
        yield error
        return
    if not names and not spec.name_sides:
        hint = "give one of the entries in the middle of the sides another position"
        yield InputError("have no side of the picture", hint=hint)
    elif not names:
        yield InputError("nothing has a name", expected="labels that some voxels have")
    for key, (row, column) in annotator.places(sketches).items():
        bottom, right = row + sketches[key].height, column + sketches[key].width
        for place in names.values():
            low, last = place.row + len(place.line), place.column + place.line.shape[1]
            if row < low and place.row < bottom and column < last and place.column < right:
                yield InputError(f"cover annotation.{key}", hint="give it a smaller size, or another position")


def _problem(key: str, error: InputError) -> Problem:
    return Problem(f"annotation.{key}", error.what, error.got or error.where, error.expected, error.hint)


def _without_room(
    annotator: Annotator, facts: AnnotationFacts, sketches: Mapping[str, Sketch]
) -> Iterator[tuple[str, InputError]]:
    """Yield the entries that do not fit into the picture, or cover other entries, each with its error."""
    margin, placed = annotator.margin, dict[str, tuple[int, ...]]()
    width, height = (side - 2 * margin for side in facts.size)
    for key, (row, column) in annotator.places(sketches).items():
        sketch = sketches[key]
        box = row, column, row + sketch.height, column + sketch.width
        got = f"{sketch.width} x {sketch.height} pixels, in a picture of {facts.size[0]} x {facts.size[1]}"
        if min(row, column) < margin or box[2] > height + margin or box[3] > width + margin:
            expected = f"at most {width} x {height} pixels, with all entries at its position"
            yield key, InputError("does not fit into the picture", got=got, expected=expected)
            continue
        for other, (top, left, bottom, right) in placed.items():
            if row < bottom and top < box[2] and column < right and left < box[3]:
                yield key, InputError(f"covers annotation.{other}", got=got)
        placed[key] = box


def _room_hint(spec: AnnotationSpec, facts: AnnotationFacts, frame: FrameFacts, key: str) -> str:
    """Return a hint for an entry without room on a frame: the size of the entry, or of the picture, that has room."""
    entry, size, found = spec.entries[key], spec.size_of(key), list[str]()
    for part in range(9, 1, -1):
        smaller = round(size * part / 10, 3)
        changes: dict[str, Any] = {key: replace(entry, size=smaller)}
        if _has_room(replace(spec, **changes), facts, frame, key):
            found.append(f"size: {smaller:g} fits")
            break
    # Only entries of the least size have more room in a larger picture.
    has_least = any(spec.size_of(each) * facts.size[1] < _LEAST_PX.get(each, MIN_TEXT_PX) for each in spec.entries)
    for factor in _LARGER if has_least else ():
        width, height = (round(factor * side) for side in facts.size)
        larger = replace(frame, world_per_pixel=frame.world_per_pixel / factor)
        if _has_room(spec, replace(facts, size=(width, height)), larger, key):
            found.append(f"it fits into a picture of {width} x {height}")
            break
    return "; ".join([*found, "a shorter text, fewer entries or another position may help, too"])


def _has_room(spec: AnnotationSpec, facts: AnnotationFacts, frame: FrameFacts, key: str) -> bool:
    annotator, sketches = Annotator(spec, facts), dict[str, Sketch]()
    for each in spec.entries:
        with suppress(InputError):
            sketches[each] = annotator.sketch(each, frame)
    return key in sketches and key not in dict(_without_room(annotator, facts, sketches))
