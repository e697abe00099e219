"""Read a level of a store part by part, so that no chunk is read twice."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from renderer.readers.image import Image
from renderer.readers.store_blocks import Blocks

# A function that reads the blocks of a level that its argument `blocks` names, as of `Blocks.to_plain`.
ReadBlocks = Callable[..., Image]


def read_plan(read: ReadBlocks) -> Image:
    """Return a level of which no block is read."""
    image = read(blocks=())
    return replace(image, blocks=Blocks.of_level(next(level for level in image.levels if level.is_read)))


def with_blocks(part: Image, wanted: Blocks, read: ReadBlocks) -> Image:
    """Return a part of a level with the blocks that it has, and the wanted ones, of which the missing ones are read."""
    if part.blocks is None or not (wanted.wanted & ~part.blocks.wanted).any():
        return part
    image = _with_missing(part, replace(wanted, wanted=wanted.wanted & ~part.blocks.wanted), read)
    return replace(image, blocks=replace(wanted, wanted=wanted.wanted | part.blocks.wanted))


def read_rest(part: Image | None, read: ReadBlocks, **options: Any) -> Image:
    """Return a whole level, of which the blocks that a part does not have are read. options: further ones of `read`."""
    if part is None or part.blocks is None or not part.blocks.wanted.any() or "blocks" in options:
        return read(**options)
    return _with_missing(part, replace(part.blocks, wanted=~part.blocks.wanted), read, **options)


def _with_missing(part: Image, missing: Blocks, read: ReadBlocks, **options: Any) -> Image:
    """Return a level with missing blocks, which are read, and those of a part, which are copied."""
    image = read(blocks=missing.to_plain(), **options)
    assert part.blocks is not None and part.box is not None
    first = [begin for begin, _ in part.box[::-1]]
    for box in part.blocks.boxes(part.box):
        place = tuple(slice(low - begin, high - begin) for (low, high), begin in zip(box[::-1], first, strict=True))
        image.values[place] = part.values[place]
    return image
