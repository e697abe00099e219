"""Read the metadata of Zarr 2 and 3 without OME: one array, or the largest array of a group."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from renderer.stores.fields import list_of, mapping_of, number_of, text_of
from renderer.stores.levels import ImagePlan, LevelPlan, axis_named
from renderer.stores.store_files import StoreFiles

# The attributes of an array by which CF turns stored numbers into values: slope and intercept, with neutral values.
_SCALING = (("scale_factor", 1.0), ("add_offset", 0.0))
# The attributes of an array that name values of voxels without data.
_NODATA = ("_FillValue", "missing_value")


class Node(NamedTuple):
    """A group or an array of Zarr.

    driver: the name of its version in tensorstore. attributes: its attributes. shape: the shape of an array; None for a
    group. fields: its metadata.
    """

    driver: str
    attributes: Mapping[str, Any]
    shape: tuple[int, ...] | None
    fields: Mapping[str, Any]


def node_at(files: StoreFiles, path: str) -> Node | None:
    """Return the group or the array of Zarr in a folder of a store; None if there is none."""
    found = files.json(path, "zarr.json")
    if found is not None:
        is_array = found.get("node_type") == "array"
        return Node("zarr3", mapping_of(found.get("attributes")), _shape(found) if is_array else None, found)
    array, attributes = files.json(path, ".zarray"), files.json(path, ".zattrs")
    if array is not None:
        return Node("zarr", attributes or {}, _shape(array), array)
    group = attributes if attributes is not None else files.json(path, ".zgroup")
    return None if group is None else Node("zarr", attributes or {}, None, group)


def _shape(fields: Mapping[str, Any]) -> tuple[int, ...]:
    return tuple(int(number) for number in map(number_of, list_of(fields.get("shape"))) if number >= 0)


def arrays_in(files: StoreFiles, path: str, group: Node) -> dict[str, Node]:
    """Return the arrays below a group by their paths: as its own consolidated metadata list them, else by a search."""
    consolidated = mapping_of(mapping_of(group.fields.get("consolidated_metadata")).get("metadata"))
    if not consolidated and group.driver == "zarr":
        listed = mapping_of((files.json(path, ".zmetadata") or {}).get("metadata"))
        consolidated = {key.removesuffix("/.zarray"): None for key in listed if key.endswith("/.zarray")}
    names = [f"{path}/{name}" if path else name for name in consolidated] or [
        name for name in files.folders_of_arrays() if not path or name.startswith(f"{path}/")
    ]
    nodes = {name: node_at(files, name) for name in names}
    return {name: node for name, node in nodes.items() if node is not None and node.shape is not None}


def largest_array(arrays: Mapping[str, Node]) -> str:
    """Return the path of the array with the most voxels, the first of equals."""
    return max(arrays, key=lambda name: math.prod(arrays[name].shape or ()))


def plan_of_array(path: str, node: Node, *, is_only: bool) -> ImagePlan:
    """Return the plan of an array as an image of one level. is_only: whether its group has no other array."""
    names = [text_of(name) for name in _dimension_names(node)]
    nodata = [number for key in _NODATA if math.isfinite(number := number_of(node.attributes.get(key)))]
    stated = [(number_of(node.attributes.get(key)), neutral) for key, neutral in _SCALING]
    slope, intercept = (neutral if math.isnan(number) else number for number, neutral in stated)
    note = () if is_only else (f"the largest array, {path}, is read; `dataset: NAME` reads another",)
    axes = tuple(axis_named(name) for name in names) if len(names) == len(node.shape or ()) else ()
    level = LevelPlan(path)
    return ImagePlan(node.driver, axes, (level,), nodata=tuple(nodata), scaling=(slope, intercept), notes=note)


def _dimension_names(node: Node) -> list[Any]:
    return list(list_of(node.fields.get("dimension_names")) or list_of(node.attributes.get("_ARRAY_DIMENSIONS")))
