"""Find groups and datasets of an HDF5 file, and read attributes of any type; no link to another file is followed."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.voxel_limits import describe_shape
from renderer.scene import short_text
from renderer.volume import Array, Float64

# An h5py.Group. A file is a group, too.
Group = Any
# An h5py.Dataset.
Dataset = Any

# The largest number of groups and datasets in a file. Visiting each takes about 0.1 ms.
_MAX_OBJECTS = 10_000
# The largest number of parts of a path, including the parts of links on it. A longer path is taken for a circle of
# links.
_MAX_PARTS = 100
# The largest ratio of the bytes of voxels to stored bytes that compression reaches, with several filters one after the
# other. With a larger ratio, a file claims voxels that it does not store.
_MAX_PACKING = 2**20
# The largest number of numbers or texts that are read from an attribute: more than an image has axes.
_MAX_ITEMS = 64


def open_inside(group: Group, path: str) -> Any:
    """Return the group or dataset at a path; None if there is none, or if it is in another file."""
    import h5py

    here, parts = group.file if path.startswith("/") else group, path.split("/")[::-1]
    for _ in range(_MAX_PARTS):
        while parts and parts[-1] in ("", "."):
            parts.pop()
        if not parts:
            return here
        if not isinstance(here, h5py.Group):
            return None
        name = parts.pop()
        link = here.get(name, getlink=True)
        if isinstance(link, h5py.SoftLink):
            here = here.file if link.path.startswith("/") else here
            parts += link.path.split("/")[::-1]
        elif isinstance(link, h5py.HardLink):
            here = here[name]
        else:
            return None
    return None


def dataset_at(group: Group, path: str) -> Dataset | None:
    """Return the dataset of numbers at a path; None if there is none, or if it is in another file."""
    import h5py

    found = open_inside(group, path)
    return found if isinstance(found, h5py.Dataset) and found.dtype.kind in "iufb" else None


def line_at(group: Group, path: str, length: int) -> Dataset | None:
    """Return the dataset of `length` numbers at a path; None if there is none, or if it is in another file."""
    found = dataset_at(group, path)
    return found if found is not None and found.shape == (length,) and is_in_file(found) else None


def groups_and_datasets(file: Group) -> Iterator[tuple[str, Any]]:
    """Yield the path and the object of each group and dataset of a file; raises InputError for too many."""
    objects: list[tuple[str, Any]] = []
    number = itertools.count()

    def visit(path: str, each: Any) -> Any:
        objects.append((path, each))
        return next(number) > _MAX_OBJECTS or None

    if file.visititems(visit):
        raise InputError("this file holds too many objects", expected=f"at most {_MAX_OBJECTS} groups and datasets")
    yield from objects


def is_in_file(dataset: Dataset) -> bool:
    """Return whether the numbers of a dataset are in the file itself."""
    return not (dataset.is_virtual or dataset.external)


def check_dataset(dataset: Dataset, path: Path) -> None:
    """Raise InputError for voxels in other files, and for more voxels than the stored bytes can hold."""
    if not is_in_file(dataset):
        raise InputError(
            "the voxels of this dataset are in other files, which are not opened",
            got=short_text(dataset.name),
            hint=f"`h5repack -l CONTI {short_text(path.name)} whole.h5` copies it into one file",
        )
    num_bytes = math.prod(dataset.shape) * dataset.dtype.itemsize
    num_stored = min(dataset.id.get_storage_size(), path.stat().st_size)
    if num_bytes > _MAX_PACKING * num_stored:
        raise InputError(
            "this dataset has fewer bytes than its voxels need",
            got=f"{num_stored} bytes for {describe_shape(dataset.shape[::-1])} voxels",
            hint="nothing was written to it, or the file is damaged",
        )


def decoded(dataset: Dataset, part: Sequence[int | slice]) -> Array:
    """Return the numbers of a part of a dataset, in native byte order. Raises InputError if they are damaged."""
    try:
        found: Array = dataset[tuple(part)]
    except OSError as error:
        raise InputError(
            "the voxels of this dataset cannot be decoded",
            where=short_text(f"{dataset.file.filename}, {dataset.name}"),
            got=short_text(" ".join(str(error).split())),
            hint="the file is damaged, or compressed by a filter that is not installed: `h5repack -f GZIP=4` "
            "compresses it by another",
        ) from error
    return found.astype(found.dtype.newbyteorder("="), copy=False)


def numbers(owner: Any, name: str) -> Float64:
    """Return the first numbers of an attribute, _MAX_ITEMS at most; an empty array if it has no numbers."""
    found = np.ravel(owner.attrs.get(name, ()))[:_MAX_ITEMS]
    return found.astype(np.float64) if found.dtype.kind in "iuf" else np.zeros(0)


def texts(owner: Any, name: str) -> list[str]:
    """Return the first texts of an attribute, _MAX_ITEMS at most; an empty list without texts, or without an owner."""
    found = np.ravel(() if owner is None else owner.attrs.get(name, ())).tolist()[:_MAX_ITEMS]
    return [each.decode("utf-8", "replace") if isinstance(each, bytes) else each
            for each in found if isinstance(each, (bytes, str))]  # fmt: skip


def text(owner: Any, name: str) -> str:
    """Return the text of an attribute that holds exactly one; an empty text for any other attribute, or no owner."""
    found = texts(owner, name)
    return found[0] if len(found) == 1 else ""
