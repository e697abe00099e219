"""Directories and descriptions of TIFF files that are damaged, or made to take memory: what the user is told."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from tiff_files import (
    ASCII,
    BITS,
    BYTE,
    DESCRIPTION,
    HEIGHT,
    LONG,
    PIXELS,
    PLANAR,
    SAMPLE_FORMAT,
    SHORT,
    STRIP_BYTES,
    STRIPS,
    WIDTH,
    described,
    ome,
    tiff,
)
from transcripts import Case, cases
from volume_files import read, refused, written


def big_tiff(first: int, after: bytes = b"") -> bytes:
    return struct.pack("<2sHHHQ", b"II", 43, 8, 0, first) + after


@pytest.mark.usefixtures("one_process")
def test_the_page_itself_is_read(tmp_path):
    for name, data in {
        "plain.tif": tiff({}),
        "imagej.tif": described("ImageJ=1.53\nimages=1\nslices=1\nspacing=NaN\n"),
        "ome.tif": ome('SizeZ="1" PhysicalSizeX="unknown"'),
        "planar.tif": tiff({PLANAR: (SHORT, 1, 2)}),
        "no description.tif": tiff({DESCRIPTION: (ASCII, 0, 0)}),
    }.items():
        np.testing.assert_array_equal(read(written(tmp_path / name, data)).values, PIXELS[np.newaxis])


# TIFF files with a fault, by name
FILES = {
    "a-field-without-a-value": tiff({WIDTH: (SHORT, 0, 4)}), "strips-without-a-place": tiff({STRIPS: (LONG, 0, 8)}),
    "no-frames": described("ImageJ=1.53\nimages=1\nframes=0\n"),
    "a-count-of-many-digits": described(f"ImageJ=1.53\nslices={'7' * 5000}\n"),
    "no-count": described("ImageJ=1.53\nchannels=\x1b[31m\n"),
    "spacing-that-is-no-number": described("ImageJ=1.53\nslices=1\nspacing=e\n"),
    "a-size-that-is-no-number": ome('SizeZ="1.2.3"'), "a-size-beyond-all-bounds": ome('SizeZ="1e999"'),
    "a-pixel-that-is-no-number": ome('SizeZ="1" PhysicalSizeX="."'),
    "sizes-whose-product-overflows": ome(f'SizeZ="{2**31 - 1}" SizeC="{2**31 - 1}" SizeT="4"'),
    "planes-with-short-strips": tiff({PLANAR: (SHORT, 1, 2), STRIP_BYTES: (LONG, 1, 15)}),
    "floats-of-8-bits": tiff({SAMPLE_FORMAT: (SHORT, 1, 3)}),
    "pixels-in-several-strips-at-once": tiff(
        {HEIGHT: (SHORT, 1, 2000), STRIPS: (LONG, 500, 24), STRIP_BYTES: (LONG, 500, 2024)}, b"\x10\0\0\0" * 1000),
    "pages-in-a-circle": tiff({}, following=24), "a-page-beyond-all-bounds": big_tiff(2**64 - 8),
    "fields-beyond-all-bounds": big_tiff(16, struct.pack("<Q", 2**64 - 1)),
}  # fmt: skip


@pytest.mark.usefixtures("one_process")
@cases("damaged_tiff.txt")
def test_messages(case: Case, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for name, data in FILES.items():
        Path(f"{name}.tif").write_bytes(data)
    case.check(capfd)


@pytest.mark.usefixtures("one_process")
def test_no_number_is_one_to_python_alone(tmp_path):
    """Neither digits of other scripts nor Python's separators between digits."""
    for text in ("1_0", "٣", "0x1", "+-1", "1e", "", " 1", "inf", "nan"):
        refused(written(tmp_path / "a.tif", ome(f'SizeZ="{text}"')), match="something else where a number belongs")


NUM_SHARED = 2**16
SHARED = bytes(NUM_SHARED)


def fields_that_nobody_needs() -> bytes:
    return tiff({40000 + k: (BYTE, NUM_SHARED, 24) for k in range(200)}, SHARED)


def needed_fields_of_many_values() -> bytes:
    fields = dict.fromkeys((BITS, *range(262, 269)), (BYTE, NUM_SHARED, 24))
    return tiff(fields, b"\x08" + SHARED)


def directories_that_overlap() -> bytes:
    """Each of 1000 fields, and six bytes behind the one before."""
    num_fields, num_pages = 1000, 300
    data = bytearray(struct.pack("<H", num_fields) * (6 * (num_pages + 2 * num_fields + 10)))
    data[:8] = struct.pack("<2sHI", b"II", 42, 8)
    for place in range(8, 8 + 6 * num_pages, 6):
        struct.pack_into("<I", data, place + 2 + 12 * num_fields, place + 6)
    return bytes(data)


@pytest.mark.parametrize(
    "make",
    [
        fields_that_nobody_needs,
        needed_fields_of_many_values,
        pytest.param(directories_that_overlap, marks=pytest.mark.slow),
    ],
)
def test_small_files_that_claim_much_end_within_the_limits(tmp_path, monkeypatch, make):
    monkeypatch.setattr("renderer.readers.isolation._MEMORY_BYTES", 200 << 20)
    (tmp_path / "a.tif").write_bytes(make())
    if make is directories_that_overlap:
        refused(tmp_path / "a.tif")
    else:
        np.testing.assert_array_equal(read(tmp_path / "a.tif").values, PIXELS[np.newaxis])
