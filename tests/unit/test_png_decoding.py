"""The decoder of our own PNG files returns the encoded pixels, or raises ValueError."""

from __future__ import annotations

import struct
import zlib

import imageio.v3 as iio
import numpy as np
import pytest
from png_files import noise

from renderer.film import Picture, decode_png, encode_png, join_png_chunks


@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (300, 256)])
def test_encoded_pixels_are_decoded_here_and_elsewhere(size: tuple[int, int], channels: int) -> None:
    image = noise(1, *size, channels)
    content = encode_png(image)
    np.testing.assert_array_equal(decode_png(content), image)
    np.testing.assert_array_equal(iio.imread(content, extension=".png"), image)


def test_pictures_may_be_larger_than_other_decoders_allow(monkeypatch: pytest.MonkeyPatch) -> None:
    """Even pictures compress best, and a limit of the expansion does not refuse them."""
    monkeypatch.setattr("PIL.Image.MAX_IMAGE_PIXELS", 16)
    for image in (noise(1, 7, 9), np.full((1000, 1000, 4), 255, np.uint8)):
        np.testing.assert_array_equal(Picture(content=encode_png(image)).pixels, image)


SHAPE = (4, 6, 3)
HEADER = struct.pack(">IIBBBBB", SHAPE[1], SHAPE[0], 8, 2, 0, 0, 0)
ROW = b"\2" + b"x" * 18


def file_of(data: bytes, header: bytes = HEADER) -> bytes:
    return join_png_chunks([(b"IHDR", header), (b"IDAT", data), (b"IEND", b"")])


WHOLE = zlib.compress(4 * ROW)
OTHERS = {
    "no such filter": file_of(zlib.compress(3 * ROW + b"\5" + ROW[1:])),
    "a byte too few": file_of(zlib.compress((4 * ROW)[:-1])), "no rows": file_of(b""),
    "rows that are not compressed": file_of(4 * ROW), "16 bits": file_of(WHOLE, HEADER[:8] + b"\x10" + HEADER[9:]),
    "grey": file_of(WHOLE, HEADER[:9] + b"\0" + HEADER[10:]), "no width": file_of(WHOLE, bytes(4) + HEADER[4:]),
    "huge": file_of(WHOLE, struct.pack(">IIBBBBB", 2**32 - 1, 2**32 - 1, 8, 6, 0, 0, 0)),
    "cut off": file_of(WHOLE)[:-1], "no PNG file": b"GIF89a", "empty": b"",
}  # fmt: skip


@pytest.mark.parametrize("content", OTHERS.values(), ids=OTHERS)
def test_other_files_are_refused(content: bytes) -> None:
    assert decode_png(file_of(WHOLE)).shape == SHAPE
    with pytest.raises(ValueError, match=r"damaged|cut off|not a PNG|not of 8 or 16 bits"):
        decode_png(content)
