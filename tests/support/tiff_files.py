"""Write TIFF files: stacks by tifffile, and one page field by field, so that any of them can be damaged."""

from __future__ import annotations

import io
import struct

import numpy as np
import numpy.typing as npt
import tifffile

BYTE, ASCII, SHORT, LONG, RATIONAL = 1, 2, 3, 4, 5
WIDTH, HEIGHT, BITS, COMPRESSION, DESCRIPTION = 256, 257, 258, 259, 270
STRIPS, SAMPLES, STRIP_BYTES, PLANAR, SAMPLE_FORMAT = 273, 277, 279, 284, 339
PIXELS = np.arange(16, dtype=np.uint8).reshape(4, 4)

# The fields of a page of PIXELS, which are at byte 8, by tag: type, number of values, and value or place of the values.
PAGE = {
    WIDTH: (SHORT, 1, 4), HEIGHT: (SHORT, 1, 4), BITS: (SHORT, 1, 8), COMPRESSION: (SHORT, 1, 1), STRIPS: (LONG, 1, 8),
    SAMPLES: (SHORT, 1, 1), STRIP_BYTES: (LONG, 1, 16),
}  # fmt: skip
Field = tuple[int, int, int]


def directory(fields: dict[int, Field], following: int = 0) -> bytes:
    entries = b"".join(struct.pack("<HHII", tag, *field) for tag, field in sorted(fields.items()))
    return struct.pack("<H", len(fields)) + entries + struct.pack("<I", following)


def tiff(fields: dict[int, Field], values: bytes = b"", following: int = 0) -> bytes:
    """Return a TIFF file: PIXELS, `values` at byte 24, and a directory.

    fields: fields of the directory, besides or in place of PAGE. following: the place of another directory; 0 for none.
    """
    begin = struct.pack("<2sHI", b"II", 42, 24 + len(values))
    return begin + PIXELS.tobytes() + values + directory({**PAGE, **fields}, following)


def described(text: str) -> bytes:
    return tiff({DESCRIPTION: (ASCII, len(text) + 1, 24)}, text.encode() + b"\0")


def ome(attributes: str) -> bytes:
    return described(f"<OME><Pixels {attributes}/></OME>")


def tiff_bytes(
    pages: npt.NDArray[np.generic],
    order: str = "<",
    *,
    description: str = "",
    resolution: tuple[int, tuple[int, int], tuple[int, int]] | None = None,
    big: bool = False,
    tile: tuple[int, int] | None = None,
) -> bytes:
    """Return an uncompressed TIFF file of pages [page, y, x], each in one strip or in tiles.

    resolution: TIFF's code of the unit, and the pixels per unit in x and in y, as fractions.
    """
    out = io.BytesIO()
    unit, *per_unit = resolution or (1, (1, 1), (1, 1))
    layout = {"tile": tile} if tile else {"rowsperstrip": pages.shape[1]}
    tifffile.imwrite(
        out,
        pages,
        byteorder=order,
        bigtiff=big,
        photometric="minisblack",
        metadata=None,
        software=False,
        description=description.encode() or None,
        resolution=per_unit,
        resolutionunit=unit,
        **layout,
    )
    return out.getvalue()
