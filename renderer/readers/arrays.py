"""Read plain arrays: `.npy` files and headerless `raw` ones, mapped into memory so that a crop reads only its part."""

from __future__ import annotations

import math
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import (
    Image,
    affine,
    check_dtype,
    check_size,
    describe_shape,
    require_exists,
    select_index,
    unreadable_error,
)
from renderer.scene import ArraySource, RawSource
from renderer.volume import Array

# The largest number of axes in any version of numpy; a volume has fewer.
_MAX_AXES = 32


def read_npy(path: Path, time: int | None, component: int | None) -> Image:
    """Read a `.npy` array [z, y, x] (or [y, x]), with spacing 1 and origin 0.

    A fourth axis is the first with `time: k` ([t, z, y, x]) and the last with `component: k` ([z, y, x, c]); five axes
        are [t, z, y, x, c]. Pickled objects are never loaded. Raises InputError for files that are foreign, truncated
        or not numeric.
    """
    where = str(path)
    values = _map_npy(path)
    if values.ndim == 2:
        values = values[np.newaxis]
    if values.ndim == 4 and time is None and component is None:
        raise InputError(
            "the array has four axes",
            where=where,
            got=describe_shape(values.shape),
            expected=f"`time: k` with k from 0 to {values.shape[0] - 1} if the first axis is time, or "
            f"`component: k` with k from 0 to {values.shape[-1] - 1} if the last axis holds components",
        )
    if not 3 <= values.ndim <= 5 or (values.ndim == 4 and time is not None and component is not None):
        raise InputError(
            "the array does not have the axes of a volume",
            where=where,
            got=f"{values.ndim} axes, {describe_shape(values.shape) or 'a single number'}",
            expected="[z, y, x], or [time, z, y, x] with `time`, or [z, y, x, component] with `component`",
        )
    has_time = values.ndim == 5 or (values.ndim == 4 and time is not None)
    has_component = values.ndim - has_time == 4
    step = select_index("time", time, values.shape[0] if has_time else 1, where)
    channel = select_index("component", component, values.shape[-1] if has_component else 1, where)
    values = values[step] if has_time else values
    values = values[..., channel] if has_component else values
    return Image(values, np.eye(4))


def read_array(source: ArraySource) -> Image:
    """Return the array of a scene that is made in Python, with origin 0; a read-only view, so that it is never
    changed."""
    values = source.values.view()
    values.flags.writeable = False
    return Image(values, np.diag([*source.spacing, 1.0]))


def _map_npy(path: Path) -> Array:
    where = str(path)
    try:
        with path.open("rb") as file:
            if file.read(6) != b"\x93NUMPY":
                raise InputError(
                    "this is not a .npy file",
                    where=where,
                    got="an empty file" if path.stat().st_size == 0 else None,
                    expected="an array saved by numpy.save",
                )
            file.seek(0)
            version = np.lib.format.read_magic(file)
            read_header = {
                (1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0,
            }
            if version not in read_header:
                raise InputError("this version of .npy is not supported", where=where, got=f"{version[0]}.{version[1]}")
            shape, is_fortran, dtype = read_header[version](file)
            offset = file.tell()
    except OSError as error:
        raise unreadable_error(path, error) from error
    except (ValueError, TypeError, SyntaxError, TokenError, EOFError, MemoryError, RecursionError) as error:
        # Errors of numpy's header parser and of Python's own, whose texts concern program code.
        raise InputError(
            "cannot read the header",
            where=where,
            got="too many nested expressions" if isinstance(error, MemoryError | RecursionError) else None,
            expected="an array saved by numpy.save",
            hint="the file is truncated or damaged",
        ) from error
    if len(shape) > _MAX_AXES or any(n < 0 for n in shape):  # which numpy writes, and maps, in no file
        raise InputError(
            "the header has no shape of an array",
            where=where,
            got=f"{len(shape)} axes" if len(shape) > _MAX_AXES else f"a length of {min(shape)}",
            expected=f"at most {_MAX_AXES} axes, none of them negative",
            hint="the file is damaged",
        )
    check_dtype(dtype, where)
    num_bytes = check_size(shape[::-1], dtype, where)
    stored_bytes = path.stat().st_size - offset
    if stored_bytes < num_bytes:
        raise InputError(
            "the file is shorter than its header says",
            where=where,
            got=f"{stored_bytes} bytes of voxels",
            expected=f"{num_bytes} bytes ({describe_shape(shape)} values of {dtype.name})",
            hint="the file is truncated",
        )
    return np.memmap(path, dtype, "r", offset, shape, "F" if is_fortran else "C")


def read_raw(source: RawSource) -> Image:
    """Read headerless voxels, x fastest, with origin 0; raises InputError if the file's size does not fit the
    declaration."""
    path, where = require_exists(source.file), str(source.file)
    try:
        dtype = np.dtype(source.dtype).newbyteorder("<" if source.byte_order == "little" else ">")
    except TypeError as error:
        raise InputError(
            "no such data type", where=where, got=source.dtype, expected="a numpy name such as uint8, int16 or float32"
        ) from error
    check_dtype(dtype, where)
    num_bytes = check_size(source.shape, dtype, where)
    if not path.is_file():
        raise InputError("this is not a file", where=where)
    found_bytes = path.stat().st_size - source.offset
    if found_bytes != num_bytes:
        after = f" after the offset of {source.offset}" if source.offset else ""
        raise InputError(
            "the size of the file does not fit the declared shape and type",
            where=where,
            got=f"{found_bytes} bytes{after}" if found_bytes >= 0 else f"{path.stat().st_size} bytes in all",
            expected=f"{num_bytes} bytes ({describe_shape(source.shape)} voxels of {source.dtype}){after}",
            hint=_fitting_declarations(source, found_bytes, num_bytes, dtype),
        )
    z_y_x = source.shape[::-1]
    try:
        values = np.memmap(path, dtype, "r", source.offset, z_y_x)
    except OSError as error:
        raise unreadable_error(path, error) from error
    return Image(values, affine(source.spacing, np.zeros(3), np.eye(3)))


def _fitting_declarations(source: RawSource, found_bytes: int, num_bytes: int, dtype: np.dtype[Any]) -> str | None:
    """Return declarations that would fit and differ in one thing: the length of an axis, the type's size or the
    offset."""
    fits = []
    for axis in range(3):
        other = dtype.itemsize * math.prod(source.shape[:axis] + source.shape[axis + 1 :])
        if found_bytes > 0 and found_bytes % other == 0:
            shape = (*source.shape[:axis], found_bytes // other, *source.shape[axis + 1 :])
            fits.append(f"shape [{', '.join(map(str, shape))}]")
    num_voxels = num_bytes // dtype.itemsize
    if found_bytes in (num_voxels, 2 * num_voxels, 4 * num_voxels, 8 * num_voxels):
        fits.append(f"a type of {8 * found_bytes // num_voxels} bits")
    if found_bytes > num_bytes:
        fits.append(f"offset {source.offset + found_bytes - num_bytes}, if a header comes before the voxels")
    return "these would fit: " + "; ".join(fits) if fits else None
