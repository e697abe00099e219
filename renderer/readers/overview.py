"""Choose the level of a store by which a volume is described, where its finest level would take long to read."""

from __future__ import annotations

import math
from dataclasses import replace

from renderer.readers.volume_reading import most_level_bytes, read_part
from renderer.scene import VolumeSpec

# The largest number of voxels of a level by which a volume is described: to read and to count them takes some seconds.
_MOST_VOXELS = 1 << 27


def overview_level(spec: VolumeSpec) -> int | None:
    """Return the number of the level by which a volume is described: the finest one that is not large.

    Returns None if that is the finest level, for a level that is chosen by hand, for labels, which coarse levels may
    lack, and for a volume that is no store. Raises InputError for damaged stores.
    """
    plan = None if spec.level is not None else read_part(replace(spec, level=0), None)
    if plan is None or plan.box is None or plan.labels:
        return None
    share = math.prod(end - begin for begin, end in plan.box) / math.prod(plan.levels[0].shape)
    are_large = [
        share * math.prod(level.shape) > _MOST_VOXELS or share * level.num_bytes > most_level_bytes()
        for level in plan.levels
    ]
    return min(sum(are_large), len(are_large) - 1) or None
