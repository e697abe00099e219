"""Find the parts of a picture that the entries of an annotation take, and the rectangles that they leave free."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from contextlib import suppress
from itertools import product
from typing import NamedTuple

from renderer.annotation.annotator import Annotator
from renderer.annotation.facts import AnnotationFacts, FrameFacts
from renderer.annotation.sketch import Sketch
from renderer.errors import InputError
from renderer.scene import AnnotationSpec
from renderer.view import Room

# The distance of the room from entries, as a share of the picture's shorter side.
_GAP = 0.02
# The smallest width and height of a room, as shares of the picture's.
LEAST_SHARE = 0.25


class Box(NamedTuple):
    """The part of a picture that an entry takes, as shares of the picture's width and height from the top left."""

    left: float
    top: float
    right: float
    bottom: float

    def joined(self, other: Box) -> Box:
        """Return the smallest box around two boxes."""
        lowest, highest = map(min, self[:2], other[:2]), map(max, self[2:], other[2:])
        return Box(*lowest, *highest)


def taken_boxes(spec: AnnotationSpec, facts: AnnotationFacts, frames: Sequence[FrameFacts]) -> dict[str, Box]:
    """Return the part of the picture that each entry takes on some of the given frames, by key.

    Entries that cannot be drawn are left out: `annotation_problems` finds them.
    """
    boxes, (width, height) = dict[str, Box](), facts.size
    with suppress(InputError):
        annotator, sketches = Annotator(spec, facts), dict[str, Sketch]()
        for key in spec.entries:
            with suppress(InputError):
                sketches[key] = annotator.sketch(key, annotator.widest(key, frames))
        for key, (row, column) in annotator.places(sketches).items():
            right, bottom = column + sketches[key].width, row + sketches[key].height
            if sketches[key].width:
                boxes[key] = Box(column / width, row / height, right / width, bottom / height)
        # A column of names takes its side of the picture over the whole height, so that no line crosses a name of it.
        for (side, _), place in annotator.name_places.items():
            start, edge = (0, place.inner) if side == "left" else (place.inner, width)
            boxes[f"names.{side}"] = Box(start / width, 0.0, edge / width, 1.0)
    return boxes


def free_rooms(boxes: Collection[Box], size: tuple[int, int]) -> list[Room]:
    """Return the rectangles of a picture that are free of boxes and as large as possible, the widest first.

    Every free rectangle is at most as wide and as high as one of them. Rectangles that are too small to show an object
    are left out. size: (width, height) of the picture, in pixels.
    """
    across, down = (_GAP * min(size) / side for side in size)
    wide = [Box(box.left - across, box.top - down, box.right + across, box.bottom + down) for box in boxes]
    lefts, rights = {0.0, *(box.right for box in wide)}, {1.0, *(box.left for box in wide)}
    tops, bottoms = {0.0, *(box.bottom for box in wide)}, {1.0, *(box.top for box in wide)}
    columns = [each for each in product(sorted(lefts), sorted(rights)) if each[1] - each[0] >= LEAST_SHARE]
    rows = [each for each in product(sorted(tops), sorted(bottoms)) if each[1] - each[0] >= LEAST_SHARE]
    rooms = [
        Room(left, top, right, bottom)
        for (left, right), (top, bottom) in product(columns, rows)
        if not any(box.left < right and left < box.right and box.top < bottom and top < box.bottom for box in wide)
    ]
    found = list[Room]()
    for room in sorted(rooms, key=lambda each: each.shares, reverse=True):
        if not found or room.shares[1] > found[-1].shares[1]:
            found.append(room)
    return found
