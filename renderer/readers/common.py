"""The result type that all readers share, and the checks that hold for all formats.

Errors that name no place concern the file that is read: `errors_about` adds it, where that is known.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.readers.steps_in_time import TimeSteps
from renderer.readers.units import Units
from renderer.scene import MAX_WORLD_LENGTH, MIN_WORLD_LENGTH, join_some, missing_file_error, short_text
from renderer.system import free_bytes, free_swap_bytes
from renderer.volume import Array, Channel, Float64, Label, MappedFile, iter_slabs

T = TypeVar("T")

# Larger volumes are refused, whatever their header says: a corrupt header must not exhaust the machine's memory.
MAX_VOLUME_BYTES = 2**40

# Counts from here on are shown by their magnitude alone.
_MAX_SHOWN_COUNT = 10**15

# From this size on, voxels stay in their file if it stores them ready for use. Smaller volumes are copied: that is
# cheap, and the file may change.
_MIN_MAPPED_BYTES = 64 << 20

# Integers beyond 2^53 are rounded when they are drawn; at least this many steps of a volume's range remain.
_NUM_STEPS = 2**16

# How notes on guessed lengths begin, and the note for a file without any. A scene's own `spacing` makes them void.
GUESSED_LENGTHS = "the file does not give its voxel size"
NO_SPACING = f"{GUESSED_LENGTHS}; 1 x 1 x 1 is assumed"
# Of fields that may have lengths, a note names no more.
_MAX_NAMED = 8

# More components than the first are taken for spectra and the like. No more than the second are described.
MAX_LIGHTS, MAX_LISTED = 8, 1000

_PRIMARIES = {"R": (1.0, 0.0, 0.0), "G": (0.0, 1.0, 0.0), "B": (0.0, 0.0, 1.0)}


@dataclass(frozen=True)
class Image:
    """An image as a reader returns it: voxels as stored, and their place in the world.

    values: [z, y, x] of one time step and one component, an integer or float dtype in any byte order and memory layout,
        possibly mapped from a file.
    world_from_index: float64 [4, 4], (x, y, z) voxel index to world.
    notes: remarks on how they were read; None stands for none.
    nodata: ranges of values, both ends included, that stand for no data by what the file says.
    channels: of each component, where there are several.
    labels: those that the file describes, by value.
    steps: all that it has in time.
    units: of its lengths and values, and its axes.
    has_lengths: whether the format can say how long a voxel is.
    """

    values: Array
    world_from_index: Float64
    notes: tuple[str | None, ...] = ()
    nodata: tuple[tuple[float, float], ...] = ()
    channels: tuple[Channel, ...] = ()
    labels: tuple[Label, ...] = ()
    steps: TimeSteps = field(default=TimeSteps())
    units: Units = field(default=Units())
    has_lengths: bool = True


def no_spacing(names: Sequence[str]) -> str:
    """Return the note for a file without lengths in a known form. names: of its fields that may have them."""
    listed = ", ".join(short_text(name) for name in names[:_MAX_NAMED])
    return f"{GUESSED_LENGTHS} in a known form; 1 x 1 x 1 is assumed; not applied: {listed}" if names else NO_SPACING


def describe_count(n: int) -> str:
    """Return the digits of a count, or the magnitude of one that only a damaged header has."""
    return str(n) if n < _MAX_SHOWN_COUNT else f"about 10^{int(math.log10(n))}"


def describe_shape(shape_xyz: tuple[int, ...]) -> str:
    """Return `256 x 256 x 128`, without axes of length one after the third."""
    num = max(3, *(k + 1 for k, n in enumerate(shape_xyz) if n != 1), 0)
    return " x ".join(map(describe_count, shape_xyz[:num]))


def affine(spacing: npt.ArrayLike, origin: npt.ArrayLike, direction: npt.ArrayLike) -> Float64:
    """Return float64 [4, 4]: `direction @ diag(spacing)` and the origin; the columns of `direction` are the index
    axes."""
    world_from_index = np.eye(4)
    with np.errstate(over="ignore", invalid="ignore"):  # check_axes refuses what is not finite
        world_from_index[:3, :3] = np.asarray(direction, np.float64) * np.asarray(spacing, np.float64)
    world_from_index[:3, 3] = origin
    return world_from_index


def in_lps(world_from_index: Float64, factors: tuple[float, ...]) -> Float64:
    """Return the affine with x, y and z of the world multiplied by these factors, each 1 or -1, and without -0."""
    return np.asarray(world_from_index * np.array([*factors, 1.0])[:, np.newaxis] + 0.0, np.float64)


def scaled_type(stored: np.dtype[Any]) -> np.dtype[Any]:
    """Return the type of scaled values: float32 if stored ones have at most 16 bits or are float32, else float64."""
    is_short = stored.itemsize <= 2 or stored.newbyteorder("=") == np.float32
    return np.dtype(np.float32 if is_short else np.float64)


def scaled(values: Array, slope: float, intercept: float) -> Array:
    """Return `slope * values + intercept`, as of `scaled_type`; the values themselves for 1 and 0."""
    if (slope, intercept) == (1.0, 0.0):
        return values
    found = np.empty(values.shape, scaled_type(values.dtype))
    with np.errstate(over="ignore", invalid="ignore"):  # too large values become infinite, and are refused later
        for plane, target in zip(values, found, strict=True):  # the float64 product needs no second volume
            target[...] = plane.astype(np.float64) * slope + intercept
    return found


def bytes_of(values: Array) -> memoryview:
    """Return the memory of a contiguous array, byte by byte."""
    return memoryview(values.reshape(-1).view(np.uint8))  # type: ignore[arg-type]


def even_steps(coordinates: Array) -> tuple[float, float] | None:
    """Return the first of some coordinates and the step between them, which is 1 for one alone; None if it varies.

    A thousandth of a step is a rounding error, and so are the last digits of floats.
    """
    num_digits = np.finfo(coordinates.dtype).eps if coordinates.dtype.kind == "f" else 0.0
    coordinates = coordinates.astype(np.float64)
    if len(coordinates) == 1:
        return float(coordinates[0]), 1.0
    with np.errstate(over="ignore", invalid="ignore"):
        first, step = float(coordinates[0]), float(coordinates[-1] - coordinates[0]) / (len(coordinates) - 1)
        offsets = np.abs(coordinates - first - step * np.arange(len(coordinates)))
        largest = 1e-3 * abs(step) + 2 * num_digits * np.abs(coordinates).max()
    return (first, step) if step and np.all(offsets <= largest) else None


def has_volume(world_from_index: Float64) -> bool:
    """Return whether the affine is finite and its index axes span space, whatever their lengths."""
    if not np.isfinite(world_from_index).all():
        return False
    if not np.abs(world_from_index[:3, :3]).max(axis=0).all():
        return False
    _, axes = _directions(world_from_index)
    return abs(float(np.linalg.det(axes / np.linalg.norm(axes, axis=0)))) > 1e-6


def check_axes(world_from_index: Float64) -> None:
    """Raise InputError unless every voxel has a place and a volume, whatever its lengths."""
    if not has_volume(world_from_index):
        raise InputError(
            "the spacing, origin and direction give the voxels no volume",
            got=_in_words(world_from_index),
            expected="finite numbers, positive spacings and three independent axes",
            hint="correct them in the file's header, or export it again from its source",
        )


def check_lengths(world_from_index: Float64) -> None:
    """Raise InputError unless an affine has lengths that a scene may have."""
    sizes = np.abs(world_from_index[:3])
    if sizes.max() > MAX_WORLD_LENGTH or sizes[:, :3].max(axis=0).min() < MIN_WORLD_LENGTH:
        raise InputError(
            "the spacing or the origin is out of range",
            got=_in_words(world_from_index),
            expected=f"lengths from {MIN_WORLD_LENGTH:g} to {MAX_WORLD_LENGTH:g}",
            hint="give lengths in another unit",
        )


def _in_words(world_from_index: Float64) -> str:
    rows = ", ".join("[" + " ".join(f"{value:g}" for value in row) + "]" for row in world_from_index[:3])
    return f"{rows} (world from voxel index)"


def spacing_of(world_from_index: Float64) -> tuple[float, float, float]:
    """Return the lengths of the index axes, however long or short."""
    largest, unit = _directions(world_from_index)
    x, y, z = (largest * np.linalg.norm(unit, axis=0)).tolist()
    return x, y, z


def with_spacing(world_from_index: Float64, spacing: tuple[float, float, float]) -> Float64:
    """Return the affine, float64 [4, 4], with these lengths of its axes; directions and origin stay."""
    _, axes = _directions(world_from_index)
    return affine(spacing, world_from_index[:3, 3], axes / np.linalg.norm(axes, axis=0))


def _directions(world_from_index: Float64) -> tuple[Float64, Float64]:
    """Return the largest component of each index axis, float64 [3], and the axes divided by it, [3, 3].

    The squares of the divided axes neither overflow nor vanish.
    """
    largest = np.abs(world_from_index[:3, :3]).max(axis=0)
    return largest, world_from_index[:3, :3] / largest


def stays_mapped(num_bytes: int) -> bool:
    """Return whether this many bytes of voxels are left in their file."""
    return num_bytes >= _MIN_MAPPED_BYTES


def check_integer_resolution(values: Array, source: MappedFile | None) -> None:
    """Raise InputError for 64-bit integers whose differences float64, in which they are classified, would round
    away."""
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


def check_size(shape_xyz: tuple[int, ...], dtype: npt.DTypeLike) -> int:
    """Return the number of bytes of the voxels; raises InputError for none and for more than MAX_VOLUME_BYTES."""
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


def select_index(key: str, wanted: int | None, count: int) -> int:
    """Return which of `count` time steps or components to read: the first if none is wanted.

    key: the scene's key for it. Raises InputError if the one that is wanted does not exist.
    """
    if wanted is not None and not 0 <= wanted < count:
        raise InputError(
            f"there is no such {'time step' if key == 'time' else key}",
            got=f"{key}: {wanted}",
            expected=f"0 to {count - 1}" if count > 1 else f"0 or no `{key}` at all: the volume has one",
        )
    return wanted or 0


class Chosen(NamedTuple):
    """A choice of the part of an array that is read: one time step and one component.

    part: its index; step, component: their numbers. is_step: whether the time step was asked for.
    notes: one each if none of several time steps, and of several components, was asked for.
    channels: what is known of components that are only named; RGB and the like are no light.
    steps: how many there are in time.
    """

    part: tuple[int | slice, ...]
    step: int
    component: int
    is_step: bool
    notes: tuple[str, ...]
    channels: tuple[Channel, ...]
    steps: TimeSteps


def choose(
    axes: str,
    shape: tuple[int, ...],
    time: int | None,
    component: int | None,
    names: Sequence[str] = (),
    by_axis: Mapping[str, str] = MappingProxyType({}),
) -> Chosen:
    """Return which part of an array is read. Raises InputError if `time` or `component` do not fit.

    axes: a letter for each axis: `t` for time, `c` for components, `-` for one of which the first item is chosen, and
        any other for an axis in space. names: of the components, if they all have one. by_axis: what tells the items of
        an axis apart, by its letter.
    """
    lengths = {"t": 1, "c": 1} | dict(zip(axes, shape, strict=True))
    step, own = select_index("time", time, lengths["t"]), select_index("component", component, lengths["c"])
    about = {axis: f" (by {short_text(name)})" for axis, name in by_axis.items()}
    count, channels = lengths["c"], (Channel(),) * (min(lengths["c"], MAX_LISTED) if lengths["c"] > 1 else 0)
    if len(names) == count > 1:
        about["c"] = f" ({join_some(names)})"
        channels = tuple(Channel(name, _PRIMARIES.get(name), is_light=False) for name in names)
    may_be_colors = count in (3, 4) and "c" not in by_axis and _may_be_colors(names)
    hints = {"c": "; `component: color` draws the colours" * may_be_colors}
    notes = tuple(
        f"{lengths[letter]} {key}s{about.get(letter, '')}; the first is drawn; `{key}: k` chooses another"
        f"{hints.get(letter, '')}"
        for letter, key, wanted in (("t", "time", time), ("c", "component", component))
        if wanted is None and lengths[letter] > 1
    )
    part = tuple({"t": step, "c": own, "-": 0}.get(letter, slice(None)) for letter in axes)
    return Chosen(part, step, own, time is not None, notes, channels, TimeSteps(lengths["t"]))


def are_light(image: Image) -> bool:
    """Return whether each component is light of its own: by what the file says, else as integers that are no picture.

    Floats are vectors, and three or four bytes are colours, where the file does not say. Layers of labels are no light.
    """
    if image.labels or not 2 <= len(image.channels) <= MAX_LIGHTS:
        return False
    may_be_light = image.values.dtype.kind != "f" and (image.values.itemsize > 1 or len(image.channels) not in (3, 4))
    return all(may_be_light if each.is_light is None else each.is_light for each in image.channels)


def are_colors(dtype: npt.DTypeLike, channels: Sequence[Channel]) -> bool:
    """Return whether components are those of a colour: by their names, else as three or four bytes, no light."""
    names = [each.name for each in channels]
    if len(names) not in (3, 4) or any(each.is_light for each in channels):
        return False
    return names[:3] == ["R", "G", "B"] or (np.dtype(dtype) == np.uint8 and _may_be_colors(names))


def _may_be_colors(names: Sequence[str]) -> bool:
    """Return whether names are not those of something else: as of another space of colours, or of several arrays."""
    are_numbered = all(not name or name.endswith(f"[{number}]") for number, name in enumerate(names))
    return are_numbered or list(names[:3]) == ["R", "G", "B"]


def fitting_shapes(shape_xyz: tuple[int, ...], itemsize: int, num_bytes: int) -> list[tuple[int, ...]]:
    """Return the shapes that this many bytes fill, each with another length of one axis."""
    others = [itemsize * math.prod((*shape_xyz[:k], *shape_xyz[k + 1 :])) for k in range(len(shape_xyz))]
    return [
        (*shape_xyz[:k], num_bytes // other, *shape_xyz[k + 1 :])
        for k, other in enumerate(others)
        if num_bytes > 0 and num_bytes % other == 0
    ]


def require_exists(path: Path) -> Path:
    """Return the path; raises InputError if it does not exist or may not be read."""
    if path.exists():
        if not os.access(path, os.R_OK):
            raise InputError("no permission to read this", where=str(path))
        if not (path.is_file() or path.is_dir()):
            raise InputError("this is neither a file nor a folder", where=str(path))
        if path.is_file() and path.stat().st_size == 0:  # also a file of the kernel, whose content may be waited for
            raise InputError("an empty file", where=str(path))
        return path
    raise missing_file_error(path, "no such file or folder")


def labels_or_note(read: Callable[[], tuple[T, ...]]) -> tuple[tuple[T, ...], str | None]:
    """Return the labels that a file describes, and a note in place of wrong ones: voxels do not need them."""
    try:
        return read(), None
    except InputError as error:
        return (), f"what the file says of its labels is left out: {error.what} ({error.where})"


@contextmanager
def errors_about(where: Path | str) -> Iterator[None]:
    """Add a place, such as the file that is read, to the errors of the block that name none."""
    try:
        yield
    except InputError as error:
        error.where = error.where or str(where)
        raise


def damaged_error(what: str, got: str | None = None, expected: str | None = None) -> InputError:
    """Return the error for a file that has something else than it should."""
    return InputError(what, got=got, expected=expected, hint="the file is truncated or damaged")


def unreadable_error(error: Exception) -> InputError:
    """Return the error of an operating system or a library as an InputError, on one line."""
    text = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    shown = short_text(" ".join(text.split())) or type(error).__name__
    return InputError("cannot read this file", got=shown)
