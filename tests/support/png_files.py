"""Helpers that write PNG files of any kind, valid and invalid, and films of test pictures."""

from __future__ import annotations

import contextlib
import struct
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from renderer.film import Picture, encode_png, open_films
from renderer.scene import OutputSpec
from renderer.volume import UInt8

Pixels = UInt8
Chunks = Sequence[tuple[bytes, bytes]]

SIGNATURE = b"\x89PNG\r\n\x1a\n"
# The passes of an interlaced picture (Adam7): first row, first column, step of rows, step of columns.
PASSES = ((0, 0, 8, 8), (0, 4, 8, 8), (4, 0, 8, 4), (0, 2, 4, 4), (2, 0, 4, 2), (0, 1, 2, 2), (1, 0, 2, 1))


def chunk(name: bytes, content: bytes) -> bytes:
    return struct.pack(">I", len(content)) + name + content + struct.pack(">I", zlib.crc32(name + content))


def png_file(
    width: int, height: int, rows: bytes, *, depth: int = 8, color_type: int = 2, interlace: int = 0, more: Chunks = ()
) -> bytes:
    """Return a PNG file. rows: the bytes of each row after the code of its filter. more: chunks before the rows."""
    header = struct.pack(">IIBBBBB", width, height, depth, color_type, 0, 0, interlace)
    chunks = [(b"IHDR", header), *more, (b"IDAT", zlib.compress(rows)), (b"IEND", b"")]
    return SIGNATURE + b"".join(chunk(*each) for each in chunks)


def unfiltered(image: npt.NDArray[np.generic]) -> bytes:
    """Return the bytes of all rows of a picture, each after PNG's code of no filter, 0."""
    return b"".join(b"\0" + row.tobytes() for row in image) if image.size else b""


def interlaced(image: Pixels) -> bytes:
    """Return an interlaced PNG file of a picture, uint8 [h, w, 3] or [h, w, 4]."""
    rows = b"".join(unfiltered(image[y::dy, x::dx]) for y, x, dy, dx in PASSES)
    return png_file(image.shape[1], image.shape[0], rows, color_type={3: 2, 4: 6}[image.shape[2]], interlace=1)


def noise(seed: int, height: int = 16, width: int = 16, channels: int = 3) -> Pixels:
    return np.random.default_rng(seed).integers(0, 256, (height, width, channels), np.uint8)


def smooth(shift: float = 0.0, size: int = 32) -> Pixels:
    """Return a smooth picture [size, size, 3], in which encoders lose little."""
    y, x = np.mgrid[:size, :size] * (2 * np.pi / size)
    waves = [128 + 100 * np.sin(x + shift), 128 + 80 * np.cos(y), 128 + 60 * np.sin(x + y)]
    return np.stack(waves, axis=2).round().astype(np.uint8)


def write_frames(folder: Path, pictures: Sequence[Pixels], name: str = "frame-{:04}.png") -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for number, picture in enumerate(pictures):
        (folder / name.format(number)).write_bytes(encode_png(picture))
    return folder


def write_film(path: Path, pictures: Sequence[Pixels]) -> Path:
    height, width, channels = pictures[0].shape
    background = (0.0, 0.0, 0.0) if channels == 3 else None
    with open_film(OutputSpec(path, size=(width, height), background=background)) as write:
        for number, pixels in enumerate(pictures):
            write(number, pixels)
    return path


@contextlib.contextmanager
def open_film(output: OutputSpec) -> Iterator[Callable[[int, Pixels], None]]:
    """Yield a function that writes a frame to an output, whose pictures are of one kind."""
    with open_films(output.files, output.kinds) as write:
        yield lambda number, pixels: write(number, {0: Picture(pixels)})
