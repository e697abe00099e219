"""The decoder of our own PNG files returns the encoded pixels, or raises ValueError."""

from __future__ import annotations

import struct
import zlib

import imageio.v3 as iio
import numpy as np
import numpy.typing as npt
import pytest

from renderer.film import Picture, encode_png, join_png_chunks, png_chunks
from renderer.film.png import decode_png


def noise(*shape: int) -> npt.NDArray[np.uint8]:
    return np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (300, 256)])
def test_encoded_pixels_are_decoded_here_and_elsewhere(size: tuple[int, int], channels: int) -> None:
    image = noise(*size, channels)
    content = encode_png(image)
    decoded = decode_png(content)
    assert decoded.dtype == np.uint8 and decoded.flags.c_contiguous
    np.testing.assert_array_equal(decoded, image)
    np.testing.assert_array_equal(decoded, iio.imread(content, extension=".png"))


@pytest.mark.parametrize("value", [0, 255])
def test_even_pictures_are_decoded(value: int) -> None:
    """These compress best, and a limit of the expansion must not refuse them."""
    image = np.full((2000, 3000, 4), value, np.uint8)
    np.testing.assert_array_equal(decode_png(encode_png(image)), image)


def test_pictures_may_be_larger_than_other_decoders_allow(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("PIL.Image.MAX_IMAGE_PIXELS", 16)
    image = noise(7, 9, 3)
    np.testing.assert_array_equal(Picture(png=encode_png(image)).pixels, image)


SHAPE = (4, 6, 3)
HEADER = struct.pack(">IIBBBBB", SHAPE[1], SHAPE[0], 8, 2, 0, 0, 0)
ROW = b"\2" + b"x" * 18
HUGE = struct.pack(">IIBBBBB", 2**32 - 1, 2**32 - 1, 8, 6, 0, 0, 0)


def file_of(rows: bytes, header: bytes = HEADER, end: bytes = b"") -> bytes:
    return join_png_chunks([(b"IHDR", header), (b"IDAT", zlib.compress(rows) + end), (b"IEND", b"")])


def test_the_file_from_which_the_others_differ_is_decoded() -> None:
    assert decode_png(file_of(4 * ROW)).shape == SHAPE


OTHERS = {
    "another filter": file_of(3 * ROW + b"\1" + ROW[1:]),
    "no such filter": file_of(3 * ROW + b"\5" + ROW[1:]),
    "a byte too few": file_of((4 * ROW)[:-1]),
    "a byte too many": file_of(4 * ROW + b"\0"),
    "far too many": file_of(4 * ROW + bytes(10**6)),
    "something behind the rows": file_of(4 * ROW, end=b"\0"),
    "no rows": join_png_chunks([(b"IHDR", HEADER), (b"IDAT", b""), (b"IEND", b"")]),
    "rows that are cut off": join_png_chunks(
        [(b"IHDR", HEADER), (b"IDAT", zlib.compress(4 * ROW)[:-1]), (b"IEND", b"")]
    ),
    "rows that are not compressed": join_png_chunks([(b"IHDR", HEADER), (b"IDAT", 4 * ROW), (b"IEND", b"")]),
    "a sum that is wrong": join_png_chunks(
        [(b"IHDR", HEADER), (b"IDAT", zlib.compress(4 * ROW)[:-4] + b"none"), (b"IEND", b"")]
    ),
    "no data": join_png_chunks([(b"IHDR", HEADER), (b"IEND", b"")]),
    "two pieces": join_png_chunks(
        [(b"IHDR", HEADER), (b"IDAT", zlib.compress(4 * ROW)), (b"IDAT", b""), (b"IEND", b"")]
    ),
    "interlaced": file_of(4 * ROW, HEADER[:-1] + b"\1"),
    "16 bits": file_of(4 * ROW, HEADER[:8] + b"\x10" + HEADER[9:]),
    "grey": file_of(4 * ROW, HEADER[:9] + b"\0" + HEADER[10:]),
    "no width": file_of(4 * b"\2", bytes(4) + HEADER[4:]),
    "no height": file_of(b"", HEADER[:4] + bytes(4) + HEADER[8:]),
    "huge": file_of(4 * ROW, HUGE),
    "a chunk more": join_png_chunks([*png_chunks(file_of(4 * ROW))[:2], (b"tEXt", b"a"), (b"IEND", b"")]),
    "cut off": file_of(4 * ROW)[:-1],
    "no PNG file": b"GIF89a",
    "empty": b"",
}


@pytest.mark.parametrize("content", OTHERS.values(), ids=OTHERS)
def test_other_files_are_refused(content: bytes) -> None:
    with pytest.raises(ValueError, match=r"damaged|cut off|of another kind|not a PNG|not of 8 bits"):
        decode_png(content)
