"""Read the metadata of a volume of Neuroglancer (precomputed): the file `info` with its scales."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.stores.fields import mappings_of, numbers_of, text_of
from renderer.stores.levels import ImagePlan, LevelPlan, axis_named
from renderer.stores.store_files import PRECOMPUTED_FILE, StoreFiles, require_inside
from renderer.volume import Float64

# The axes of each array in tensorstore. Resolutions are in nanometres.
_AXES = (*(axis_named(name, "nm") for name in "xyz"), axis_named("c"))
# The largest number of scales.
_MAX_LEVELS = 32


def plan_at(files: StoreFiles, path: str) -> ImagePlan | None:
    """Return the volume of Neuroglancer in a folder of a store; None if there is none."""
    info = files.json(path, PRECOMPUTED_FILE)
    if info is None or "scales" not in info:
        return None
    scales = mappings_of(info.get("scales"))[:_MAX_LEVELS]
    if not scales:
        raise InputError("this volume of Neuroglancer has no scales", got="an empty list")
    levels = []
    for number, scale in enumerate(scales):
        key = text_of(scale.get("key"))
        require_inside(key)
        levels.append(LevelPlan(path, _place(scale), (("scale_index", number),)))
    return ImagePlan("neuroglancer_precomputed", _AXES, tuple(levels), is_reversed=True)


def _place(scale: Mapping[str, Any]) -> Float64:
    """Return the place of a scale: voxel i covers [i, i + 1] times the resolution, after the offset of its voxels."""
    resolution = numbers_of(scale.get("resolution"), 3)
    if resolution is None or min(resolution) <= 0:
        raise InputError("a scale of this volume has no resolution", got=str(scale.get("resolution"))[:100])
    offset = numbers_of(scale.get("voxel_offset"), 3) or (0.0, 0.0, 0.0)
    matrix = np.hstack([np.eye(4), np.zeros((4, 1))])
    matrix[range(3), range(3)] = resolution
    matrix[:3, 4] = [(first + 0.5) * length for first, length in zip(offset, resolution, strict=True)]
    return matrix
