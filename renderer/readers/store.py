"""Read an image in levels, of a store (OME-Zarr, Zarr, N5, Neuroglancer) or of HDF5, in a child process.

One level, one time step and one component of it is read, and only the chunks of a crop.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import NO_SPACING, has_volume
from renderer.readers.axis_letters import letters_of
from renderer.readers.components import Chosen, choose
from renderer.readers.image import Image
from renderer.readers.isolation import Host
from renderer.readers.scaled_values import scaled, scaled_type
from renderer.readers.statements import FormatTable, Statement
from renderer.readers.steps_in_time import TimeSteps, even_steps_at, steps_at
from renderer.readers.store_blocks import Blocks, Ranges
from renderer.readers.units import Units, one_spelling, units_of
from renderer.readers.voxel_limits import check_crop, check_dtype, check_size
from renderer.scene import short_text
from renderer.stores import Axis, Box, ImagePlan, Level, OpenImage, open_store, slabs_of
from renderer.system import start_threads
from renderer.volume import Array, Channel, Float64, VolumeLevel

STATEMENTS = FormatTable(
    "Stores (OME-Zarr, Zarr, N5, Neuroglancer)",
    (
        Statement("axes", "place", "the order of axes"),
        Statement("axes.unit", "meaning", "the unit of lengths"),
        Statement("axes.orientation", "place", "directions in a body"),
        Statement("datasets.coordinateTransformations", "place", "the place of each level"),
        Statement("coordinateTransformations", "place", "the place of all levels"),
        Statement("coordinateTransformations.type", "place", "displacements, and other transformations", False),
        Statement("omero.channels.label", "meaning", "the names of channels"),
        Statement("omero.channels.color", "meaning", "the colours of channels"),
        Statement("omero.channels.window", "meaning", "the windows of channels"),
        Statement("omero.channels.active", "meaning", "channels that are not shown"),
        Statement("omero.channels.inverted", "meaning", "channels whose colours are inverted", False),
        Statement("image-label.colors", "meaning", "the colours of labels"),
        Statement("image-label.properties", "meaning", "the names of labels"),
        Statement("_ARRAY_DIMENSIONS", "place", "the names of axes"),
        Statement("dimension_names", "place", "the names of axes"),
        Statement("_FillValue", "validity", "a value without data"),
        Statement("missing_value", "validity", "a value without data"),
        Statement("scale_factor", "values", "the slope of values"),
        Statement("add_offset", "values", "the intercept of values"),
        Statement("pixelResolution", "place", "the lengths of a voxel"),
        Statement("downsamplingFactors", "place", "the place of each level"),
        Statement("resolution", "place", "the lengths of a voxel"),
        Statement("voxel_offset", "place", "the place of the first voxel"),
    ),
)

# The address space, in bytes, that the threads of tensorstore reserve and do not use: memory pools of 64 MiB each.
_RESERVED_BYTES = 1 << 30
# The number of chunks that are held at a time, encoded or decoded, beside the voxels: 32 requests, and two of each of
# 4 decoders.
_NUM_HELD_CHUNKS = 40
# The slope and the intercept of stored numbers that are values.
_NO_SCALING = (1.0, 0.0)
# The largest number of pieces of a level that are read at a time. A piece of few chunks does not fill the requests that
# may be sent at a time.
_NUM_PIECES = 64
# The number of decoded bytes of pieces that are read at a time; two pieces are in any case. The second one keeps
# requests in flight while the last chunks of the first one are waited for.
_BYTES_AT_A_TIME = 128 << 20
# For each orientation of an axis: the axis of LPS along which it lies, and whether it has the same direction.
_ORIENTATIONS = {
    "right-to-left": (0, 1.0),
    "left-to-right": (0, -1.0),
    "anterior-to-posterior": (1, 1.0),
    "posterior-to-anterior": (1, -1.0),
    "inferior-to-superior": (2, 1.0),
    "superior-to-inferior": (2, -1.0),
}


class _Layout(NamedTuple):
    """The meaning of the axes of a store's arrays.

    letters: for each axis of the array, `t`, `c`, `s` or `-` as in `choose`. space: the axes of the array that are z, y
    and x, in this order; None for an axis that it lacks.
    """

    letters: str
    space: tuple[int | None, ...]


class Wanted(NamedTuple):
    """The part of an image that is wanted.

    time, component: the scene's choice, None without one. dataset: the name of the image, None for the only one. level:
    the number of the level, None for the finest one whose voxels take at most `most_bytes`. crop: ranges of voxels of
    the finest level along x, y, z. blocks: the blocks that are read, as of `Blocks.to_plain`; other voxels are 0. It is
    empty to read none, and None to read all. in_blocks: whether voxels come as an array of blocks, as of
    `Blocks.shape_in`.
    """

    time: int | None = None
    component: int | None = None
    dataset: str | None = None
    level: int | None = None
    crop: Sequence[Sequence[int] | None] | None = None
    most_bytes: float = math.inf
    blocks: Sequence[Any] | None = None
    in_blocks: bool = False


def read_store(place: Path | str, *, host: Host, **wanted: Any) -> Image:
    """Read a part of the image in a store, or of the named one. wanted: the fields of `Wanted`.

    Raises InputError for stores that are damaged or hold no such image.
    """
    host.expect_bytes(_RESERVED_BYTES)
    part = Wanted(**wanted)
    return read_levels(open_store(str(place), part.dataset or ""), part, host)


def read_levels(store: OpenImage, wanted: Wanted, host: Host) -> Image:
    """Read one level, time step and component of an image in levels, and only the chunks of a crop."""
    finest, plan = store.levels[0], store.image.plan
    check_dtype(finest.dtype)
    layout = _layout(store, wanted.time, wanted.component)
    names = [each.name for each in plan.channels]
    chosen = choose(layout.letters, finest.shape, wanted.time, wanted.component, names if all(names) else ())
    places = [_place(each, finest, layout, plan.axes) for each in store.levels]
    boxes = [_box(wanted.crop, _shape(finest, layout), each, layout, relative) for each, relative in
             zip(store.levels, (np.linalg.inv(places[0]) @ place for place in places), strict=True)]  # fmt: skip
    sizes = [_value_type(store, each).itemsize * math.prod(end - begin for begin, end in box)
             for each, box in zip(store.levels, boxes, strict=True)]  # fmt: skip
    number, level_note = choose_level(sizes, wanted.level, wanted.most_bytes)
    box = boxes[number]
    values = _read(store, number, _Part(box, layout, chosen, wanted.blocks, wanted.in_blocks), host)
    slope, intercept = plan.scaling
    units, unit_note = _units(plan.axes, layout)
    turned, axes = _in_body(places[number], plan.axes, layout)
    name = store.image.name
    dataset_note = f"the image {short_text(name)} is read" if name and not wanted.dataset else None
    no_lengths = NO_SPACING if finest.world_from_index is None else None
    return Image(
        values,
        turned,
        (dataset_note, *plan.notes, level_note, no_lengths, unit_note, *chosen.notes, STATEMENTS.note(plan.unapplied)),
        tuple((value, value) for value in (slope * stored + intercept for stored in plan.nodata)),
        _channels(plan.channels, chosen),
        plan.labels,
        _steps(finest, plan, layout, chosen.steps.num_times),
        units_of(units.length_unit, axes),
        levels=tuple(_facts(each, layout, each is store.levels[number]) for each in store.levels),
        box=box,
        marks=store.marks,
        finest_from_index=np.linalg.inv(places[0]) @ places[number],
    )


def choose_level(sizes: Sequence[int], wanted: int | None, most_bytes: float) -> tuple[int, str | None]:
    """Return the number of the level that is read, and a note on it if the store has several.

    sizes: the bytes of the voxels of each level. wanted: the level in the scene; None for the finest level that takes
    at most `most_bytes`, or the coarsest. Raises InputError if there is no such level.
    """
    last = len(sizes) - 1
    if wanted is not None:
        if wanted > last:
            expected = f"0 to {last}" if last else "0 or no `level` at all: the image has one"
            raise InputError("there is no such level", got=f"level: {wanted}", expected=expected)
        return wanted, None
    if last == 0:
        return 0, None
    number = next((each for each, size in enumerate(sizes) if size <= most_bytes), last)
    why = "the finest" if number == 0 else "the finest that fits into a quarter of the free memory"
    if sizes[number] > most_bytes:
        why = "the coarsest"
    return number, f"{last + 1} levels; level {number}, {why}, is drawn; `level: k` chooses another"


class _Part(NamedTuple):
    """The part of a level that is read. box: its ranges of voxels along x, y, z. blocks, in_blocks: as in `Wanted`."""

    box: Ranges
    layout: _Layout
    chosen: Chosen
    blocks: Sequence[Any] | None
    in_blocks: bool

    @property
    def _shape(self) -> tuple[int, ...]:
        """Return the shape of the array of voxels."""
        if self.in_blocks and self.blocks:
            return Blocks.from_plain(*self.blocks).shape_in(self.box)
        return tuple(end - begin for begin, end in self.box[::-1])

    def boxes(self) -> Sequence[Ranges]:
        """Return the boxes that are read."""
        if self.blocks is None:
            return [self.box]
        if not self.blocks:
            return []
        blocks = Blocks.from_plain(*self.blocks)
        return [ranges for _, ranges in blocks.tiles(self.box)] if self.in_blocks else [*blocks.boxes(self.box)]

    def allocate(self, dtype: np.dtype[Any], host: Host) -> Array:
        """Return zeros for the voxels."""
        check_size(self._shape[::-1], dtype)
        host.require_room(dtype.itemsize * sum(math.prod(end - begin for begin, end in box) for box in self.boxes()))
        return host.allocate(self._shape, dtype)

    def targets(self, values: Array) -> Iterator[tuple[list[int | slice], Array]]:
        """Yield the boxes, in the axes of the store's array, with the parts of `values` that they fill."""
        if self.in_blocks and self.blocks:
            blocks = Blocks.from_plain(*self.blocks)
            for place, ranges in blocks.tiles(self.box):
                yield self._target(ranges, values[place][blocks.part_of_tile(ranges)])
            return
        for box in self.boxes():
            pairs = zip(box[::-1], self.box[::-1], strict=True)
            yield self._target(
                box, values[tuple(slice(low - first, high - first) for (low, high), (first, _) in pairs)]
            )

    def _target(self, box: Ranges, values: Array) -> tuple[list[int | slice], Array]:
        """Return a box in the axes of the store's array, and its voxels [z, y, x] in the order of these axes."""
        item: list[int | slice] = [part if isinstance(part, int) else slice(0, 1) for part in self.chosen.part]
        order, ranges = list[int](), list[int | slice]()
        for axis, (begin, end) in zip(self.layout.space, box[::-1], strict=True):
            ranges.append(0 if axis is None else slice(None))
            if axis is not None:
                item[axis] = slice(begin, end)
                order.append(axis)
        return item, np.transpose(values[tuple(ranges)], np.argsort(order))


def _read(store: OpenImage, number: int, part: _Part, host: Host) -> Array:
    """Return the voxels of a part of a level, read several pieces at a time, and tell the progress.

    No chunk is needed for two pieces of a box. A piece that a process read which was ended is not read again.
    """
    scaling, level = store.image.plan.scaling, store.levels[number]
    host.expect_bytes(_NUM_HELD_CHUNKS * level.dtype.itemsize * math.prod(map(min, level.chunks, level.shape)))
    found = part.allocate(_value_type(store, level), host)

    def read(piece: tuple[Box, Array]) -> int:
        item, values = piece
        name = str(item)
        if host.has_piece(name, values):
            return values.nbytes
        if scaling == _NO_SCALING and not part.in_blocks:
            store.read_box(number, item, values)
        else:
            stored = np.empty(values.shape, level.dtype.newbyteorder("="))
            store.read_box(number, item, stored)
            host.fill(values, stored if scaling == _NO_SCALING else scaled(stored, *scaling))
        host.add_piece(name, values)
        return values.nbytes

    pieces = [piece for target in part.targets(found) for piece in slabs_of(*target, level.chunks)]
    sizes = [values.nbytes for _, values in pieces]
    num_read, num_bytes = 0, sum(sizes)
    with start_threads(max(2, min(_NUM_PIECES, _BYTES_AT_A_TIME // max(sizes, default=1)))) as threads:
        host.tell_progress(0, num_bytes, f"level {number}")
        for each in threads.map(read, pieces):
            num_read += each
            host.tell_progress(num_read, num_bytes, f"level {number}")
    return found


def _value_type(store: OpenImage, level: Level) -> np.dtype[Any]:
    """Return the type of the values of a level, which may differ from the type of its stored numbers."""
    return level.dtype.newbyteorder("=") if store.image.plan.scaling == _NO_SCALING else scaled_type(level.dtype)


def _layout(store: OpenImage, time: int | None, component: int | None) -> _Layout:
    """Return the meaning of the axes. Raises InputError for axes that are not those of a volume."""
    plan, shape = store.image.plan, store.levels[0].shape
    axes = plan.axes or (Axis(""),) * len(shape)
    if plan.axes and all(axis.kind for axis in axes):
        letters = "".join({"space": "s", "time": "t", "channel": "c"}[axis.kind] for axis in axes)
    else:
        step = -1 if plan.is_reversed else 1
        letters = letters_of(axes[::step], shape[::step], time, component)[::step]
    space = [number for number, letter in enumerate(letters) if letter == "s"]
    counts = [letters.count(letter) for letter in "tc"]
    if not 1 <= len(space) <= 3 or max(counts) > 1:
        raise InputError(
            "the axes of this image are not those of a volume",
            got=", ".join(f"{short_text(axis.name) or 'no name'} ({n})" for axis, n in zip(axes, shape, strict=True)),
            expected="one to three axes in space, at most one of time, and at most one of components",
        )
    names = [axes[number].name.lower() for number in space]
    if set(names) <= set("xyz") and len(set(names)) == len(names) and "x" in names:
        by_name = dict(zip(names, space, strict=True))
        return _Layout(letters, tuple(by_name.get(name) for name in "zyx"))
    ordered = space[::-1] if plan.is_reversed else space
    return _Layout(letters, (*[None] * (3 - len(ordered)), *ordered))


def _shape(level: Level, layout: _Layout) -> tuple[int, int, int]:
    """Return the number of voxels of a level along x, y, z."""
    z, y, x = (1 if axis is None else level.shape[axis] for axis in layout.space)
    return x, y, z


def _place(level: Level, finest: Level, layout: _Layout, axes: Sequence[Axis]) -> Float64:
    """Return the affine of a level, float64 [4, 4], with x, y and z of the world along the axes of these names.

    Without metadata, the level covers the same box as the finest one. Raises InputError for a place without a volume.
    """
    found = np.eye(4)
    space = [(row, axis) for row, axis in enumerate(layout.space[::-1]) if axis is not None]
    matrix = level.world_from_index
    for row, axis in space:
        if matrix is None:
            factor = _factor(finest.shape[axis], level.shape[axis])
            found[row, row], found[row, 3] = factor, 0.5 * (factor - 1.0)
            continue
        for column, other in space:
            found[row, column] = matrix[axis, other]
        found[row, 3] = matrix[axis, -1]
    if not has_volume(found):
        names = ", ".join(short_text(each.name) for each in axes)
        raise InputError("the transformations of this image give its voxels no volume", got=f"of the axes {names}")
    return found


def _factor(finest: int, own: int) -> float:
    """Return the number of voxels of the finest level along a voxel of a level, by the lengths of both along an axis.

    A length that is no multiple of the factor is rounded up by some programs, and down by others.
    """
    ratio = finest / max(own, 1)
    whole = round(ratio)
    return float(whole) if whole >= 1 and own in (finest // whole, -(-finest // whole)) else ratio


def _box(
    crop: Sequence[Sequence[int] | None] | None,
    finest: tuple[int, int, int],
    level: Level,
    layout: _Layout,
    finest_from_index: Float64,
) -> tuple[tuple[int, int], ...]:
    """Return the ranges of voxels of a level, along x, y, z, that meet a crop of the finest level."""
    shape = _shape(level, layout)
    wanted = [tuple(pair) if pair else (0, length) for pair, length in zip(crop or (None,) * 3, finest, strict=True)]
    check_crop(wanted, finest)
    lengths = np.linalg.norm(finest_from_index[:3, :3], axis=0).tolist()
    found = []
    for (begin, end), length, count in zip(wanted, lengths, shape, strict=True):
        first = min(math.floor(begin / length + 1e-6), count - 1)
        found.append((first, min(max(math.ceil(end / length - 1e-6), first + 1), count)))
    return tuple(found) if crop else tuple((0, count) for count in shape)


def _facts(level: Level, layout: _Layout, is_read: bool) -> VolumeLevel:
    z, y, x = (1 if axis is None else level.chunks[axis] for axis in layout.space)
    shape = _shape(level, layout)
    return VolumeLevel(shape, (x, y, z), check_size(shape, level.dtype), is_read)


def _units(axes: Sequence[Axis], layout: _Layout) -> tuple[Units, str | None]:
    """Return the unit of lengths that all axes share, and a note if their units differ."""
    spellings = {one_spelling(axes[axis].unit) for axis in layout.space if axis is not None and axes}
    if len(spellings) > 1:
        listed = ", ".join(sorted(short_text(each) or "none" for each in spellings))
        return Units(), f"the axes have different units ({listed}); their lengths are taken as they are"
    return units_of(*spellings), None


def _in_body(place: Float64, axes: Sequence[Axis], layout: _Layout) -> tuple[Float64, str]:
    """Return an affine in LPS and `LPS`, if all axes of space have directions in a body; else the same affine."""
    found = [_ORIENTATIONS.get(axes[axis].orientation) for axis in layout.space[::-1] if axis is not None and axes]
    ways = [each for each in found if each is not None]
    if len(ways) != 3 or len({row for row, _ in ways}) != 3:
        return place, ""
    turn = np.zeros((4, 4))
    turn[3, 3] = 1.0
    for column, (row, sign) in enumerate(ways):
        turn[row, column] = sign
    return np.asarray(turn @ place + 0.0, np.float64), "LPS"


def _steps(level: Level, plan: ImagePlan, layout: _Layout, count: int) -> TimeSteps:
    """Return the steps in time, whose times are stated, or follow from transformations that give a step or a unit."""
    if plan.times:
        return steps_at(count, plan.times, "s")
    axis, matrix = layout.letters.find("t"), level.world_from_index
    if axis < 0 or matrix is None or not plan.axes or (matrix[axis, axis] == 1.0 and not plan.axes[axis].unit):
        return TimeSteps(count)
    return even_steps_at(count, float(matrix[axis, axis]), plan.axes[axis].unit, float(matrix[axis, -1]))


def _channels(stated: Sequence[Channel], chosen: Chosen) -> tuple[Channel, ...]:
    """Return the channels that the metadata describe, without colours if two have the same; else those of `chosen`."""
    count = len(chosen.channels)
    if count < 2 or len(stated) != count:
        return chosen.channels
    tell_apart = len({each.color for each in stated}) == count and all(any(each.color or (1,)) for each in stated)
    return tuple(replace(each, color=each.color if tell_apart else None, is_light=True) for each in stated)
