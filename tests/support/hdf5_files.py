"""Write files of HDF5 by h5py in the conventions that are read: netCDF, NeXus, EMD, Imaris and BigDataViewer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from renderer.volume import Array

VALUES: Array = np.arange(24, dtype=np.int16).reshape(2, 3, 4)

# By the name of an axis: the attributes of the dataset of the coordinates along this axis.
Coordinates = Mapping[str, Mapping[str, Any]]


def write_netcdf(
    path: Path,
    values: Array = VALUES,
    coordinates: Coordinates | None = None,
    numbers: Mapping[str, Sequence[float]] | None = None,
    **attributes: Any,
) -> Path:
    """Write a netCDF file of one variable with coordinates along its axes.

    numbers: the coordinates, by the names of axes; 0, 1, 2 and so on for other axes. attributes: attributes of
    the variable.
    """
    with h5py.File(path, "w") as file:
        dataset = file.create_dataset("t", data=values)
        dataset.attrs.update(attributes)
        for axis, (name, own) in enumerate((coordinates or {}).items()):
            file[name] = np.asarray((numbers or {}).get(name, np.arange(values.shape[axis], dtype=float)))
            file[name].make_scale(name)
            file[name].attrs.update(own)
            dataset.dims[axis].attach_scale(file[name])
    return path


def write_nexus(
    path: Path,
    values: Array = VALUES,
    fields: Mapping[str, Any] | None = None,
    group: Mapping[str, Any] | None = None,
    units: Mapping[str, str] | None = None,
) -> Path:
    """Write a NeXus file with a group NXdata in an entry.

    fields: further datasets of the group, by name. group: attributes of the group. units: units of datasets, by name.
    """
    with h5py.File(path, "w") as file:
        file.create_group("entry").attrs["NX_class"] = "NXentry"
        data = file.create_group("entry/data")
        data.attrs["NX_class"] = "NXdata"
        data.attrs.update({"signal": "v"} | dict(group or {}))
        for name, numbers in ({"v": values} | dict(fields or {})).items():
            data[name] = numbers
        for name, unit in (units or {}).items():
            data[name].attrs["units"] = unit
    return path


def write_emd(path: Path, values: Array = VALUES, **dims: tuple[Sequence[float], Mapping[str, str]]) -> Path:
    """Write an EMD file. dims: the numbers and attributes of datasets of coordinates, by name, such as `dim1`."""
    with h5py.File(path, "w") as file:
        group = file.create_group("data/tomogram")
        group.attrs["emd_group_type"] = 1
        group["data"] = values
        for name, (numbers, attributes) in dims.items():
            group[name] = np.asarray(numbers)
            group[name].attrs.update(attributes)
    return path


def characters(text: str) -> Array:
    """Return a text as Imaris stores it: an array of single characters."""
    return np.frombuffer(text.encode(), "S1")


def write_imaris(
    path: Path,
    values: Sequence[Array] = (VALUES,),
    *,
    padding: int = 0,
    num_levels: int = 1,
    info: Mapping[str, Mapping[str, object]] | None = None,
    **options: Any,
) -> Path:
    """Write an Imaris file. values: the channels, [z, y, x] each. info: attributes of the groups in DataSetInfo.

    options: of each dataset, such as its chunks.
    """
    with h5py.File(path, "w") as file:
        file.attrs["ImarisDataSet"] = characters("ImarisDataSet")
        for level in range(num_levels):
            for channel, own in enumerate(values):
                part = own[:: 2**level, :: 2**level, :: 2**level]
                group = file.create_group(f"DataSet/ResolutionLevel {level}/TimePoint 0/Channel {channel}")
                group.create_dataset("Data", data=np.pad(part, [(0, padding)] * 3), **options)
                for axis, n in zip("ZYX", part.shape, strict=True):
                    group.attrs[f"ImageSize{axis}"] = characters(str(n))
        for name, attributes in (info or {}).items():
            group = file.create_group(f"DataSetInfo/{name}")
            for key, value in attributes.items():
                group.attrs[key] = characters(str(value))
    return path


def write_bdv(
    path: Path,
    setups: Sequence[Array] = (VALUES,),
    *,
    num_levels: int = 1,
    num_times: int = 1,
    padding: int = 0,
    xml: str = "",
    **options: Any,
) -> Path:
    """Write a BigDataViewer file of setups, [z, y, x] each, whose values grow by 1 with each time.

    xml: the content of the XML file beside it; empty for no such file. options: of each dataset, such as its chunks.
    """
    with h5py.File(path, "w") as file:
        for setup, values in enumerate(setups):
            factors = [[2**level] * 3 for level in range(num_levels)]
            file[f"s{setup:02}/resolutions"] = np.array(factors, float)
            for time in range(num_times):
                for level in range(num_levels):
                    part = (values + time)[:: 2**level, :: 2**level, :: 2**level].astype(np.uint16).view(np.int16)
                    name = f"t{time:05}/s{setup:02}/{level}/cells"
                    file.create_dataset(name, data=np.pad(part, [(0, padding)] * 3), **options)
    if xml:
        path.with_suffix(".xml").write_text(f'<SpimData version="0.2">{xml}</SpimData>', "utf-8")
    return path


def spoil_chunks(path: Path, dataset: str, but: tuple[int, ...]) -> None:
    """Overwrite all chunks of a dataset except for the one with an offset."""
    with h5py.File(path, "r") as file:
        own = file[dataset].id
        chunks = [own.get_chunk_info(k) for k in range(own.get_num_chunks())]
    with path.open("r+b") as file:
        for each in chunks:
            if each.chunk_offset != but:
                file.seek(each.byte_offset)
                file.write(b"\xff" * each.size)
