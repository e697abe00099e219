"""MetaImage headers that say where the voxels are, how long they are compressed, and that they are to be scaled."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
import pytest
from transcripts import Case, cases
from volume_files import read

VALUES = np.random.default_rng(0).integers(0, 2000, (4, 7, 8)).astype("<u2")
RAW, PACKED = VALUES.tobytes(), zlib.compress(VALUES.tobytes(), 0)  # the same bytes by any zlib
HEAD = "ObjectType = Image\nNDims = 3\nBinaryDataByteOrderMSB = False\nDimSize = 8 7 4\nElementType = MET_USHORT\n"
COMPRESSED, SIZED = "CompressedData = True\n", "CompressedData = True\nCompressedDataSize = "
NUM_HEADER_BYTES = len(f"{HEAD}HeaderSize = 999\nElementDataFile = LOCAL\n")
SCALED = "ElementToIntensityFunction"


def write(name: str, lines: str, data: bytes) -> None:
    """Write a header with `lines`; the voxels go behind it in a .mha file, and beside it with a .mhd file."""
    path = Path(name)
    data_file = "LOCAL" if path.suffix == ".mha" else path.with_suffix(".zraw").name
    header = f"{HEAD}{lines}ElementDataFile = {data_file}\n".encode()
    path.write_bytes(header + data if data_file == "LOCAL" else header)
    if data_file != "LOCAL":
        path.with_suffix(".zraw").write_bytes(data)


@pytest.mark.parametrize(
    ("name", "lines", "data"),
    [
        *[
            (f"a.{kind}", f"{SIZED}{len(PACKED)}\n", PACKED + pad)
            for kind in ("mha", "mhd")
            for pad in (b"", bytes(60))
        ],
        *[
            (f"a.{kind}", COMPRESSED + size, PACKED)
            for kind in ("mha", "mhd")
            for size in ("", "CompressedDataSize = 0\n")
        ],
        ("a.mhd", f"HeaderSize = 5\n{COMPRESSED}", b"12345" + PACKED),
        *[("a.mha", f"HeaderSize = {skipped:>3}\n", RAW) for skipped in (0, -1, NUM_HEADER_BYTES)],
        ("a.mhd", "HeaderSize = 5\n", b"12345" + RAW + bytes(500)),
        ("a.mhd", "HeaderSize = -1\n", b"12345" + RAW),
        ("a.mha", f"{SCALED}Slope = 1\n{SCALED}Offset = 0.0\n", RAW),
        ("a.mha", "BinaryData = T\nCompressedData = f\n", RAW),
    ],
)
def test_voxels_are_where_the_header_says(folder: Path, name: str, lines: str, data: bytes) -> None:
    write(name, lines, data)
    np.testing.assert_array_equal(read(Path(name)).values, VALUES)


REFUSED = {
    "half.mha": (f"{SIZED}{len(PACKED) // 2}\n", PACKED), "half.mhd": (f"{SIZED}{len(PACKED) // 2}\n", PACKED),
    "long.mha": (f"{SIZED}{len(PACKED) + 9}\n", PACKED), "long.mhd": (f"{SIZED}{len(PACKED) + 9}\n", PACKED),
    "no-begin.mha": (f"HeaderSize = -1\n{COMPRESSED}", PACKED), "elsewhere.mha": ("HeaderSize = 100\n", RAW),
    "short-0.mha": ("HeaderSize = 0\n", RAW[:-9]), "short-1.mha": ("HeaderSize = -1\n", RAW[:-9]),
    "short.mhd": ("HeaderSize = 5\n", RAW), "letter.mha": (f"{SCALED}Slope = x\n", RAW),
}  # fmt: skip


def test_values_are_scaled(folder: Path) -> None:
    """By the slope and the offset of MetaIO: intensity = slope * element + offset."""
    write("a.mha", f"{SCALED}Slope = 0.5\n{SCALED}Offset = -1024\n", RAW)
    found = read(Path("a.mha")).values
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, VALUES * 0.5 - 1024)


@pytest.mark.parametrize(("kinds", "choice"), [("list {}", "component"), ("{} list", "time"), ("{} time", "time")])
def test_kinds_say_which_axis_is_not_in_space(folder: Path, kinds: str, choice: str) -> None:
    lines = "DimSize = {}\nElementSpacing = {}\nKinds = " + kinds.format("domain domain domain") + "\n"
    is_first = kinds.startswith("list")
    sizes, steps = ("4 8 7 1", "9 1 2 3") if is_first else ("8 7 1 4", "1 2 3 9")
    header = HEAD.replace("NDims = 3", "NDims = 4").replace("DimSize = 8 7 4\n", lines.format(sizes, steps))
    stored = np.moveaxis(VALUES, 0, -1) if is_first else VALUES
    Path("a.mha").write_bytes(f"{header}ElementDataFile = LOCAL\n".encode() + stored.tobytes())
    volume = read(Path("a.mha"), **{choice: 2})
    np.testing.assert_array_equal(volume.values, VALUES[2:3])
    assert volume.spacing.tolist() == [1, 2, 3]


def test_what_does_not_fit_is_named(folder: Path) -> None:
    write("a.mha", "AnatomicalOrientation = LAI\nKinds = domain domain list\n", RAW)
    note = read(Path("a.mha")).note or ""
    assert "its AnatomicalOrientation is LAI, which does not fit its directions" in note
    assert "the kinds of its axes are domain domain list; they are seen as a volume" in note


@cases("metaimage.txt")
def test_messages(case: Case, folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    for name, (lines, data) in REFUSED.items():
        write(name, lines, data)
    case.check(capfd)


@pytest.mark.parametrize("data_file", ['"a b.raw"', "'a b.raw'", "a b.raw"])
def test_the_name_of_a_data_file_may_be_quoted(data_file: str, folder: Path) -> None:
    Path("a b.raw").write_bytes(RAW)
    Path("a.mhd").write_text(f"{HEAD}ElementDataFile = {data_file}\n")
    np.testing.assert_array_equal(read(Path("a.mhd")).values, VALUES)
    Path(data_file).write_bytes(RAW[::-1])  # a file may be called so
    assert not np.array_equal(read(Path("a.mhd")).values, VALUES)


@pytest.mark.parametrize("data_file", ['"s %d.raw 0 3 1"', '"s %d.raw" 0 3 1', '"LIST"', '"LOCAL"'])
def test_patterns_and_words_may_be_quoted(data_file: str, folder: Path) -> None:
    for number, plane in enumerate(VALUES):
        Path(f"s {number}.raw").write_bytes(plane.tobytes())
    listed = "".join(f"'s {number}.raw'\n" for number in range(len(VALUES))) if "LIST" in data_file else ""
    header = f"{HEAD}ElementDataFile = {data_file}\n{listed}"
    Path("a.mhd").write_bytes(header.encode() + (RAW if "LOCAL" in data_file else b""))
    np.testing.assert_array_equal(read(Path("a.mhd")).values, VALUES)
