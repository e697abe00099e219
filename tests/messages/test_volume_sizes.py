"""Messages about files that have more voxels than their headers say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from volume_files import read, refused, write_image

pytestmark = pytest.mark.usefixtures("folder")

VALUES = np.arange(60, dtype=np.uint16).reshape(3, 4, 5)
HEADERS = {
    "a.nhdr": "NRRD0004\ntype: uint16\ndimension: 3\nsizes: {} {} {}\nendian: little\nencoding: raw\n"
    "data file: a.raw\n",
    "a.mhd": "NDims = 3\nDimSize = {} {} {}\nElementType = MET_USHORT\nElementDataFile = a.raw\n",
}


def message(name: str) -> str:
    return str(refused(Path(name)))


@pytest.mark.parametrize("name", HEADERS)
def test_more_voxels_than_the_header_says(name: str) -> None:
    VALUES.tofile("a.raw")
    for shape, expected, fits in (
        ((5, 4, 2), "80 bytes (5 x 4 x 2 voxels)", "these would fit: 5 x 6 x 2; 5 x 4 x 3"),
        ((5, 3, 3), "90 bytes (5 x 3 x 3 voxels)", "these would fit: 5 x 4 x 3; 5 x 3 x 4"),
        ((4, 4, 3), "96 bytes (4 x 4 x 3 voxels)", "these would fit: 5 x 4 x 3; 4 x 5 x 3"),
        ((4, 3, 2), "48 bytes (4 x 3 x 2 voxels)", "these would fit: 10 x 3 x 2; 4 x 3 x 5"),
        ((7, 7, 1), "98 bytes (7 x 7 x 1 voxels)", "the header is wrong"),
    ):
        Path(name).write_text(HEADERS[name].format(*shape), "ascii")
        assert message(name) == (
            f"a.raw: the file is longer than its header says\n  got: 120 bytes\n  expected: {expected}\n  hint: {fits}"
        )


@pytest.mark.parametrize("name", ["a.nrrd", "a.mha"])
def test_more_voxels_behind_the_header(name: str) -> None:
    write_image(Path(name), VALUES)
    data = Path(name).read_bytes()
    Path(name).write_bytes(data.replace(b"5 4 3", b"5 4 2"))
    assert message(name).startswith(
        f"{name}: the file is longer than its header says\n  got: 120 bytes\n  expected: 80 bytes (5 x 4 x 2 voxels)\n"
    )
    Path(name).write_bytes(data + b"\r\n" + bytes(20))  # less than an axis more
    np.testing.assert_array_equal(read(Path(name)).values, VALUES)


@pytest.mark.parametrize(("name", "line"), [("a.nhdr", "byte skip: 40\n"), ("a.mhd", "HeaderSize = 40\n")])
def test_a_part_of_a_file_may_be_meant(name: str, line: str) -> None:
    VALUES.tofile("a.raw")
    *others, last = HEADERS[name].format(5, 4, 1).splitlines(keepends=True)
    Path(name).write_text("".join([*others, line, last]), "ascii")
    np.testing.assert_array_equal(read(Path(name)).values, VALUES[1:2])
