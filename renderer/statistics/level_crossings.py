"""Count how often rays cross a level of the values, and find whether levels lie inside one another."""

from __future__ import annotations

from itertools import pairwise

from renderer.statistics.classes import top_value
from renderer.statistics.voxel_sample import VoxelSample

# A surface of one value that rays cross at least this often, on average, hides all other surfaces.
MAX_CROSSINGS = 3.0
# A surface lies inside the surface of the next lower level if the number of times that rays cross it is less than this
# part of the number for the lower level.
_MAX_NESTED_RATIO = 0.85


def has_nested_levels(sample: VoxelSample, first: float) -> bool:
    """Return whether the surfaces of levels above `first` lie inside one another, as in a smooth field.

    In a scan of one material, the surfaces of all levels lie together at the surface of the material.
    """
    top = top_value(sample)
    found = [crossings(sample, first + (top - first) * part) for part in (0.15, 0.4, 0.65, 0.9)]
    return found[0] < MAX_CROSSINGS and all(high < _MAX_NESTED_RATIO * low for low, high in pairwise(found))


def crossings(sample: VoxelSample, level: float) -> float:
    """Return how often a ray through the volume crosses a level, on average."""
    changes = (sample.neighbours > level) != (sample.normalized > level)
    num_y, num_x = (n * stride for n, stride in zip(sample.normalized.shape[1:], sample.strides[1:], strict=True))
    return float(changes[:2].mean() * num_x + changes[2:].mean() * num_y) / 2
