"""Check the number, the size and the type of voxels before memory is taken for them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.system import free_bytes, free_swap_bytes
from renderer.volume import Array, MappedFile, iter_slabs

# The largest size of a volume in bytes, whatever its header says: a corrupt header must not exhaust the memory of the
# machine.
MAX_VOLUME_BYTES = 2**40
# A count from this number on is shown by its magnitude alone, such as about 10^18.
_MAX_SHOWN_COUNT = 10**15
# Voxels of at least this many bytes stay in their file, if the file stores them ready for use. Smaller volumes are
# copied, as copies are cheap, and the file may change.
_MIN_MAPPED_BYTES = 64 << 20
# Integers beyond 2^53 are rounded to float64 when they are drawn. A volume of such integers is refused unless its
# values span at least this many steps between neighbouring numbers of float64.
_NUM_STEPS = 2**16


def describe_count(n: int) -> str:
    """Return the digits of a count, or its magnitude if it is so large that only a damaged header can have it."""
    return str(n) if n < _MAX_SHOWN_COUNT else f"about 10^{int(math.log10(n))}"


def describe_shape(shape_xyz: tuple[int, ...]) -> str:
    """Return a shape as in `256 x 256 x 128`, without axes of length one after the third."""
    num = max(3, *(k + 1 for k, n in enumerate(shape_xyz) if n != 1), 0)
    return " x ".join(map(describe_count, shape_xyz[:num]))


def stays_mapped(num_bytes: int) -> bool:
    """Return whether voxels of this many bytes stay in their file."""
    return num_bytes >= _MIN_MAPPED_BYTES


def check_integer_resolution(values: Array, source: MappedFile | None) -> None:
    """Raise InputError for 64-bit integers whose differences would be lost in float64, in which they are classified."""
    if values.dtype.kind not in "iu" or values.dtype.itemsize < 8:
        return
    ends = [(int(slab.min()), int(slab.max())) for slab in iter_slabs(values, source)]
    low, high = min(low for low, _ in ends), max(high for _, high in ends)
    largest = max(abs(low), abs(high))
    step = int(math.ulp(float(largest)))
    if largest > 2**53 and low < high < low + _NUM_STEPS * step:
        raise InputError(
            "these integers are too large for their differences to be drawn",
            got=f"values from {low} to {high}, where numbers of float64 are {step} apart",
            expected=f"integers from -2^53 to 2^53, or a range of {_NUM_STEPS * step} or more",
            hint="subtract the smallest value before saving",
        )


def check_dtype(dtype: np.dtype[np.void] | npt.DTypeLike) -> None:
    """Raise InputError unless the dtype is an integer of up to 64 bits or a float of 16, 32 or 64."""
    kind = np.dtype(dtype)
    if kind.kind in "iu" or (kind.kind == "f" and kind.itemsize <= 8):
        return
    hints = {
        "b": "save it as uint8",
        "c": "save its magnitude or its real part",
        "V": "save one of its fields as a separate array",
        "O": "save it as an array of numbers; Python objects are never loaded",
    }
    raise InputError(
        "voxels of this type cannot be rendered",
        got=kind.name if kind.names is None else f"records with the fields {', '.join(kind.names)}",
        expected="int8 to int64, uint8 to uint64, float16, float32 or float64",
        hint=hints.get(kind.kind) if kind.kind != "V" or kind.names else None,
    )


def check_crop(ranges: Sequence[tuple[int, ...]], shape_xyz: tuple[int, ...]) -> None:
    """Raise InputError for half-open ranges of voxels along x, y and z that are empty or reach outside the volume."""
    for axis, (begin, end), n in zip("xyz", ranges, shape_xyz, strict=True):
        if not 0 <= begin < end <= n:
            raise InputError(
                f"the crop does not fit the volume along {axis}",
                got=f"[{begin}, {end}]",
                expected=f"[first, end] with 0 <= first < end <= {n}",
            )


def check_size(shape_xyz: tuple[int, ...], dtype: npt.DTypeLike) -> int:
    """Return the number of bytes of voxels. Raises InputError for no voxels, and for more than MAX_VOLUME_BYTES."""
    num_bytes = np.dtype(dtype).itemsize
    for n in shape_xyz:
        num_bytes *= int(n)
    if min(shape_xyz, default=1) < 1:
        raise InputError("the volume has no voxels", got=describe_shape(shape_xyz))
    if num_bytes > MAX_VOLUME_BYTES:
        num_gibibytes = describe_count(-(-num_bytes // 2**30))
        raise InputError(
            "the volume is too large",
            got=f"{describe_shape(shape_xyz)} voxels of {np.dtype(dtype).name}, {num_gibibytes} GiB",
            expected=f"at most {MAX_VOLUME_BYTES / 2**30:.0f} GiB",
            hint="if the file is smaller than that, its header is wrong",
        )
    return num_bytes


def check_memory(num_bytes: int) -> None:
    """Raise InputError unless decoded voxels of this size fit into memory and swap space."""
    if num_bytes > free_bytes() + free_swap_bytes():
        raise InputError(
            "the voxels of this file do not fit into memory",
            got=f"{num_bytes / 2**30:.1f} GiB",
            expected=f"at most the {free_bytes() / 2**30:.1f} GiB that are free",
            hint="store them without compression, as NRRD or MetaImage: then they stay in their file",
        )


def fitting_shapes(shape_xyz: tuple[int, ...], itemsize: int, num_bytes: int) -> list[tuple[int, ...]]:
    """Return the shapes that fill exactly `num_bytes` and differ from `shape_xyz` in the length of one axis."""
    others = [itemsize * math.prod((*shape_xyz[:k], *shape_xyz[k + 1 :])) for k in range(len(shape_xyz))]
    return [
        (*shape_xyz[:k], num_bytes // other, *shape_xyz[k + 1 :])
        for k, other in enumerate(others)
        if num_bytes > 0 and num_bytes % other == 0
    ]
