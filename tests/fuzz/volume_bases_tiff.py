"""Undamaged TIFF files of every kind that is read."""

from __future__ import annotations

import io
import re
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
import tifffile
from volume_base import Array, Base, sample_values
from volume_files import in_memory


def tiff_bases() -> Iterator[Base]:
    values, small = sample_values(), sample_values("uint8")
    tiled = sample_values("uint16", (3, 40, 36))
    for compression in (None, "deflate", "lzw", "packbits", "zstd", "lzma"):
        name = "plain" if compression is None else compression
        yield _tiff_base(name, values, compression=compression, metadata=None)
    # A baseline JPEG is not exact.
    yield _tiff_base("jpeg", small, compression="jpeg", metadata=None, is_exact=False)
    yield _tiff_base("jpeg2000", values, compression="jpeg2000", metadata=None)
    yield _tiff_base("tiled", tiled, tile=(16, 16), metadata=None)
    yield _tiff_base("tiled deflate", tiled, tile=(16, 16), compression="deflate", predictor=True, metadata=None)
    yield _tiff_base("big", values, bigtiff=True, byteorder=">", metadata=None)
    yield _tiff_base("predictor", sample_values("float32"), compression="deflate", predictor=True, metadata=None)
    ramps = np.tile(np.arange(0, 80, 8, np.uint8), (4, 12, 1))
    frames = iter([_ZSTD_FRAME] * 4)
    yield _tiff_base("zstd-checksum", ramps, frames, compression="zstd", metadata=None, rowsperstrip=12)
    stack = np.stack([values, values + 1], axis=1)
    described = {"axes": "ZCYX", "spacing": 2.0, "unit": "um"}
    choice = {"component": 1}
    yield _tiff_base("imagej", stack, imagej=True, metadata=described, seen=stack[:, 1], choice=choice)
    described = {"axes": "ZCYX", "PhysicalSizeX": 0.5, "PhysicalSizeY": 0.5, "PhysicalSizeZ": 2.0}
    yield _tiff_base("ome", stack, ome=True, metadata=described, seen=stack[:, 1], choice=choice, compression="deflate")
    described = {"axes": "ZCYX", "spacing": 2.0, "unit": "um"}
    yield _tiff_base("shaped", stack, metadata=described, seen=stack[:, 1], choice=choice)
    yield _tiff_base("shaped-without-axes", np.stack([values + 1, values]), seen=values, choice={"time": 1})
    yield _tiff_base("truncated", stack, metadata=described, seen=stack[:, 1], choice=choice, truncate=True)
    yield _tiff_base("nodata", values, metadata=None, extratags=[(42113, "s", 0, "65000", True)])
    yield _tiff_lsm(values)
    yield _tiff_ome_files(values)
    yield _tiff_base("rgb", np.stack([small] * 3, axis=-1), photometric="rgb", metadata=None, seen=small, choice=choice)
    out = io.BytesIO()
    with tifffile.TiffWriter(out) as writer:
        for page in tiled:
            writer.write(page, tile=(16, 16), compression="deflate", metadata=None)
        for page in tiled:
            writer.write(page[::2, ::2], tile=(16, 16), compression="deflate", metadata=None, subfiletype=1)
    yield _tiff_of("pyramid", {"a.tif": out.getvalue()}, tiled)
    pages = [in_memory(tifffile.imwrite, page, compression="deflate", metadata=None) for page in values]
    yield _tiff_of("folder", {f"stack/s{k:02}.tif": page for k, page in enumerate(pages)}, values, opened="stack")


def _tiff_lsm(values: Array) -> Base:
    """Return a stack with the record of Zeiss and a thumbnail behind each slice."""
    record = struct.pack("<II8i6dHHI", 67127628, 96, 10, 12, 4, 1, 1, 2, 8, 8, 2e-7, 2e-7, 1e-6, 0, 0, 0, 0, 0, 0)
    out = io.BytesIO()
    with tifffile.TiffWriter(out, byteorder="<") as writer:
        for k, page in enumerate(values):
            tags = [] if k else [(34412, "B", len(record), record, True)]
            writer.write(page, extratags=tags, metadata=None, compression="lzw", photometric="minisblack")
            writer.write(np.zeros((8, 8), np.uint8), subfiletype=1, metadata=None, photometric="minisblack")
    return _tiff_of("lsm", {"a.lsm": out.getvalue()}, values, opened="a.lsm")


def _tiff_ome_files(values: Array) -> Base:
    """Return a stack with the halves of its slices in two files, which both name both."""
    places = "".join(
        f'<TiffData FirstZ="{z}" IFD="{z % 2}"><UUID FileName="{"ab"[z // 2]}.tif">urn:uuid:{z // 2}</UUID></TiffData>'
        for z in range(4)
    )
    pixels = f'<Pixels DimensionOrder="XYZCT" SizeZ="4" SizeC="1" SizeT="1" PhysicalSizeX="0.5">{places}</Pixels>'
    files = {}
    for k, name in enumerate("ab"):
        options: dict[str, Any] = {"description": f'<OME UUID="urn:uuid:{k}"><Image>{pixels}</Image></OME>'}
        pages = values[2 * k : 2 * k + 2]
        files[f"{name}.tif"] = in_memory(
            tifffile.imwrite, pages, metadata=None, photometric="minisblack", software=False, **options
        )
    return _tiff_of("ome-files", files, values)


def _tiff_base(
    name: str,
    values: Array,
    stored: Any = None,
    *,
    seen: Array | None = None,
    choice: dict[str, int] | None = None,
    is_exact: bool = True,
    **arguments: Any,
) -> Base:
    """Return a stack that tifffile writes. stored: its compressed strips. seen: what is read of it."""
    arguments = {"photometric": "minisblack", "software": False, **arguments}
    if stored is not None:
        arguments |= {"shape": values.shape, "dtype": values.dtype}
    data = in_memory(tifffile.imwrite, values if stored is None else stored, **arguments)
    data = re.sub(rb"urn:uuid:[-0-9a-f]{36}", b"urn:uuid:" + b"0" * 36, data)  # drawn at random
    expected = (values if seen is None else seen) if is_exact else None
    return _tiff_of(name, {"a.tif": data}, expected, choice=choice)


# What the program zstd writes, with a checksum, for 12 rows of 0, 8, 16, ..., 72.
_ZSTD_FRAME = bytes.fromhex("28b52ffd24788d000050000810182028303840480100ab69410275c1d229")
_SUMMED = ("ADOBE_DEFLATE", "DEFLATE", "LZMA")


def _tiff_of(
    name: str,
    files: dict[str, bytes],
    values: Array | None,
    *,
    opened: str = "a.tif",
    choice: dict[str, int] | None = None,
) -> Base:
    """Return a volume of TIFF files, of which zlib's streams, lzma's and some of zstd have checksums."""
    guarded, headers = {}, {}
    for file, data in files.items():
        with tifffile.TiffFile(io.BytesIO(data)) as tiff:
            pages = list(tiff.pages)
            spans = [
                (at, at + n) for page in pages for at, n in zip(page.dataoffsets, page.databytecounts, strict=True)
            ]
            has_sum = pages[0].compression.name in _SUMMED or "checksum" in name
        spans.sort()
        guarded[file] = tuple(spans) if has_sum else ()
        ends = [0, *(end for _, end in spans)]
        begins = [*(begin for begin, _ in spans), len(data)]
        headers[file] = tuple(span for span in zip(ends, begins, strict=True) if span[0] < span[1])
    return Base(f"tiff {name}", files, opened, choice or {}, values, guarded, headers)
