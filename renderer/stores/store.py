"""Open a store: find its image by its metadata, open the arrays of its levels, and read the voxels of a box."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.scene import did_you_mean, join_some, short_text
from renderer.stores import n5, ome, precomputed
from renderer.stores.levels import Box, ImagePlan, Level, LevelPlan, OpenImage, StoredImage
from renderer.stores.library import REQUEST_SECONDS, errors_of_library, import_library, open_array
from renderer.stores.plain_zarr import Node, arrays_in, largest_array, node_at, plan_of_array
from renderer.stores.store_files import StoreFiles, require_inside
from renderer.volume import Array

# The fewest bytes in a second that a store has to give; with fewer, it counts as stalled.
_MIN_BYTES_PER_SECOND = 64 << 10
# The largest size of a decoded chunk in bytes. A chunk is decoded as a whole, whatever the box.
_MAX_CHUNK_BYTES = 4 << 30


class Store(OpenImage):
    """An open store."""

    def __init__(self, files: StoreFiles, image: StoredImage, arrays: Sequence[Any]) -> None:
        self._files, self._arrays = files, arrays
        self.image, self.marks = image, files.marks

    def read_box(self, level: int, box: Box, out: Array) -> None:
        """Read the voxels of a box of a level into an array (see OpenImage)."""
        library = import_library()
        seconds = REQUEST_SECONDS + out.nbytes / _MIN_BYTES_PER_SECOND
        with errors_of_library("the voxels of this store cannot be read", self._files.place):
            target = library.array(out, context=self._files.context)
            target.write(self._arrays[level][tuple(box)]).result(seconds)


def open_store(place: str, name: str = "") -> Store:
    """Open the image in a store, or the image with a name in it.

    place: the path of a folder or a ZIP archive, or a URL. name: the path of an image or an array in the store, empty
        for its only image. Raises InputError for a place without an image, and for metadata that contradict an array.
    """
    require_inside(name)
    files = StoreFiles(place)
    try:
        name, plan = _find(files, name.strip("/"))
    except InputError as error:
        raise files.refusal or error from None
    opened = [_open_level(files, plan, level) for level in plan.levels]
    return Store(files, StoredImage(plan, tuple(level for level, _ in opened), name), [array for _, array in opened])


def _find(files: StoreFiles, name: str) -> tuple[str, ImagePlan]:
    """Return the path and the plan of the image in a store. name: the path of an image, empty for the only one."""
    node = node_at(files, name)
    if node is not None:
        return _find_in_zarr(files, name, node)
    plan = n5.plan_at(files, name) or precomputed.plan_at(files, name)
    if plan is not None:
        return name, plan
    if name:
        root = node_at(files, "")
        known = list(_images_below(files, "", root)) if root is not None else []
        raise _several_error(known, name)
    raise InputError(
        "there is no store here",
        where=files.place,
        expected="zarr.json, .zattrs, .zgroup or .zarray (Zarr), attributes.json (N5), or info (Neuroglancer)",
        hint="name the folder, the archive or the URL in which one of these files lies",
    )


def _find_in_zarr(files: StoreFiles, name: str, node: Node) -> tuple[str, ImagePlan]:
    if node.shape is not None:
        return name, plan_of_array(name, node, is_only=True)
    if ome.is_image(node.attributes):
        plan = ome.plan_of(node.attributes, node.driver)
        levels = tuple(each._replace(path=f"{name}/{each.path}" if name else each.path) for each in plan.levels)
        return name, replace(plan, levels=levels)
    images = list(_images_below(files, name, node))
    if len(images) == 1:
        below = node_at(files, images[0])
        if below is not None:
            return _find_in_zarr(files, images[0], below)
    if images:
        raise _several_error(images)
    arrays = arrays_in(files, name, node)
    if not arrays:
        raise InputError(
            "this group of Zarr holds no image",
            where=files.place,
            got="neither metadata of OME nor an array",
            hint="servers do not list files: name the array, as `dataset: NAME`" if "://" in files.place else None,
        )
    path = largest_array(arrays)
    return path, plan_of_array(path, arrays[path], is_only=len(arrays) == 1)


def _images_below(files: StoreFiles, name: str, node: Node) -> Iterator[str]:
    """Yield the paths of the images of OME in the groups that a group names, such as wells of a plate.

    The groups of Bio-Formats have numbers: 0, 1 and so on.
    """
    listed = [f"{name}/{path}" if name else path for path in ome.images_in(node.attributes)]
    if not listed and "bioformats2raw.layout" in ome.ome_attributes(node.attributes):
        number = 0
        while node_at(files, f"{name}/{number}".strip("/")) is not None:
            yield f"{name}/{number}".strip("/")
            number += 1
    for path in listed:
        below = node_at(files, path)
        if below is None:
            continue
        if ome.is_image(below.attributes):
            yield path
        else:
            yield from (f"{path}/{inner}" for inner in ome.images_in(below.attributes))


def _several_error(paths: Sequence[str], wanted: str | None = None) -> InputError:
    """Return the error for a store of several images of which none is named, or of which `wanted` is none."""
    listed = join_some([short_text(path) for path in paths]) if paths else ""
    if wanted is None:
        expected = f"`dataset: NAME`, such as `dataset: {short_text(paths[0])}`"
        return InputError(f"this store holds {len(paths)} images, and one is rendered", got=listed, expected=expected)
    return InputError(
        "there is no such image in this store",
        got=f"dataset: {short_text(wanted)}",
        expected=listed or "the path of an image or an array in the store",
        hint=did_you_mean(wanted[:200], paths),
    )


def _open_level(files: StoreFiles, plan: ImagePlan, level: LevelPlan) -> tuple[Level, Any]:
    """Return a level and its open array. Raises InputError if the metadata of the image contradict the array."""
    where = f"{files.place}, {level.path}" if level.path else files.place
    with errors_of_library("an array of this store cannot be opened", where):
        array = open_array(plan.driver, files.kvstore(level.path), dict(level.options), files.context)
        shape, chunks = tuple(array.shape), tuple(array.chunk_layout.read_chunk.shape or array.shape)
        dtype = np.dtype(array.dtype.numpy_dtype)
        files.mark(json.dumps(array.spec().to_json(), sort_keys=True).encode())
    if plan.axes and len(plan.axes) != len(shape):
        raise InputError(
            "the metadata of this image contradict its array",
            where=where,
            got=f"{len(plan.axes)} axes ({', '.join(short_text(axis.name) for axis in plan.axes)})",
            expected=f"{len(shape)} axes, as the array has the shape {' x '.join(map(str, shape))}",
        )
    num_bytes = dtype.itemsize * math.prod(map(min, chunks, shape))
    if num_bytes > _MAX_CHUNK_BYTES:
        expected = f"at most {_MAX_CHUNK_BYTES >> 30} GiB, as a chunk is decoded as a whole"
        got = f"{' x '.join(map(str, chunks))} voxels, {num_bytes / 2**30:.1f} GiB"
        raise InputError("the chunks of this array are too large", where=where, got=got, expected=expected)
    return Level(level.path, shape, chunks, dtype, level.world_from_index), array
