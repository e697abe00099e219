"""Read plain arrays: `.npy` and `.npz` files, and `raw` files without a header.

Arrays stay mapped from their file, except for arrays in `.npz` archives.
"""

from __future__ import annotations

import io
import lzma
import math
import struct
import zipfile
import zlib
from pathlib import Path
from tokenize import TokenError
from typing import IO, Any, Literal

import numpy as np

from renderer.errors import InputError
from renderer.readers.components import MAX_LIGHTS, choose, select_index
from renderer.readers.file_errors import damaged_error, require_exists, unreadable_error
from renderer.readers.image import Image
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.voxel_limits import check_dtype, check_memory, check_size, describe_shape, fitting_shapes
from renderer.scene import RawSource, format_value, join_some, short_text
from renderer.volume import Array

STATEMENTS = FormatTable(
    "NumPy",
    (
        Statement("descr", "values", "the type of numbers and the order of their bytes"),
        Statement("fortran_order", "place", "whether the first axis is the fastest"),
    ),
)

# The largest number of axes that an array may have in numpy 1; a volume has fewer.
_MAX_AXES = 32
# The largest length in bytes of the header of a `.npy` file: numpy's own limit.
_MAX_HEADER_BYTES = 10_000

# The largest ratio of decompressed to compressed bytes of an array in an archive: more than any method reaches for
# typical voxels.
_MAX_PACKING = 2**16
# The exceptions that Python's zipfile raises for damaged bytes.
_ARCHIVE_ERRORS = (
    zipfile.BadZipFile,
    zlib.error,
    lzma.LZMAError,
    struct.error,
    EOFError,
    OSError,
    RuntimeError,
    ValueError,
    ArithmeticError,
    LookupError,
)


def read_npy(path: Path, time: int | None, component: int | None) -> Image:
    """Read a `.npy` array [z, y, x] (or [y, x]), with spacing 1 and origin 0; booleans become 0 and 1.

    Four axes are [t, z, y, x] with `time: k`, and [z, y, x, c] or [c, z, y, x] with `component: k`; five axes are
    [t, z, y, x, c]. Pickled objects are never loaded. Raises InputError for files that are foreign, truncated or not
    numeric.
    """
    with path.open("rb") as file:
        shape, dtype, order = _npy_header(file, path)
        offset = file.tell()
    _check_npy_size(path.stat().st_size - offset, shape, dtype)
    values = np.memmap(path, dtype, "r", offset, shape, order)
    return _chosen(values, time, component)


def read_npz(path: Path, time: int | None, component: int | None) -> Image:
    """Read one array of a `.npz` archive as `read_npy` does; `component` chooses one of several arrays.

    Raises InputError for archives that are damaged, encrypted or hold no array.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            members = [member for member in archive.infolist() if member.filename.endswith(".npy")]
            if not members:
                raise InputError(
                    "this is a zip archive without arrays of NumPy, which is not read",
                    hint="unpack it, and name what is in it",
                )
            if len(members) > 1 and component is None:
                names = [short_text(member.filename.removesuffix(".npy")) for member in members]
                raise InputError(
                    f"this archive holds {len(members)} arrays, and one is rendered",
                    got=join_some([f"{k} is {name}" for k, name in enumerate(names)]),
                    expected=f"`component: k` with k from 0 to {len(members) - 1}",
                )
            member = members[select_index("component", component, len(members)) if len(members) > 1 else 0]
            with archive.open(member) as file:
                values = _unpacked(file, member, path)
    except _ARCHIVE_ERRORS as error:
        got, expected = short_text(str(error)), "an archive saved by numpy.savez"
        raise damaged_error("this archive cannot be read", got, expected) from error
    return _chosen(values, time, component if len(members) == 1 else None)


def _unpacked(file: IO[bytes], member: zipfile.ZipInfo, path: Path) -> Array:
    """Return an array of an archive; reading it to its end compares the checksum."""
    shape, dtype, _ = _npy_header(file, path)
    num_packed = min(member.compress_size, path.stat().st_size)
    _check_npy_size(min(member.file_size, _MAX_PACKING * num_packed) - file.tell(), shape, dtype)
    check_memory(math.prod(shape) * dtype.itemsize)
    file.seek(0)
    values: Array = np.lib.format.read_array(file, allow_pickle=False, max_header_size=_MAX_HEADER_BYTES)
    if file.read(1):
        raise EOFError("an array has another length than its header says")
    return values


def _chosen(values: Array, time: int | None, component: int | None) -> Image:
    """Return one time step and component of an array, as an image."""
    if values.dtype.kind == "b":
        values = values.view(np.uint8)
    if values.ndim == 2:
        values = values[np.newaxis]
    chosen = choose(axes_of_array(values.shape, time, component), values.shape, time, component)
    options: dict[str, Any] = {"channels": chosen.channels, "steps": chosen.steps, "has_lengths": False}
    return Image(values[chosen.part], np.eye(4), chosen.notes, **options)


def axes_of_array(shape: tuple[int, ...], time: int | None, component: int | None) -> str:
    """Return a letter for each axis of an array: `s` for space, `t` for time, `c` for components.

    Of four axes, the first one holds components if it is as short as channels are, and the last one is longer; else the
    last one does. Raises InputError if the axes are ambiguous or too many.
    """
    num_axes = len(shape)
    is_first = num_axes == 4 and shape[0] <= MAX_LIGHTS < shape[-1]
    if num_axes == 4 and time is None and component is None:
        raise _ambiguous_axes_error(shape, is_first=is_first)
    if not 3 <= num_axes <= 5 or (num_axes == 4 and time is not None and component is not None):
        raise InputError(
            "the array does not have the axes of a volume",
            got=f"{num_axes} axes, {describe_shape(shape) or 'a single number'}",
            expected="[z, y, x], or [time, z, y, x] with `time`, or [z, y, x, component] or [component, z, y, x] with "
            "`component`",
        )
    of_components = "csss" if is_first else "sssc"
    return {3: "sss", 4: of_components if time is None else "tsss", 5: "tsssc"}[num_axes]


def _ambiguous_axes_error(shape: tuple[int, ...], *, is_first: bool) -> InputError:
    """Return the error for four axes without a choice. is_first: whether components would be along the first axis."""
    num_components, place = (shape[0], "it") if is_first else (shape[-1], "the last axis")
    hint = "`component: color` draws a last axis of colours" if shape[-1] in (3, 4) else None
    return InputError(
        "the array has four axes",
        got=describe_shape(shape),
        expected=f"`time: k` with k from 0 to {shape[0] - 1} if the first axis is time, or "
        f"`component: k` with k from 0 to {num_components - 1} if {place} holds components",
        hint="`component: all` draws all components in one picture, each in a colour of its own" if is_first else hint,
    )


def _npy_header(file: IO[bytes], path: Path) -> tuple[tuple[int, ...], np.dtype[Any], Literal["C", "F"]]:
    """Return the shape, the dtype and the order of an array, and leave the file at the first byte of its values.

    Raises InputError for a file that is not an array.
    """
    try:
        if file.read(6) != b"\x93NUMPY":
            raise InputError("this is not a .npy file", expected="an array saved by numpy.save")
        version = (*file.read(2),)
        read_header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}
        if version not in read_header:
            raise InputError("this version of .npy is not supported", got=".".join(map(str, version)) or None)
        length = file.read(2 * version[0])
        num_bytes = int.from_bytes(length, "little")
        if num_bytes > _MAX_HEADER_BYTES:
            raise InputError(
                "the header is too long",
                got=f"{num_bytes} bytes",
                expected=f"at most {_MAX_HEADER_BYTES}",
                hint="the file is damaged",
            )
        shape, is_fortran, dtype = read_header[version](io.BytesIO(length + file.read(num_bytes)))
    except OSError as error:
        raise unreadable_error(error) from error
    except (ValueError, TypeError, SyntaxError, TokenError, EOFError, MemoryError, RecursionError) as error:
        # The errors that numpy and Python raise here have texts about program code, which would not help a user.
        got = "too many nested expressions" if isinstance(error, MemoryError | RecursionError) else None
        raise damaged_error("cannot read the header", got, "an array saved by numpy.save") from error
    if len(shape) > _MAX_AXES or any(type(n) is not int or n < 0 for n in shape):  # in Python, booleans are integers
        raise InputError(
            "the header has no shape of an array",
            got=f"{len(shape)} axes" if len(shape) > _MAX_AXES else format_value(shape),
            expected=f"at most {_MAX_AXES} axes, their lengths whole numbers from 0 on",
            hint="the file is damaged",
        )
    if dtype.kind != "b":
        check_dtype(dtype)
    return shape, dtype, "F" if is_fortran else "C"


def _check_npy_size(num_stored: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
    """Raise InputError for fewer bytes than the array has, and for an array that is empty or too large."""
    num_bytes = check_size(shape[::-1], dtype)
    if num_stored < num_bytes:
        raise InputError(
            "the file is shorter than its header says",
            got=f"{num_stored} bytes of voxels",
            expected=f"{num_bytes} bytes ({describe_shape(shape)} values of {dtype.name})",
            hint="the file is truncated",
        )


def map_raw(source: RawSource) -> Array:
    """Map headerless voxels, x fastest; raises InputError if the file's size does not fit the declaration."""
    path = require_exists(source.file)
    dtype = np.dtype(source.dtype).newbyteorder("<" if source.byte_order == "little" else ">")
    num_bytes = check_size(source.shape, dtype)
    if not path.is_file():
        raise InputError("this is not a file")
    found_bytes = path.stat().st_size - source.offset
    if found_bytes != num_bytes:
        after = f" after the offset of {source.offset}" if source.offset else ""
        raise InputError(
            "the size of the file does not fit the declared shape and type",
            got=f"{found_bytes} bytes{after}" if found_bytes >= 0 else f"{path.stat().st_size} bytes in all",
            expected=f"{num_bytes} bytes ({describe_shape(source.shape)} voxels of {source.dtype}){after}",
            hint=_fitting_declarations(source, found_bytes, num_bytes, dtype),
        )
    return np.memmap(path, dtype, "r", source.offset, source.shape[::-1])


def _fitting_declarations(source: RawSource, found_bytes: int, num_bytes: int, dtype: np.dtype[Any]) -> str | None:
    """Return a text with declarations that would fit the size of the file; None if there are none.

    Each differs from the given declaration in one property: the length of an axis, the size of the type, or the offset.
    """
    shapes = fitting_shapes(source.shape, dtype.itemsize, found_bytes)
    fits = [f"shape [{', '.join(map(str, shape))}]" for shape in shapes]
    num_voxels = num_bytes // dtype.itemsize
    if found_bytes in (num_voxels, 2 * num_voxels, 4 * num_voxels, 8 * num_voxels):
        fits.append(f"a type of {8 * found_bytes // num_voxels} bits")
    if found_bytes > num_bytes:
        fits.append(f"offset {source.offset + found_bytes - num_bytes}, if a header comes before the voxels")
    return "these would fit: " + "; ".join(fits) if fits else None
