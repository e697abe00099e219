"""Small files of MRC, HDF5 and pictures that ask for much work or memory."""

from __future__ import annotations

import struct
from collections.abc import Callable
from pathlib import Path

import h5py
import numpy as np
from PIL import Image
from volume_base import written
from volume_bases_scientific import mrc_header
from volume_bombs import ZLIB, Files, zeros_by_deflate, zeros_by_gzip
from volume_files import in_memory

from renderer.film import join_png_chunks


def _hdf5(write: Callable[[h5py.File], object]) -> Files:
    def save(folder: Path) -> None:
        with h5py.File(folder / "a.h5", "w") as file:
            write(file)

    return dict(written(save))


def hdf5_groups_in_a_ring() -> Files:
    def write(file: h5py.File) -> None:
        group = file
        for name in "abcdefgh":
            group = group.create_group(name)
            for k in range(8):
                file[f"to_{name}{k}"] = group
                group[f"back{k}"] = file["/"]
                group[f"soft{k}"] = h5py.SoftLink(f"/to_{name}{k}/back{k}")
                group[f"out{k}"] = h5py.ExternalLink("/dev/zero", "/a")
        file["v"] = np.ones((4, 4, 4))

    return _hdf5(write)


def hdf5_coordinates_of_gigabytes() -> Files:
    def write(file: h5py.File) -> None:
        file["v"] = np.ones((4, 4, 4))
        file.create_dataset("x", (2**40,), "f8", chunks=(2**20,)).make_scale("x")
        file["v"].dims[2].attach_scale(file["x"])

    return _hdf5(write)


def hdf5_attributes_of_megabytes() -> Files:
    def write(file: h5py.File) -> None:
        dataset = file.create_dataset("v", data=np.ones((4, 4, 4)))
        for name in ("_FillValue", "missing_value"):
            dataset.attrs[name] = np.zeros(8000)
        dataset.attrs["axistags"] = '"key": "' * 7000

    return _hdf5(write)


def hdf5_chunks_that_inflate() -> Files:
    def write(file: h5py.File) -> None:
        dataset = file.create_dataset("v", (64, 64, 64), "u1", chunks=(64, 64, 64), compression="gzip")
        dataset.id.write_direct_chunk((0, 0, 0), ZLIB + zeros_by_deflate(4096))

    return _hdf5(write)


def _png(width: int, height: int, *chunks: tuple[bytes, bytes]) -> bytes:
    head = (b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0))
    return join_png_chunks([head, *chunks, (b"IEND", b"")])


def _twice(data: bytes, ending: str = "png") -> Files:
    return {f"many/s{k}.{ending}": data for k in range(2)}


def _large(form: str, at: int, size: bytes) -> bytes:
    """Return a picture that says that it is larger. at: where the size is."""
    data = _black(form)
    return data[:at] + size + data[at + len(size) :]


def _black(form: str) -> bytes:
    return in_memory(Image.fromarray(np.zeros((16, 16), np.uint8)).save, form)


JPEG_SIZE_AT = _black("jpeg").index(b"\xff\xc0") + 5

SCIENTIFIC: dict[str, dict[str, Callable[[], Files]]] = {
    "mrc": {
        "huge_sizes": lambda: {"a.mrc": mrc_header((2**31 - 1,) * 3, 2) + bytes(64)},
        "long_extension": lambda: {"a.mrc": (mrc_header((4, 4, 4), 2, num_extension=2**31 - 1), 2**33)},
        "many_times": lambda: {"a.mrc": mrc_header((1, 1, 2**31 - 2), 0, group=401) + bytes(64)},
        "gzip_inflates": lambda: {"a.mrc.gz": zeros_by_gzip(4096)},
        "sparse": lambda: {"a.mrc": (mrc_header((1000, 1000, 1000), 0), 2**30 + 2**20)},
    },
    "hdf5": {
        "groups_in_a_ring": hdf5_groups_in_a_ring,
        "coordinates_of_gigabytes": hdf5_coordinates_of_gigabytes,
        "attributes_of_megabytes": hdf5_attributes_of_megabytes,
        "chunks_that_inflate": hdf5_chunks_that_inflate,
        "many_objects": lambda: _hdf5(lambda file: [file.create_group(f"g{k}") for k in range(11_000)]),
        "many_datasets": lambda: _hdf5(lambda file: [file.create_dataset(f"d{k}" * 30, (2, 2, 2), "u1")
            for k in range(2000)]),
        "nested_groups": lambda: _hdf5(lambda file: file.create_group("/".join("a" * 3000))),
        "voxels_that_are_not_there": lambda: _hdf5(lambda file: file.create_dataset("v", (2000, 2000, 2000), "f8",
            chunks=(100, 100, 100))),
        "huge_chunks": lambda: _hdf5(lambda file: file.create_dataset("v", (2000, 2000, 500), "u1",
            chunks=(2000, 2000, 500), compression="gzip")),
        "sparse": lambda: {"a.h5": (_hdf5(lambda file: file.create_dataset("v", (4, 4, 4), "u1"))["a.h5"], 2**33)},
    },
    "pictures": {
        "png_inflates": lambda: _twice(_png(4, 4, (b"IDAT", ZLIB + zeros_by_deflate(4096)))),
        "png_claims_gigabytes": lambda: _twice(_png(60_000, 60_000, (b"IDAT", ZLIB + zeros_by_deflate(64)))),
        "png_is_huge": lambda: _twice(_png(2**31 - 1, 2**31 - 1, (b"IDAT", b""))),
        "png_text_inflates": lambda: _twice(_png(4, 4, (b"zTXt", b"a\0\0" + ZLIB + zeros_by_deflate(4096)))),
        "png_chunk_of_gigabytes": lambda: _twice(_png(4, 4)[:33] + struct.pack(">I", 2**31 - 1) + b"IDAT" + bytes(64)),
        "bmp_is_huge": lambda: _twice(_large("bmp", 18, struct.pack("<ii", 2**31 - 1, 2**31 - 1)), "bmp"),
        "bmp_is_negative": lambda: _twice(_large("bmp", 18, struct.pack("<ii", -5, -(2**31))), "bmp"),
        "jpeg_is_huge": lambda: _twice(_large("jpeg", JPEG_SIZE_AT, struct.pack(">HH", 65535, 65535)), "jpg"),
    },
}  # fmt: skip
