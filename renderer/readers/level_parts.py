"""Read a level of a store part by part, so that no chunk is read twice.

A part is an array of blocks: a block then takes pages of its own, and not a few bytes of many pages.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from renderer.readers.image import Image
from renderer.readers.store_blocks import Blocks
from renderer.volume import VolumeLevel

# A function that reads the blocks of a level that its argument `blocks` names, as of `Blocks.to_plain`.
ReadBlocks = Callable[..., Image]


def level_read(image: Image) -> VolumeLevel:
    """Return the facts about the level of a store that an image is of."""
    return next(level for level in image.levels if level.is_read)


def has_blocks(part: Image, wanted: Blocks) -> bool:
    """Return whether a part of a level has all wanted blocks."""
    return part.blocks is not None and not (wanted.wanted & ~part.blocks.wanted).any()


def with_blocks(part: Image, wanted: Blocks, read: ReadBlocks, *, is_shared: bool = False) -> Image:
    """Return a part of a level with the blocks that it has, and the wanted ones, of which the missing ones are read.

    part: an array of blocks, or a level of which nothing is read. is_shared: whether the file that `read` fills has the
        blocks of the part.
    """
    if part.blocks is None:
        return replace(read(blocks=wanted.to_plain(), in_blocks=True), blocks=wanted)
    missing = replace(wanted, wanted=wanted.wanted & ~part.blocks.wanted)
    image = read(blocks=missing.to_plain(), in_blocks=True)
    assert part.box is not None
    for place, _ in part.blocks.tiles(part.box) if not is_shared else ():
        image.values[place] = part.values[place]
    return replace(image, blocks=replace(wanted, wanted=wanted.wanted | part.blocks.wanted))


def read_rest(part: Image | None, read: ReadBlocks, **options: Any) -> Image:
    """Return a whole level, of which the blocks that a part does not have are read. options: further ones of `read`."""
    if part is None or part.blocks is None:
        return read(**options)
    image = read(blocks=replace(part.blocks, wanted=~part.blocks.wanted).to_plain(), **options)
    assert part.box is not None
    first = [begin for begin, _ in part.box[::-1]]
    for place, ranges in part.blocks.tiles(part.box):
        box = tuple(slice(low - begin, high - begin) for (low, high), begin in zip(ranges[::-1], first, strict=True))
        image.values[box] = part.values[place][part.blocks.part_of_tile(ranges)]
    return image
