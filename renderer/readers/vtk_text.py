"""Check the XML of a VTK image for faults that VTK ignores, going on with random values from memory."""

from __future__ import annotations

import math
import mmap
import re
from pathlib import Path
from typing import Any

import numpy as np

from renderer.system import attribute, number_in

# The attributes with the place of an image, and how many numbers each of them holds.
_PLACES = {"Origin": 3, "Spacing": 3, "Direction": 9}
# A whole number in the text of an attribute.
_INTEGER = re.compile(r"-?[0-9]{1,9}")


def extent_in(tag: str, name: str) -> tuple[int, ...] | None:
    """Return the first and the last point along each axis that a tag's attribute gives; None for an invalid one."""
    words = (attribute(tag, name) or "").split()
    numbers = tuple(int(word) for word in words if _INTEGER.fullmatch(word))
    is_extent = len(words) == len(numbers) == 6 and all(numbers[k + 1] >= numbers[k] for k in (0, 2, 4))
    return numbers if is_extent else None


def fault_in(path: Path, image: Any, *, is_cells: bool) -> str | None:
    """Return a text on the fault in the XML of an image that VTK has read; None if there is none.

    Faults are places that are not numbers, and points or cells that are in no piece.
    """
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
        end = data.find(b"<AppendedData")
        text = data if end < 0 else data[:end]
        tag = re.search(rb"<ImageData\b[^<>]*", text)
        pieces = [each[0].decode("utf-8", "replace") for each in re.finditer(rb"<Piece\b[^<>]*", text)]
        start = tag[0].decode("utf-8", "replace") if tag else ""
    for name, count in _PLACES.items():
        words = (attribute(start, name) or "0 " * count).split()
        if len(words) != count or not all(math.isfinite(number_in(word)) for word in words):
            return f"{name} that is not {count} numbers"
    num_left_out = _num_left_out(pieces, image.GetExtent(), is_cells=is_cells)
    return f"{num_left_out} {'cells' if is_cells else 'points'} in none of its pieces" if num_left_out else None


def _num_left_out(pieces: list[str], extent: tuple[int, ...], *, is_cells: bool) -> int:
    """Return how many points or cells of an extent are in none of the pieces."""
    first = np.array(extent[::2])
    shape = np.maximum(np.array(extent[1::2]) - first + (not is_cells), 1)
    are_there = np.zeros(shape, bool)
    for tag in pieces:
        own = extent_in(tag, "Extent")
        if own is not None:
            begin = np.array(own[::2]) - first
            end = np.maximum(np.array(own[1::2]) - first + (not is_cells), begin + 1)
            are_there[tuple(slice(max(0, low), max(0, high)) for low, high in zip(begin, end, strict=True))] = True
    return int(are_there.size - np.count_nonzero(are_there))
