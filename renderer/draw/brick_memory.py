"""What a process that draws bricks takes, at most, beside the stage: atlases and bricks that were made."""

from __future__ import annotations

import math

from renderer.bricks import MAX_CACHE_BYTES, Bricks
from renderer.draw.cpu.atlas import max_atlas_bytes


def most_bytes(bricks: Bricks, *, lit: bool) -> int:
    """Where they are drawn on the processor; the image and the processes are extra."""
    num_scalars, *num_means = (math.prod(level.visible_bounds.shape[:3]) for level in bricks.levels)
    atlases = max_atlas_bytes(4 if lit else 1, num_scalars) + max_atlas_bytes(4, sum(num_means))
    return atlases + min(MAX_CACHE_BYTES, max_atlas_bytes(4, sum(num_means)))
