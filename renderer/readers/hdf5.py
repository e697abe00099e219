"""Read a dataset of HDF5 (.h5, .ims, MATLAB 7.3) or netCDF-4 (.nc), by h5py, in a child process (`isolation.py`).

Axes run from the slowest to the fastest, as `.npy` has them, unless names tell of times and components. By the
conventions of netCDF (CF), fill values are no data, `scale_factor` and `add_offset` are applied, and coordinates that
are even give the spacing and the origin. Nothing outside of the file is ever opened.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from renderer.errors import InputError, require_package
from renderer.readers.arrays import axes_of_array
from renderer.readers.common import NO_SPACING, Image, affine, choose, describe_shape, even_steps
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.units import units_of
from renderer.scene import did_you_mean, join_some, short_text
from renderer.volume import Array, Float64

_MAX_OBJECTS = 10_000
_MAX_PACKING = 2**20  # of filters, one after the other; a file may also claim voxels that it does not store
# What is so close to a valid value is valid.
_MARGIN = 1e-5
_TIMES = ("t", "time", "times", "step")
_COMPONENTS = ("c", "ch", "channel", "channels", "component", "components", "band", "bands", "member", "rgb")
_METRES = {"nm": 1e-9, "um": 1e-6, "µm": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "metre": 1.0, "meter": 1.0, "km": 1e3}
_METRES |= {"meters": 1.0, "metres": 1.0, "micron": 1e-6, "micrometer": 1e-6}

# An h5py.Dataset.
_Dataset = Any


def read_hdf5(
    path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host, dataset: str | None
) -> Image:
    """Read one time step and component of a dataset, by its name or else the only one that is a volume.

    has_spacing_override: the scene gives the spacing, so that coordinates need not be even. Raises InputError for
        files that are damaged, hold no such dataset or several, or whose voxels are in other files.
    """
    require_package("h5py", extra="hdf5")
    import h5py

    with h5py.File(path, "r", locking=False) as file:
        found = _find(file, dataset)
        _check_dataset(found, path)
        own = [_axis(found, k) for k in range(found.ndim)]
        axes = _letters(own, time, component)
        chosen = choose(axes, found.shape, time, component)
        shape = tuple(n for n, item in zip(found.shape, chosen.part, strict=True) if isinstance(item, slice))
        dtype, packing = _packing(found)
        is_scaled = packing[1:] != (1.0, 0.0)
        values = allocate_voxels(host, (1,) * (3 - len(shape)) + shape, dtype)
        stored = values if is_scaled else values.view(found.dtype.newbyteorder("="))
        try:
            found.read_direct(stored.reshape(shape), np.s_[chosen.part])
        except OSError as error:
            raise InputError(
                "the voxels of this dataset cannot be decoded",
                got=short_text(" ".join(str(error).split())),
                hint="the file is damaged, or compressed by a filter that is not installed: `h5repack -f GZIP=4` "
                "compresses it by another",
            ) from error
        if is_scaled:
            for plane in values:
                plane[...] = _unpacked(plane, *packing)
        nodata = tuple(_nodata(found, *packing))
        world_from_index, length, notes = _place(found, own, axes, has_spacing_override)
        units = units_of(length, value=_text(found, "units"))
        note = f"the only volume in this file, {short_text(found.name)}, is read" if dataset is None else None
    all_notes = (note, *notes, *chosen.notes)
    return Image(values, world_from_index, all_notes, nodata, chosen.channels, steps=chosen.steps, units=units)


def _packing(dataset: _Dataset) -> tuple[np.dtype[Any], tuple[float, float, float]]:
    """Return the type of the values, and how stored numbers become values, as `_unpacked` takes it."""
    stored = dataset.dtype.newbyteorder("=")
    is_unsigned = stored.kind == "i" and _text(dataset, "_Unsigned").lower() == "true"
    dtype = np.dtype(f"u{stored.itemsize}") if is_unsigned or stored.kind == "b" else stored
    scale, offset = ([*_numbers(dataset, name), default][0]
                     for name, default in (("scale_factor", 1.0), ("add_offset", 0.0)))  # fmt: skip
    if (scale, offset) != (1.0, 0.0):
        dtype = np.dtype(np.float32 if dtype.itemsize <= 2 or dtype == np.float32 else np.float64)
    return dtype, (2.0 ** (8 * stored.itemsize) if is_unsigned else 0.0, scale, offset)


def _unpacked(stored: Array, wrap: float, scale: float, offset: float) -> Float64:
    """Return the values of stored numbers: those below 0 have `wrap` added, then all are scaled."""
    with np.errstate(over="ignore", invalid="ignore"):  # what becomes infinite is absent
        return np.asarray((np.where(stored < 0, wrap, 0.0) + stored) * scale + offset, np.float64)


def _nodata(dataset: _Dataset, *packing: float) -> Iterator[tuple[float, float]]:
    """Yield the ranges of values, both ends included, that stand for no data: fill values, and what is not valid."""
    fills = [*_numbers(dataset, "_FillValue"), *_numbers(dataset, "missing_value")]
    if dataset.dtype.itemsize > 1 and dataset.fillvalue != 0:  # what was not written; netCDF has none for bytes
        fills.append(float(dataset.fillvalue))
    for fill in _unpacked(np.unique(fills), *packing).tolist():
        if math.isfinite(fill):
            yield fill, fill
    valid = _numbers(dataset, "valid_range")
    least = [*valid[:1], *_numbers(dataset, "valid_min"), -math.inf][0]
    largest = [*valid[1:2], *_numbers(dataset, "valid_max"), math.inf][0]
    low, high = sorted(_unpacked(np.array([least, largest]), *packing).tolist())
    if low > -math.inf:
        yield -math.inf, math.nextafter(low - _MARGIN * abs(low), -math.inf)
    if high < math.inf:
        yield math.nextafter(high + _MARGIN * abs(high), math.inf), math.inf


def _numbers(owner: Any, name: str) -> Float64:
    """Return the numbers of an attribute, 16 at most; none for all else."""
    numbers = np.ravel(owner.attrs.get(name, ()))[:16]
    return numbers.astype(np.float64) if numbers.dtype.kind in "iuf" else np.zeros(0)


def _find(file: Any, name: str | None) -> _Dataset:
    """Return the dataset of this name, or the only one with three axes or more.

    Links to other files are not followed. Raises InputError if there is none, or there are several.
    """
    import h5py

    found: dict[str, _Dataset] = {}
    number = itertools.count()

    def visit(path: str, each: Any) -> Any:
        if isinstance(each, h5py.Dataset) and each.dtype.kind in "iufb" and each.ndim >= 2:
            found[path] = each
        return next(number) > _MAX_OBJECTS or None

    if file.visititems(visit):
        raise InputError("this file holds too many objects", expected=f"at most {_MAX_OBJECTS} groups and datasets")
    volumes = {path: each for path, each in found.items() if each.ndim >= 3 and min(each.shape) > 0}
    listed = [f"{short_text(path)} ({describe_shape(each.shape[::-1])})" for path, each in (volumes or found).items()]
    if name is not None:
        if name.strip("/") in found:
            return found[name.strip("/")]
        raise InputError(
            "there is no such dataset of numbers",
            got=f"dataset: {short_text(name)}",
            expected=join_some(listed) if listed else "a file with a dataset of two axes or more",
            hint=did_you_mean(name[:200], list(found)),
        )
    if len(volumes) != 1:
        raise InputError(
            f"this file holds {len(volumes)} volumes, and one is rendered" if volumes else "this file holds no volume",
            got=join_some(listed) if listed else "no dataset of numbers with two axes or more",
            expected=f"`dataset: NAME`, such as `dataset: {short_text(min(volumes))}`" if volumes else
            "a dataset of three axes" + ", or `dataset: NAME` for a plane" * bool(listed),
        )  # fmt: skip
    return next(iter(volumes.values()))


def _check_dataset(dataset: _Dataset, path: Path) -> None:
    """Raise InputError for voxels in other files, and for more than a file can hold."""
    if dataset.is_virtual or dataset.external:
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


def _text(owner: Any, name: str) -> str:
    """Return an attribute that is a text; an empty one for all else, and where there is no owner."""
    value = None if owner is None else owner.attrs.get(name)
    text = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
    return text if isinstance(text, str) else ""


class _Axis(NamedTuple):
    """An axis of a dataset: its name and unit, which may be empty, and the numbers along it, if there are any."""

    length: int
    name: str
    unit: str
    coordinates: _Dataset | None

    @property
    def letter(self) -> str:
        """Return its letter in `choose`: time has a name of time, or a unit such as `days since 2000`."""
        name = self.name.lower()
        return "t" if name in _TIMES or " since " in self.unit else "c" if name in _COMPONENTS else "s"

    @property
    def way(self) -> str:
        """Return the axis of the world along which it lies, by the conventions of netCDF or its name: x, y or z; or
        another text."""
        return (_text(self.coordinates, "axis") or self.name).lower()


def _axis(dataset: _Dataset, axis: int) -> _Axis:
    """Return an axis, whose numbers are in a dataset that is attached to it, or beside the dataset by its name."""
    import h5py

    attached, length = dataset.dims[axis].values(), dataset.shape[axis]
    keys = re.findall(r'"key": *"(\w+)"', _text(dataset, "axistags"))  # of ilastik
    label = keys[axis] if len(keys) == dataset.ndim else dataset.dims[axis].label
    name = str(label or next((each.name.rpartition("/")[2] for each in attached if each.name), ""))
    is_beside = name and isinstance(dataset.parent.get(name, getlink=True), h5py.HardLink)
    for each in (*attached, dataset.parent[name]) if is_beside else attached:
        is_line = isinstance(each, h5py.Dataset) and each.shape == (length,) and each.dtype.kind in "iuf"
        if is_line and not (each.is_virtual or each.external or "not a netCDF variable" in _text(each, "NAME")):
            return _Axis(length, name, _text(each, "units"), each)
    return _Axis(length, name, "", None)


def _letters(own: list[_Axis], time: int | None, component: int | None) -> str:
    """Return what each axis is, by the letters of `choose`.

    Names tell times and components; of more than three others, those of length 1 are left out, and then the rule of
    `.npy` holds. With two axes in space, times or components are the third.
    """
    letters = [axis.letter for axis in own]
    for k, axis in enumerate(own):
        if letters.count("s") > 3 and letters[k] == "s" and axis.length == 1:
            letters[k] = "-"
    while letters.count("s") < 3 and {"t", "c"} & {*letters}:
        letters[letters.index("t" if "t" in letters else "c")] = "s"
    if letters.count("s") > 3:
        shape = tuple(axis.length for axis, letter in zip(own, letters, strict=True) if letter == "s")
        others = iter(axes_of_array(shape, None if "t" in letters else time, None if "c" in letters else component))
        letters = [next(others) if letter == "s" else letter for letter in letters]
    if letters.count("t") > 1 or letters.count("c") > 1:
        raise InputError(
            "the axes of this dataset are not those of a volume",
            got=", ".join(f"{axis.name or 'no name'} ({axis.length})" for axis in own),
            expected="three axes in space, at most one of time, and at most one of components",
        )
    return "".join(letters)


def _place(
    dataset: _Dataset, own: list[_Axis], axes: str, has_spacing_override: bool
) -> tuple[Float64, str, list[str]]:
    """Return the affine, float64 [4, 4], by coordinates or the attribute `element_size_um`, the unit that all of its
    lengths have, and notes."""
    space = [axis for axis, letter in zip(own, axes, strict=True) if letter == "s"][::-1]
    origin, spacing, units = np.zeros(3), np.ones(3), dict[str, str]()
    ways = "".join(axis.way for axis in space)
    ways = ways if sorted(ways) == ["x", "y", "z"] else "xyz"
    direction = np.eye(3)[:, ["xyz".index(way) for way in ways]]
    for column, axis in enumerate(space):
        if axis.coordinates is None:
            continue
        even = even_steps(axis.coordinates[...])
        if even is None and not has_spacing_override and axis.letter != "t":
            raise InputError(
                "the coordinates of this dataset are not even",
                got=f"{short_text(axis.coordinates.name)} along {ways[column]}",
                expected="equal steps, as voxels have",
                hint=f"resample it by xarray: `data.interp({short_text(axis.name)}=numpy.linspace(FIRST, LAST, "
                f"{axis.length})).to_netcdf('even.nc')`; or give `spacing: [x, y, z]` to draw equal steps",
            )
        unit = axis.unit.split("_")[0]  # degrees_north
        first = next(iter(units.values()), unit)
        is_length = {unit, first} <= _METRES.keys()
        units[ways[column]] = first if is_length else unit
        factor = _METRES[unit] / _METRES[first] if is_length else 1.0
        origin[column], spacing[column] = np.array(even or (0.0, 1.0)) * factor
    sizes = _numbers(dataset, "element_size_um")
    if not units and len(sizes) == len(space) == 3:
        return affine(sizes[::-1], origin, direction), "µm", []
    notes = [NO_SPACING] * (not units)
    if 0 < len(units) < len(space):
        missing = ", ".join(axis for axis in sorted(ways[: len(space)]) if axis not in units)
        notes.append(f"the file has no coordinates along {missing}; steps of 1 are assumed")
    if len({*units.values()}) > 1:
        each = ", ".join(f"{axis} in {unit or 'no unit'}" for axis, unit in units.items())
        notes.append(f"coordinates differ in their units, and are drawn as numbers ({short_text(each)}); "
                     "`spacing: [x, y, z]` gives other lengths")  # fmt: skip
    is_one = len(units) == len(space) and len({*units.values()}) == 1
    return affine(spacing, direction @ origin, direction), {*units.values()}.pop() if is_one else "", notes
