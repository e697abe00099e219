"""Read a folder of masks, one file for each label, as one volume of labels. TotalSegmentator writes such folders.

Each mask is a NIfTI file on the same grid, with 1 inside of its label and 0 elsewhere, and is named after the label.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.readers.components import select_index
from renderer.readers.file_errors import errors_about
from renderer.readers.image import Image
from renderer.readers.nifti import read_nifti
from renderer.readers.segments import overlap_clause
from renderer.readers.sniff import masks_in
from renderer.readers.voxel_limits import check_memory, check_size, describe_shape
from renderer.scene import counted
from renderer.volume import Array, Label

# The ends of names that the names of labels leave out.
_SUFFIXES = (".nii", ".nii.gz")


def read_masks(path: Path, time: int | None, component: int | None) -> Image:
    """Read the masks in a folder as labels 1, 2, ..., in natural order of their names; empty masks have no label.

    A voxel in several masks belongs to the smallest one, as `join_segments` has it, but each mask is read only once.
    Raises InputError for damaged masks, for masks of different sizes, and for values other than 0 and 1.
    """
    select_index("time", time, 1)
    select_index("component", component, 1)
    files = masks_in(path)
    if not files:
        raise InputError("these masks changed while they were read", hint="read them when all are written")
    labels = list[Label]()
    with errors_about(files[0]):
        image = read_nifti(files[0], None, None)
    shape, dtype = image.values.shape, np.min_scalar_type(len(files))
    check_memory(check_size(shape[::-1], dtype) // dtype.itemsize * (dtype.itemsize + 2))
    numbers, are_shared = np.zeros(shape, dtype), np.zeros(shape, np.bool_)
    image = replace(image, values=numbers)
    sizes = np.zeros(len(files) + 1, np.int64)  # the number of voxels of each mask that was read, by its label
    for number, file in enumerate(files, 1):
        with errors_about(file):
            inside = _inside(read_nifti(file, None, None).values, shape)
        before = numbers[inside]
        sizes[number] = before.size
        if before.size:
            labels.append(Label(number, _name(file)))
        numbers[inside] = np.where((before == 0) | (sizes[before] >= before.size), number, before)
        are_shared[inside] |= before > 0
    num_empty = len(files) - len(labels)
    notes = [f"its {len(files)} masks are one volume of labels"]
    notes += [f"{counted(num_empty, 'mask')} without a voxel"] if num_empty else []
    notes.append(overlap_clause(are_shared, "masks"))
    note = "; ".join(filter(None, notes))
    return Image(numbers, image.world_from_index, (note,), labels=tuple(labels), units=image.units)


def _inside(values: Array, shape: tuple[int, ...]) -> Array:
    """Return which voxels of a mask are 1, bool [z, y, x]. shape: the shape that it must have."""
    if values.shape != shape:
        got, expected = describe_shape(values.shape[::-1]), describe_shape(shape[::-1])
        raise InputError("masks of one folder have the same grid", got=got, expected=expected)
    inside = np.asarray(values == 1)
    if np.count_nonzero(values) != np.count_nonzero(inside):
        other = values[~inside & (values != 0)][0]
        what, hint = "a mask beside others has only 0 and 1", "name the volumes themselves, such as 'folder/*.nii.gz'"
        raise InputError(what, got=f"a voxel of {other}", expected="0 or 1", hint=hint)
    return inside


def _name(file: Path) -> str:
    """Return the name of the label of a mask, from the name of its file."""
    end = next(end for end in sorted(_SUFFIXES, key=len, reverse=True) if file.name.lower().endswith(end))
    return file.name[: -len(end)]
