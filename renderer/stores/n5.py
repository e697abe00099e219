"""Read the metadata of N5: one array, or an image with levels as N5 Viewer and Paintera write it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.stores.fields import list_of, mapping_of, mappings_of, numbers_of, text_of
from renderer.stores.levels import ImagePlan, LevelPlan, axis_named
from renderer.stores.store_files import N5_FILE, StoreFiles
from renderer.volume import Float64

# The largest number of levels.
_MAX_LEVELS = 32


def plan_at(files: StoreFiles, path: str) -> ImagePlan | None:
    """Return the image of N5 in a folder of a store; None if there is none. Raises InputError for a group without one.

    An array is an image. A group is an image if it has the levels `s0`, `s1` and so on, or a list of them.
    """
    own = files.json(path, N5_FILE)
    if own is not None and "dimensions" in own:
        return _plan({path: own}, {})
    group = own or {}
    found: dict[str, Mapping[str, Any]] = {}
    for name in _names_of_levels(group):
        level = f"{path}/{name}" if path else name
        fields = files.json(level, N5_FILE)
        if fields is None or "dimensions" not in fields:
            break
        found[level] = fields
    if found:
        return _plan(found, group)
    if own is None:
        return None
    raise InputError(
        "this group of N5 is no image",
        got="neither dimensions, nor the levels s0, s1, ...",
        expected="the path of an array or of an image in the store, as `dataset: NAME`",
    )


def _names_of_levels(group: Mapping[str, Any]) -> list[str]:
    listed = [text_of(each.get("path")) for scale in mappings_of(group.get("multiscales"))[:1]
              for each in mappings_of(scale.get("datasets"))]  # fmt: skip
    return listed[:_MAX_LEVELS] or [f"s{number}" for number in range(_MAX_LEVELS)]


def _plan(levels: Mapping[str, Mapping[str, Any]], group: Mapping[str, Any]) -> ImagePlan:
    first = next(iter(levels.values()))
    count = len(list_of(first.get("dimensions")))
    resolution, unit = _resolution({**group, **first}, count)
    names = [text_of(name) for name in list_of(first.get("axes")) or list_of(group.get("axes"))]
    if len(names) != count:
        names = list("xyz"[:count]) if count <= 3 else []
    factors = [numbers_of(each, min(count, 3)) for each in list_of(group.get("downsamplingFactors"))]
    plans = []
    for number, (path, fields) in enumerate(levels.items()):
        own = numbers_of(fields.get("downsamplingFactors"), min(count, 3))
        listed = factors[number] if number < len(factors) else None
        factor = own or listed or (None if number else (1.0,) * min(count, 3))
        plans.append(LevelPlan(path, None if factor is None else _matrix(factor, resolution, count)))
    if any(each.world_from_index is None for each in plans):
        plans = [each._replace(world_from_index=None) for each in plans]
    axes = tuple(axis_named(name, unit if name in ("x", "y", "z") else "") for name in names)
    if resolution is None:
        plans = [each._replace(world_from_index=None) for each in plans]
    return ImagePlan("n5", axes, tuple(plans), is_reversed=True)


def _resolution(fields: Mapping[str, Any], count: int) -> tuple[tuple[float, ...] | None, str]:
    """Return the lengths of a voxel and their unit: `pixelResolution` of N5 Viewer, or `resolution` of Paintera."""
    stated = mapping_of(fields.get("pixelResolution"))
    units = [text_of(unit) for unit in list_of(fields.get("units"))]
    unit = text_of(stated.get("unit")) or (units[0] if units else "")
    for value in (stated.get("dimensions"), fields.get("pixelResolution"), fields.get("resolution")):
        found = numbers_of(value, count) or numbers_of(value, min(count, 3))
        if found is not None and all(number > 0 for number in found):
            return found, unit
    return None, unit


def _matrix(factor: tuple[float, ...], resolution: tuple[float, ...] | None, count: int) -> Float64:
    """Return the place of a level: its first voxel is the mean of the first `factor` voxels of the finest level."""
    matrix = np.hstack([np.eye(count), np.zeros((count, 1))])
    for axis, (times, length) in enumerate(zip(factor, resolution or (1.0,) * len(factor), strict=False)):
        matrix[axis, axis] = times * length
        matrix[axis, count] = 0.5 * (times - 1.0) * length
    return matrix
