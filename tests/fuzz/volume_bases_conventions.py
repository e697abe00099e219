"""Undamaged volumes with more than voxels: conventions of HDF5, stores, masks of VTK, turned pages of TIFF."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import tifffile
from hdf5_files import write_bdv, write_emd, write_imaris, write_netcdf, write_nexus
from stated_pictures import write_deep_pictures, write_pictures
from stated_tiff import imagej
from stated_vtk import write_vtk
from store_files import scaled, sharded, write_ome, zipped_store
from volume_base import Array, Base, written

_XML = (
    "<ViewSetups><ViewSetup><id>0</id><name>a</name><size>10 12 4</size><voxelSize><unit>um</unit><size>1 1 2</size>"
    "</voxelSize><attributes><channel>0</channel></attributes></ViewSetup></ViewSetups>"
)


def convention_bases(values: Array) -> Iterator[Base]:
    nz, ny, nx = values.shape
    lines = {"z": np.arange(nz) * 2.0, "y": np.arange(float(ny)), "x": np.arange(float(nx))}
    down = {"z": {"units": "m", "positive": "down"}, "y": {"units": "m"}, "x": {"units": "m"}}
    flags = {"flag_values": np.int16([0, 1]), "flag_meanings": "sea land"}
    units = dict.fromkeys(lines, "mm")
    group = {"axes": ["z", "y", "x"]}
    dims: Any = {f"dim{k + 1}": (own, {"name": name, "units": "[n_m]"}) for k, (name, own) in enumerate(lines.items())}
    ends = {f"Ext{end}{axis}": 0 if end == "Min" else 10 for end in ("Min", "Max") for axis in range(3)}
    info = {"Image": ends | {"Unit": "um"}, "Channel 0": {"Name": "GFP", "Color": "0 1 0", "ColorRange": "3 90"}}
    pair = (values, values + 1)
    yield _hdf5(
        "down", "a.nc", written(lambda folder: write_netcdf(folder / "a.nc", values, down, lines, **flags)), values
    )
    yield _hdf5(
        "nexus", "a.h5", written(lambda folder: write_nexus(folder / "a.h5", values, lines, group, units)), values
    )
    yield _hdf5("emd", "a.h5", written(lambda folder: write_emd(folder / "a.h5", values, **dims)), values)
    imaris = written(lambda folder: write_imaris(folder / "a.ims", pair, padding=2, num_levels=2, info=info))
    yield _hdf5("imaris", "a.ims", imaris, pair[1], {"component": 1})
    bdv = written(lambda folder: write_bdv(folder / "a.h5", (values,), num_levels=2, num_times=2, xml=_XML))
    yield _hdf5("bdv", "a.h5", bdv, (values + 1).astype(np.uint16), {"time": 1})


def store_bases(values: Array) -> Iterator[Base]:
    """Yield an image of OME-Zarr in a folder and in an archive, with shards whose chunks have checksums."""
    place = [scaled(2.0, 1.0, 1.0)]

    def write_plain(folder: Path) -> None:
        write_ome(folder / "a.zarr", [values], place, compressor=None)

    plain = written(write_plain)
    headers = {file: ((0, len(data)),) for file, data in plain.items() if file.endswith((".zattrs", ".zarray"))}
    yield Base("store ome", plain, "a.zarr", values=values, headers=headers)

    def write_archive(folder: Path) -> None:
        with tempfile.TemporaryDirectory(prefix="hsplat-fuzz-") as name:
            options: Any = {"version": "0.5", "chunks": (4, 6, 6), "codecs": sharded(2, 3, 3)}
            zipped_store(write_ome(Path(name) / "a", [values], place, **options), folder / "a.ozx")

    archive = written(write_archive)
    yield Base("store archive", archive, "a.ozx", values=values, headers={"a.ozx": ((0, len(archive["a.ozx"])),)})


def _hdf5(name: str, opened: str, files: dict[str, bytes], values: Array, choice: dict[str, int] | None = None) -> Base:
    headers = {file: ((0, len(data)),) for file, data in files.items()}
    return Base(f"hdf5 {name}", files, opened, choice or {}, values, headers=headers)


def masked_vtk_bases(values: Array) -> Iterator[Base]:
    mask = np.zeros(values.shape, np.uint8)
    mask[1, 2:5] = 2
    arrays = {"a": values, "vtkGhostType": mask, "vtkValidPointMask": np.ones_like(mask)}
    files = written(lambda folder: write_vtk(folder / "a.vti", arrays, dimensions=values.shape[::-1]))
    begin = files["a.vti"].index(b"<AppendedData")
    seen = np.where(mask == 2, np.nan, values).astype(np.float32)
    yield Base("vtk masked", files, "a.vti", values=seen, headers={"a.vti": ((0, begin),)})


def stated_tiff_bases(values: Array) -> Iterator[Base]:
    planes = values.astype(np.uint16)
    lines = ("slices=4", "unit=micron", "spacing=2.0", "xorigin=3.0", "cf=1", "c0=-5.0", "c1=2.0", "c2=0.5", "vunit=HU")
    files = written(imagej(*lines, values=planes))
    seen = (planes.astype(float) * (0.5 * planes + 2) - 5).astype(np.float32)
    yield Base("tiff calibrated", files, "a.tif", values=seen, headers={"a.tif": ((0, 400),)})
    more: Any = {"photometric": "minisblack", "metadata": None, "extratags": [(274, "H", 1, 6, True)]}
    files = written(lambda folder: tifffile.imwrite(folder / "a.tif", planes, **more))
    yield Base("tiff turned", files, "a.tif", values=planes, headers={"a.tif": ((0, 300),)})


def stated_picture_bases(values: Array) -> Iterator[Base]:
    planes = values.astype(np.uint8)
    files = written(lambda folder: write_pictures(folder / "stack", planes, orientation=6, dpi=(254, 254)))
    headers = {name: ((0, min(90, len(data))),) for name, data in files.items()}
    yield Base("pictures turned", files, "stack", values=planes, headers=headers)
    files = written(lambda folder: write_deep_pictures(folder / "stack", depth=16))
    headers = dict.fromkeys(files, ((0, 40),))
    yield Base("pictures deep", files, "stack", headers=headers)
