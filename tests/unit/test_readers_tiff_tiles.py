"""TIFF in tiles: uncompressed ones of one sample a pixel are read, damaged ones refused."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec

SHORT, LONG = 3, 4
WIDTH, HEIGHT = 16, 32  # of a tile; TIFF asks for multiples of 16
VALUES = np.random.default_rng(0).integers(0, 2000, (3, 45, 40))


def tiled(values: npt.NDArray[np.generic], order: str = "<", left_out: int = 0, cut: int = 0) -> bytes:
    """Of [page, y, x]; the last `left_out` tiles of each page are not named, the first is said to be `cut` shorter."""
    out = bytearray(struct.pack(order + "2sHI", b"II" if order == "<" else b"MM", 42, 8))
    for number, page in enumerate(values):
        padded = np.pad(page, [(0, -page.shape[0] % HEIGHT), (0, -page.shape[1] % WIDTH)], constant_values=77)
        down, across = padded.shape[0] // HEIGHT, padded.shape[1] // WIDTH
        tiles = padded.reshape(down, HEIGHT, across, WIDTH).swapaxes(1, 2).reshape(-1, HEIGHT, WIDTH)
        num_tiles, num_bytes = len(tiles) - left_out, tiles[0].nbytes
        places_at = len(out) + 2 + 12 * 10 + 4
        data_at = places_at + 8 * num_tiles
        fields = [
            (256, SHORT, 1, page.shape[1]),
            (257, SHORT, 1, page.shape[0]),
            (258, SHORT, 1, 8 * values.dtype.itemsize),
            (259, SHORT, 1, 1),
            (277, SHORT, 1, 1),
            (322, SHORT, 1, WIDTH),
            (323, SHORT, 1, HEIGHT),
            (324, LONG, num_tiles, places_at),
            (325, LONG, num_tiles, places_at + 4 * num_tiles),
            (339, SHORT, 1, {"u": 1, "i": 2, "f": 3}[values.dtype.kind]),
        ]
        out += struct.pack(order + "H", len(fields))
        for tag, kind, count, value in fields:
            out += struct.pack(order + "HHI", tag, kind, count)
            out += struct.pack(order + ("HH" if kind == SHORT else "I"), *((value, 0) if kind == SHORT else (value,)))
        end = data_at + tiles.nbytes
        out += struct.pack(order + "I", end if number < len(values) - 1 else 0)
        out += struct.pack(f"{order}{num_tiles}I", *(data_at + k * num_bytes for k in range(num_tiles)))
        out += struct.pack(f"{order}{num_tiles}I", num_bytes - cut, *[num_bytes] * (num_tiles - 1))
        out += tiles.astype(values.dtype.newbyteorder(order)).tobytes()
    return bytes(out)


@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint32", "float16", "float64"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_tiles(tmp_path: Path, dtype: str, order: str) -> None:
    values = VALUES.astype(dtype)
    (tmp_path / "a.tif").write_bytes(tiled(values, order))
    read = read_volume(VolumeSpec(FileSource(tmp_path / "a.tif"))).values
    assert read.dtype == np.dtype(dtype)
    np.testing.assert_array_equal(read, values)


def test_slices_of_tiles_in_a_folder(tmp_path: Path) -> None:
    values = VALUES.astype(np.uint16)
    for k in range(3):
        (tmp_path / f"{k}.tif").write_bytes(tiled(values[k : k + 1]))
    np.testing.assert_array_equal(read_volume(VolumeSpec(FileSource(tmp_path))).values, values)


@pytest.mark.parametrize(
    ("damage", "got"),
    [({"left_out": 1}, "5 tiles, 1024 bytes the smallest"), ({"cut": 1}, "6 tiles, 1023 bytes the smallest")],
)
def test_tiles_that_are_not_there(tmp_path: Path, damage: dict[str, int], got: str) -> None:
    data = tiled(VALUES.astype(np.uint16), **damage)
    (tmp_path / "a.tif").write_bytes(data)
    with pytest.raises(InputError) as error:
        read_volume(VolumeSpec(FileSource(tmp_path / "a.tif")))
    assert str(error.value) == (
        f"{tmp_path / 'a.tif'}: the tiles of this TIFF file do not make up its pages\n"
        f"  got: {got}; a file of {len(data)} bytes\n"
        "  expected: 6 tiles of 16 x 32 pixels, 1024 bytes each, on each of 3 pages\n"
        "  hint: the file is damaged"
    )


@pytest.mark.parametrize(("old", "new"), [((322, WIDTH), 0), ((323, HEIGHT), 4096)])
def test_tiles_of_a_size_that_cannot_be(tmp_path: Path, old: tuple[int, int], new: int) -> None:
    data = tiled(VALUES.astype(np.uint16))
    entry = struct.pack("<HHIHH", old[0], SHORT, 1, old[1], 0)
    assert data.count(entry) == 3
    (tmp_path / "a.tif").write_bytes(data.replace(entry, struct.pack("<HHIHH", old[0], SHORT, 1, new, 0)))
    with pytest.raises(InputError, match="the tiles of this TIFF file do not make up its pages"):
        read_volume(VolumeSpec(FileSource(tmp_path / "a.tif")))
