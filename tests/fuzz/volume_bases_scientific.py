"""Undamaged volumes of MRC, HDF5, netCDF-4, folders of pictures, and of VTK's pieces and rectilinear grids."""

from __future__ import annotations

import gzip
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from PIL import Image
from volume_base import Array, Base, behind, written
from volume_files import in_memory
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData, vtkRectilinearGrid
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter, vtkXMLRectilinearGridWriter


def mrc_header(sizes: tuple[int, ...], mode: int, *, order: str = "<", group: int = 1, num_extension: int = 0) -> bytes:
    """Return a header of a cell of 0.5 x 0.5 x 2 for each voxel, whose stacks have volumes of two sections."""
    header = bytearray(1024)
    grid = (*sizes[:2], 2 if group == 401 else sizes[2])
    cell = (0.5 * grid[0], 0.5 * grid[1], 2.0 * grid[2])
    struct.pack_into(f"{order}10i6f3i", header, 0, *sizes, mode, 0, 0, 0, *grid, *cell, 90, 90, 90, 1, 2, 3)
    struct.pack_into(f"{order}2i", header, 88, group, num_extension)
    header[208:216] = b"MAP " + (b"\x44\x44\0\0" if order == "<" else b"\x11\x11\0\0")
    return bytes(header)


def mrc_bases(values: Array) -> Iterator[Base]:
    sizes = values.shape[::-1]
    plain = mrc_header(sizes, 1, num_extension=160) + b"x" * 160 + values.tobytes()
    headers = {"a.mrc": ((0, 1184),)}
    yield Base("mrc plain", {"a.mrc": plain}, "a.mrc", values=values, headers=headers)
    big = mrc_header(sizes, 1, order=">", group=401) + values.astype(">i2").tobytes()
    yield Base("mrc stack", {"a.map": big}, "a.map", {"time": 1}, values[2:], headers={"a.map": ((0, 1024),)})
    packed = gzip.compress(plain, 6, mtime=0)
    yield Base("mrc gzip", {"a.map.gz": packed}, "a.map.gz", values=values, guarded={"a.map.gz": ((0, len(packed)),)})


def hdf5_bases(values: Array) -> Iterator[Base]:
    for name, more in (
        ("contiguous", {}),
        ("gzip", {"compression": "gzip", "chunks": (2, 6, 5), "fletcher32": True}),
        ("shuffle", {"compression": "gzip", "shuffle": True, "chunks": True}),
    ):

        def write(folder: Path, more: Any = more) -> None:
            with h5py.File(folder / "a.h5", "w") as file:
                dataset = file.create_dataset("in/vol", data=values, track_times=False, **more)
                dataset.attrs["element_size_um"] = [2.0, 0.5, 0.5]

        files = written(write)
        at = files["a.h5"].find(values.tobytes())
        headers = {"a.h5": ((0, at if at > 0 else len(files["a.h5"])),)}
        yield Base(f"hdf5 {name}", files, "a.h5", values=values, headers=headers)

    def write_netcdf(folder: Path) -> None:
        with h5py.File(folder / "a.nc", "w", track_order=False) as file:
            dataset = file.create_dataset("t", data=np.stack([values, values + 1]), fillvalue=-999, track_times=False)
            dataset.attrs.update(scale_factor=0.5, add_offset=10.0, _FillValue=np.int16([-999]))
            names = ("time", "level", "lat", "lon")
            for axis, (name, length) in enumerate(zip(names, dataset.shape, strict=True)):
                file.create_dataset(name, data=np.arange(length) / 2, track_times=False).make_scale(name)
                file[name].attrs["units"] = "days since 2000-01-01" if name == "time" else "degrees_north"
                dataset.dims[axis].attach_scale(file[name])

    files = written(write_netcdf)
    expected = ((values + 1) * 0.5 + 10).astype(np.float32)
    headers = {"a.nc": ((0, len(files["a.nc"])),)}
    yield Base("hdf5 netcdf", files, "a.nc", {"time": 1}, expected, headers=headers)


def picture_bases(values: Array) -> Iterator[Base]:
    for form, kind in (("png", "uint16"), ("bmp", "uint8"), ("jpeg", "uint8")):
        planes = values.astype(kind)
        files = {f"stack/s{k}.{form}": in_memory(Image.fromarray(p).save, form) for k, p in enumerate(planes)}
        headers = {name: ((0, min(60, len(data))),) for name, data in files.items()}
        yield Base(f"pictures {form}", files, "stack", values=None if form == "jpeg" else planes, headers=headers)
    colours = np.stack([values.astype(np.uint8)] * 3, axis=-1)
    files = {f"stack/s{k}.png": in_memory(Image.fromarray(p).save, "png") for k, p in enumerate(colours)}
    yield Base("pictures rgb", files, "stack", {"component": 1}, values.astype(np.uint8))


def other_vtk_bases(values: Array) -> Iterator[Base]:
    nz, ny, nx = values.shape
    pieces = {}
    lines = ""
    for k, (first, last) in enumerate(((0, 4), (4, nx - 1))):
        image = vtkImageData()
        image.SetExtent(first, last, 0, ny - 1, 0, nz - 1)
        extent = f"{first} {last} 0 {ny - 1} 0 {nz - 1}"
        pieces[f"a/{k}.vti"] = written_by_vtk(vtkXMLImageDataWriter(), image, values[:, :, first : last + 1])
        lines += f'<Piece Extent="{extent}" Source="a/{k}.vti"/>\n'
    whole = f"0 {nx - 1} 0 {ny - 1} 0 {nz - 1}"
    text = f'<VTKFile type="PImageData">\n<PImageData WholeExtent="{whole}">\n{lines}</PImageData>\n</VTKFile>\n'
    files = {"a.pvti": text.encode(), **pieces}
    yield Base("vtk pieces", files, "a.pvti", values=values, headers={"a.pvti": ((0, len(text)),)})
    grid = vtkRectilinearGrid()
    grid.SetDimensions(nx, ny, nz)
    for axis, n in zip("XYZ", (nx, ny, nz), strict=True):
        coordinates = numpy_to_vtk(np.arange(n) * 0.5, deep=True)
        coordinates.SetName(axis)  # VTK would name it by its address
        getattr(grid, f"Set{axis}Coordinates")(coordinates)
    data = written_by_vtk(vtkXMLRectilinearGridWriter(), grid, values)
    headers = {"a.vtr": ((0, behind(b"<AppendedData", data)),)}
    yield Base("vtk rectilinear", {"a.vtr": data}, "a.vtr", values=values, headers=headers)


def written_by_vtk(writer: Any, image: Any, values: Array) -> bytes:
    array = numpy_to_vtk(np.ascontiguousarray(values).ravel(), deep=True)
    array.SetName("density")
    image.GetPointData().SetScalars(array)

    def write(folder: Path) -> None:
        writer.SetFileName(str(folder / "a"))
        writer.SetInputData(image)
        writer.Write()

    return re.sub(rb"<!--.*?-->", b"", written(write)["a"])
