"""Place the entries of an annotation around a picture, and draw them for each frame."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from renderer.annotation.entries import DRAWERS, Pen, shown_bars
from renderer.annotation.facts import AnnotationFacts, FrameFacts
from renderer.annotation.sketch import Patch, Sketch, is_light
from renderer.annotation.text import Font
from renderer.errors import InputError, Problem
from renderer.scene import AnnotationSpec, Color, EntrySpec, join_some, names_in_format

# The distance of entries from the edges of the picture, and from each other, by its shorter side.
_MARGIN, _GAP = 0.04, 0.02
_MAX_RIM_PX = 4

Place = tuple[int, int]


class Annotator:
    """Draws the annotation of a film; what stays the same is drawn once. Make another where `spec` or `facts` change.

    Of a scene and facts in which `annotation_problems` finds none.
    """

    def __init__(self, spec: AnnotationSpec, facts: AnnotationFacts) -> None:
        """Read the font. Raises InputError."""
        self._entries, self._facts = spec.entries, facts
        self._pen = Pen(Font(spec.font), facts)
        self._sketches: dict[str, tuple[Any, Sketch | None]] = {}
        self._patches: dict[str, tuple[Sketch, Place, Patch]] = {}

    def patches(self, frame: FrameFacts) -> list[Patch]:
        """Return what is put over the picture of a frame, in the order of drawing."""
        sketches = {key: sketch for key in self._entries if (sketch := self.sketch(key, frame)) is not None}
        return [self._patch(key, sketches[key], place) for key, place in self.places(sketches).items()]

    def sketch(self, key: str, frame: FrameFacts) -> Sketch | None:
        """Return the drawing of an entry on a frame; None if there is nothing to show. Raises InputError."""
        spec, drawer = self._entries[key], DRAWERS[key]
        shown = drawer.shows(spec, frame)
        if key not in self._sketches or self._sketches[key][0] != shown:
            self._sketches[key] = shown, drawer.draw(spec, self._pen, self._pen.px(spec.size), shown)
        return self._sketches[key][1]

    def missing_characters(self) -> str:
        """Return the characters, of all that was drawn since the last call, that the font does not have."""
        missing, self._pen.font.missing = self._pen.font.missing, set()
        return "".join(sorted(missing))

    def places(self, sketches: Mapping[str, Sketch]) -> dict[str, Place]:
        """Return the row and the column of each drawing: those at one position stack away from the edge."""
        places, by_position = dict[str, Place](), dict[str, list[str]]()
        for key in sketches:
            by_position.setdefault(self._entries[key].position, []).append(key)
        width, height = self._facts.size
        margin, gap = self.lengths
        for position, keys in by_position.items():
            heights = [sketches[key].size[0] for key in keys]
            row = (height - sum(heights) - gap * (len(keys) - 1)) // 2
            is_bottom = position.startswith("bottom")
            if is_bottom:
                row = height - margin
            elif position.startswith("top"):
                row = margin
            for key in keys:
                own_height, own_width = sketches[key].size
                column = (width - own_width) // 2
                if position.endswith(("left", "right")):
                    column = margin if position.endswith("left") else width - margin - own_width
                places[key] = row - own_height if is_bottom else row, column
                row += -own_height - gap if is_bottom else own_height + gap
        return places

    @property
    def lengths(self) -> tuple[int, int]:
        """Return the margin, and the gap between entries, in pixels."""
        shorter = min(self._facts.size)
        return round(_MARGIN * shorter), round(_GAP * shorter)

    def _patch(self, key: str, sketch: Sketch, place: Place) -> Patch:
        """Return a drawing in its colours, at its place."""
        known = self._patches.get(key)
        if known is None or known[0] is not sketch or known[1] != place:
            spec = self._entries[key]
            rim = DRAWERS[key].has_rim * min(max(self._pen.px(spec.size) // 12, 1), _MAX_RIM_PX)
            rgba = sketch.finish(self._color(spec, place[0] + sketch.size[0] / 2), rim)
            self._patches[key] = known = sketch, place, Patch(rgba, place[0] - rim, place[1] - rim)
        return known[2]

    def _color(self, spec: EntrySpec, row: float) -> Color:
        """Return the colour of an entry, whose middle is at this row."""
        if spec.color != "auto":
            return spec.color
        if self._facts.background is None:
            return 1.0, 1.0, 1.0
        share = row / self._facts.size[1]
        red, green, blue = (a + share * (b - a) for a, b in zip(*self._facts.background, strict=True))
        return (0.0, 0.0, 0.0) if is_light((red, green, blue)) else (1.0, 1.0, 1.0)


def annotation_problems(spec: AnnotationSpec, facts: AnnotationFacts, frames: Sequence[FrameFacts]) -> list[Problem]:
    """Return what keeps an annotation from being drawn on these frames: what cannot be read, and what has no room."""
    return list(_problems(spec, facts, frames))


def _problems(spec: AnnotationSpec, facts: AnnotationFacts, frames: Sequence[FrameFacts]) -> Iterator[Problem]:
    try:
        annotator = Annotator(spec, facts)
    except InputError as error:
        yield _problem("font", error.what, error.where, error.expected)
        return
    absent = list(_absent(spec, facts, frames[0]))
    yield from absent
    good = [key for key in spec.entries if key not in {problem.path.split(".")[1] for problem in absent}]
    found: dict[str, Problem] = {}
    for frame in frames:
        sketches: dict[str, Sketch] = {}
        for key in good:
            try:
                sketch = annotator.sketch(key, frame)
            except InputError as error:
                found.setdefault(key, _problem(key, error.what, error.got or error.where, error.expected))
                continue
            if missing := annotator.missing_characters():
                hint = "annotation.font: FILE has another font"
                found.setdefault(key, _problem(key, "the font lacks characters", missing, "", hint))
            if sketch is not None:
                sketches[key] = sketch
        for problem in _without_room(annotator, facts, sketches):
            found.setdefault(problem.path.split(".")[1], problem)
    yield from found.values()


def _absent(spec: AnnotationSpec, facts: AnnotationFacts, frame: FrameFacts) -> Iterator[Problem]:
    """Yield the entries that have nothing to show."""
    if spec.legend is not None and not facts.legend:
        yield _problem("legend", "no volume or label has a name", "", "labels, channels or volumes with names")
    if spec.color_bar is not None and not shown_bars(spec.color_bar, facts):
        yield _problem("color_bar", "no transfer function has a range of values", "", "a transfer function")
    for name in names_in_format(spec.time.format) if spec.time is not None else ():
        if name not in frame.numbers:
            expected = join_some(list(frame.numbers))
            yield _problem("time", "no such number on these frames", f"{{{name}}}", expected)


def _without_room(annotator: Annotator, facts: AnnotationFacts, sketches: Mapping[str, Sketch]) -> Iterator[Problem]:
    """Yield the entries that do not fit into the picture, or cover others."""
    (width, height), (margin, _), placed = facts.size, annotator.lengths, list[tuple[str, tuple[int, ...]]]()
    for key, (row, column) in annotator.places(sketches).items():
        own_height, own_width = sketches[key].size
        box = row, column, row + own_height, column + own_width
        hint = "give it a smaller size, or another position"
        if min(row, column) < margin or box[2] > height - margin or box[3] > width - margin:
            room = f"{width - 2 * margin} x {height - 2 * margin} pixels, with all at its position"
            yield _problem(key, "does not fit into the picture", f"{own_width} x {own_height} pixels", room, hint)
            continue
        for other, (top, left, bottom, right) in placed:
            if box[0] < bottom and top < box[2] and box[1] < right and left < box[3]:
                yield _problem(key, f"covers annotation.{other}", "", "", hint)
        placed.append((key, box))


def _problem(
    key: str, what: str, got: str | None = None, expected: str | None = None, hint: str | None = None
) -> Problem:
    return Problem(f"annotation.{key}", what, got, expected, hint)
