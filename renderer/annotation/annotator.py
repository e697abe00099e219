"""Place the entries of an annotation around a picture, and draw them for each frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import lru_cache
from typing import Any

from renderer.annotation.entries import DRAWERS, MIN_TEXT_PX, MIN_TRIAD_PX, Pen
from renderer.annotation.facts import AnnotationFacts, FrameFacts
from renderer.annotation.sketch import Patch, Sketch, is_light
from renderer.annotation.text import Font
from renderer.errors import InputError, Problem
from renderer.scene import AnnotationSpec, Color, EntrySpec

# The distance of entries from the edges of the picture, as a share of the picture's shorter side.
_MARGIN = 0.04
# The distance between entries, as a share of the picture's shorter side.
_GAP = 0.02
# The largest width of the rim around an entry, in pixels.
_MAX_RIM_PX = 4

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

    def patches(self, frame: FrameFacts) -> list[Patch]:
        """Return the patches to put over the picture of a frame, in the order of drawing."""
        sketches = {key: self.sketch(key, frame) for key in self._entries}
        return [self._finished(key, sketches[key], place) for key, place in self.places(sketches).items()]

    def sketch(self, key: str, frame: FrameFacts) -> Sketch:
        """Return the drawing of an entry on a frame; empty if there is nothing to show.

        key: the key of the entry in the annotation. Raises InputError if the entry cannot be drawn.
        """
        find, _ = DRAWERS[key]
        return self._drawn(key, find(self._entries[key], frame))

    def _draw(self, key: str, shown: Any) -> Sketch:
        spec, (_, draw) = self._entries[key], DRAWERS[key]
        return draw(spec, self._pen, self._pen.px(self._spec.size_of(key)), shown)

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

    def _color(self, spec: EntrySpec, row: float) -> Color:
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


def annotation_problems(spec: AnnotationSpec, facts: AnnotationFacts, frames: Sequence[FrameFacts]) -> list[Problem]:
    """Return the problems of an annotation on the given frames: files that cannot be read, entries without room."""
    try:
        annotator = Annotator(spec, facts)
    except InputError as error:
        return [_problem("font", error)]
    found: dict[str, Problem] = {}
    for frame in frames:
        sketches: dict[str, Sketch] = {}
        for key in spec.entries:
            try:
                sketches[key] = annotator.sketch(key, frame)
            except InputError as error:
                found.setdefault(key, _problem(key, error))
        for key, lack in _without_room(annotator, facts, sketches):
            if key not in found:
                found[key] = replace(_problem(key, lack), hint=_room_hint(spec, facts, frame, key))
    return list(found.values())


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
