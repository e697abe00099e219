"""Define a level of resolution of a volume in a store, as users see it."""

from __future__ import annotations

from typing import NamedTuple


class VolumeLevel(NamedTuple):
    """The facts about a level: the numbers of voxels and the sizes of chunks along x, y, z, and decoded bytes.

    num_bytes: the bytes of all voxels of one step in time and one component. is_read: whether the volume is this level.
    """

    shape: tuple[int, int, int]
    chunks: tuple[int, int, int]
    num_bytes: int
    is_read: bool = False
