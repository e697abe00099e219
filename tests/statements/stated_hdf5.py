"""Samples of HDF5 and netCDF-4, and of the conventions that are built on them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from hdf5_files import VALUES, write_bdv, write_emd, write_imaris, write_netcdf, write_nexus
from statement_samples import Sample, Samples, Writer

_METRES = {name: {"units": "m"} for name in ("level", "y", "x")}
_TIMES = {"time": {"units": "days since 2000-01-01"}, **_METRES}
_SERIES = np.stack([VALUES, VALUES + 1])
_XY = ({"name": "y", "units": "[n_m]"}, {"name": "x", "units": "[n_m]"})


def _file(write: Callable[..., Path], *values: Any, name: str = "a.h5", **options: Any) -> Writer:
    """Return a writer of a file, with the same values and options each time."""
    return lambda folder: write(folder / name, *values, **options)


def _with(attributes: dict[str, Any], axis: str = "", **options: Any) -> Writer:
    """Return a writer of a variable with attributes, of itself or of its coordinates along an axis."""
    coordinates = {name: own | attributes if name == axis else own for name, own in _METRES.items()}
    return _file(write_netcdf, coordinates=coordinates, **({} if axis else attributes), **options)


def _changed(write: Writer, change: Callable[[h5py.File], None]) -> Writer:
    """Return a writer that changes what another one wrote."""

    def written(folder: Path) -> Path:
        path = write(folder)
        with h5py.File(path, "r+") as file:
            change(file)
        return path

    return written


def _against_plain(**attributes: Any) -> Sample:
    return Sample(_with({}), _with(attributes))


def _add_places(file: h5py.File) -> None:
    file["lat"] = np.zeros((3, 4))
    file["t"].attrs["coordinates"] = "lat lon"


def _add_default(file: h5py.File) -> None:
    file.copy("entry", "other")
    file["other/data/v"][...] += 5
    file.attrs["default"] = "other"
    file["other"].attrs["default"] = "data"


def _axistags(*keys: str) -> str:
    return '{"axes": [%s]}' % ", ".join(f'{{"key": "{key}", "resolution": 0.5}}' for key in keys)  # noqa: UP031


_NETCDF = {
    "scale_factor": _against_plain(scale_factor=0.5),
    "add_offset": _against_plain(add_offset=10.0),
    "_Unsigned": Sample(_file(write_netcdf, VALUES - 9), _file(write_netcdf, VALUES - 9, _Unsigned="true")),
    "_FillValue": _against_plain(_FillValue=np.int16(5)),
    "missing_value": _against_plain(missing_value=np.int16([5, 6])),
    "valid_range": _against_plain(valid_range=np.int16([3, 20])),
    "valid_min": _against_plain(valid_min=np.int16(3)),
    "valid_max": _against_plain(valid_max=np.int16(20)),
    "units": _against_plain(units="K"),
    "flag_values": Sample(
        _with({"flag_meanings": "sea land"}), _with({"flag_meanings": "sea land", "flag_values": np.int16([0, 1])})
    ),
    "flag_masks": _against_plain(flag_masks=np.int16([1, 2]), flag_meanings="cloud ice"),
    "DIMENSION_LIST": Sample(_file(write_netcdf), _with({}, numbers={"level": [0.0, 2.0]})),
    "axis": Sample(
        _with({}, numbers={"level": [0.0, 2.0]}),
        _file(
            write_netcdf,
            coordinates={name: {"units": "m", "axis": way} for name, way in zip(_METRES, "XYZ", strict=True)},
            numbers={"level": [0.0, 2.0]},
        ),
    ),
    "positive": Sample(_with({"positive": "up"}, "level"), _with({"positive": "down"}, "level")),
    "formula_terms": Sample(_with({}), _with({"formula_terms": "sigma: level ps: ps"}, "level")),
    "grid_mapping": _against_plain(grid_mapping="crs"),
    "coordinates": Sample(_with({}), _changed(_with({}), _add_places)),
    "calendar": Sample(
        _file(write_netcdf, _SERIES, coordinates=_TIMES),
        _file(write_netcdf, _SERIES, coordinates=_TIMES | {"time": {**_TIMES["time"], "calendar": "360_day"}}),
        {"time": 0},
    ),
    "element_size_um": Sample(_file(write_netcdf), _file(write_netcdf, element_size_um=[2.0, 0.5, 0.5])),
    "axistags": Sample(_file(write_netcdf), _file(write_netcdf, axistags=_axistags("x", "y", "z"))),
}

_EVEN = {"z": np.arange(2) * 2.0, "y": np.arange(3.0), "x": np.arange(4.0)}
_AXES = {"axes": ["z", "y", "x"]}
_nexus = partial(_file, write_nexus)
_NEXUS = {
    "signal": Sample(_nexus(fields={"w": VALUES + 1}), _nexus(fields={"w": VALUES + 1}, group={"signal": "w"})),
    "default": Sample(_nexus(), _changed(_nexus(), _add_default)),
    "axes": Sample(_nexus(fields={"a": [0.0, 2.0]}), _nexus(fields={"a": [0.0, 2.0]}, group={"axes": ["a", ".", "."]})),
    "AXISNAME_indices": Sample(
        _nexus(np.zeros((3, 3, 3)), {"a": np.arange(3) * 2.0}, {"axes": ["a", ".", "."]}),
        _nexus(np.zeros((3, 3, 3)), {"a": np.arange(3) * 2.0}, {"axes": ["a", ".", "."], "a_indices": 1}),
    ),
    "scaling_factor": Sample(_nexus(), _nexus(fields={"scaling_factor": 0.5})),
    "offset": Sample(_nexus(), _nexus(fields={"offset": 10.0})),
    "units": Sample(
        _nexus(fields=_EVEN, group=_AXES), _nexus(fields=_EVEN, group=_AXES, units=dict.fromkeys(("z", "y", "x"), "mm"))
    ),
    "auxiliary_signals": Sample(
        _nexus(fields={"w": VALUES}), _nexus(fields={"w": VALUES}, group={"auxiliary_signals": ["w"]})
    ),
    "rotation_angle": Sample(_nexus(), _nexus(fields={"rotation_angle": [0.0, 90.0]})),
    "image_key": Sample(_nexus(), _nexus(fields={"image_key": [0, 1]})),
}

_emd = partial(_file, write_emd)
_Z = ([0.0, 2.0], {"name": "z", "units": "[n_m]"})
_DIMS = {"dim2": ([0.0, 1.0, 2.0], _XY[0]), "dim3": ([0.0, 1.0, 2.0, 3.0], _XY[1])}


def _change_group_type(file: h5py.File) -> None:
    del file["data/tomogram"].attrs["emd_group_type"]


_EMD = {
    "emd_group_type": Sample(_changed(_emd(**_DIMS, dim1=_Z), _change_group_type), _emd(**_DIMS, dim1=_Z)),
    "dim1": Sample(_emd(**_DIMS), _emd(**_DIMS, dim1=_Z)),
    "name": Sample(
        _emd(dim1=([0.0, 2.0], {"units": "[n_m]"})), _emd(dim1=([0.0, 2.0], {"name": "x", "units": "[n_m]"}))
    ),
    "units": Sample(
        _emd(**{name: (numbers, {"name": own["name"]}) for name, (numbers, own) in _DIMS.items()}, dim1=([0, 2], {})),
        _emd(**_DIMS, dim1=([0.0, 2.0], {"units": "[n_m]"})),
    ),
}

_ENDS = {f"Ext{end}{axis}": 0 if end == "Min" else 8 for end in ("Min", "Max") for axis in range(3)}
_imaris = partial(_file, write_imaris, name="a.ims")
_TWO = (VALUES, VALUES + 1)


def _change_time(file: h5py.File) -> None:
    file.copy("DataSet/ResolutionLevel 0/TimePoint 0", "DataSet/ResolutionLevel 0/TimePoint 1")


def _taken(*times: str) -> Writer:
    info = {"TimeInfo": {f"TimePoint{k + 1}": time for k, time in enumerate(times)}}
    return _changed(_imaris(info=info), _change_time)


def _remove_sizes(file: h5py.File) -> None:
    channel = file["DataSet/ResolutionLevel 0/TimePoint 0/Channel 0"]
    for axis in "XYZ":
        del channel.attrs[f"ImageSize{axis}"]


_IMARIS = {
    "ImageSizeX": Sample(_changed(_imaris(padding=2), _remove_sizes), _imaris(padding=2)),
    "ExtMax0": Sample(_imaris(), _imaris(info={"Image": _ENDS})),
    "Unit": Sample(_imaris(info={"Image": _ENDS}), _imaris(info={"Image": _ENDS | {"Unit": "um"}})),
    "Name": Sample(_imaris(_TWO), _imaris(_TWO, info={"Channel 1": {"Name": "GFP"}})),
    "Color": Sample(_imaris(_TWO), _imaris(_TWO, info={"Channel 1": {"Color": "0 1 0"}})),
    "ColorRange": Sample(_imaris(_TWO), _imaris(_TWO, info={"Channel 1": {"ColorRange": "3 20"}})),
    "TimePoint1": Sample(_taken(), _taken("2009-08-03 11:14:25.234", "2009-08-03 11:14:27.734")),
}

_SETUP = "<ViewSetup><id>{}</id>{}<size>4 3 2</size>{}<attributes>{}<angle>0</angle></attributes></ViewSetup>"
_VOXELS = "<voxelSize><unit>um</unit><size>1 1 2</size></voxelSize>"
_MOVE = "<ViewRegistrations><affine>{}</affine></ViewRegistrations>"
_SCALE = "1 0 0 0 0 1 0 0 0 0 2 0"
_MOVED = "1 0 0 7 0 1 0 0 0 0 2 0"


def _bdv(*setups: str, more: str = "", **options: Any) -> Writer:
    return _file(write_bdv, (VALUES, VALUES + 1)[: len(setups) or 1], xml="".join(setups) + more, **options)


def _change_type(file: h5py.File) -> None:
    cells = file["t00000/s00/0/cells"][...]
    del file["t00000/s00/0/cells"]
    file["t00000/s00/0/cells"] = cells.astype(np.int32)


def _change_levels(file: h5py.File) -> None:
    file["s00/resolutions"][...] = [[1, 1, 1], [2, 2, 1]]


_PLAIN = _SETUP.format(0, "", "", "")
_LARGE: Any = VALUES + np.uint16(2**15)
_BDV = {
    "cells": Sample(
        _changed(_file(write_bdv, (_LARGE,)), _change_type),
        _file(write_bdv, (_LARGE,)),
    ),
    "resolutions": Sample(
        _bdv(_SETUP.format(0, "", _VOXELS, ""), num_levels=2),
        _changed(_bdv(_SETUP.format(0, "", _VOXELS, ""), num_levels=2), _change_levels),
        {"level": 1},
    ),
    "size": Sample(_file(write_bdv, padding=2), _bdv(_PLAIN, padding=2)),
    "voxelSize": Sample(_bdv(_PLAIN), _bdv(_SETUP.format(0, "", _VOXELS, ""))),
    "channel": Sample(
        _bdv(_PLAIN),
        _bdv(
            _PLAIN.replace("</angle>", "</angle><channel>0</channel>"), _SETUP.format(1, "", "", "<channel>1</channel>")
        ),
    ),
    "name": Sample(
        _bdv(_PLAIN, _SETUP.format(1, "", "", "")),
        _bdv(_SETUP.format(0, "<name>a</name>", "", ""), _SETUP.format(1, "<name>b</name>", "", "")),
    ),
    "ViewRegistrations": Sample(_bdv(_PLAIN, more=_MOVE.format(_SCALE)), _bdv(_PLAIN, more=_MOVE.format(_MOVED))),
}

SAMPLES: Samples = {
    "HDF5 and netCDF-4 (CF)": _NETCDF,
    "NeXus": _NEXUS,
    "EMD": _EMD,
    "Imaris": _IMARIS,
    "BigDataViewer": _BDV,
}
