"""PNG files are read exactly, and every other file is refused."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import pytest
from comparing import compare_files
from png_files import chunk, interlaced, noise, png_file, unfiltered

from renderer.errors import InputError
from renderer.film import Pixels, encode_png, join_png_chunks

RGB, RGBA = noise(1, 13, 9), noise(2, 13, 9, 4)
WHOLE = encode_png(RGB)


def assert_read(folder: Path, content: bytes, image: Pixels) -> None:
    """Require that a file has these pixels."""
    actual = folder / "picture.png"
    actual.write_bytes(content)
    golden = folder / "golden.png"
    golden.write_bytes(encode_png(image))
    assert [frame.status for frame in compare_files(golden, actual).frames] == ["same"]


def refused(folder: Path, content: bytes) -> str:
    """Return why a file is refused, as a golden and as an actual frame."""
    damaged, right = folder / "picture.png", folder / "right.png"
    damaged.write_bytes(content)
    right.write_bytes(WHOLE)
    reasons = set()
    for sides in ((damaged, right), (right, damaged)):
        with pytest.raises(InputError) as caught:
            compare_files(*sides)
        what, got, *_ = str(caught.value).splitlines()
        assert what.startswith(f"{damaged}: ")
        reasons.add(f"{what.removeprefix(f'{damaged}: ')}: {got.removeprefix('  got: ')}")
    (reason,) = reasons
    return reason


@pytest.mark.parametrize("image", [RGB, RGBA], ids=["RGB", "RGBA"])
def test_pixels_are_those_that_were_encoded(tmp_path: Path, image: Pixels) -> None:
    for content in (encode_png(image), interlaced(image)):
        assert_read(tmp_path, content, image)


@pytest.mark.parametrize(
    "more",
    [
        [(b"gAMA", struct.pack(">I", 45455))],
        [(b"iCCP", b"profile\0\0" + zlib.compress(bytes(200)))],
        [(b"tEXt", b"Comment\0" + bytes(range(1, 200)))],
        [(b"eXIf", b"MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0")],  # turned by 90 degrees
        [(b"PLTE", bytes(9))],  # for displays of few colours
        [(b"zTXt", b"Comment\0\0" + zlib.compress(bytes(2**21)))],
    ],
    ids=lambda more: more[0][0].decode(),
)
def test_ancillary_chunks_change_nothing(tmp_path: Path, more: list[tuple[bytes, bytes]]) -> None:
    assert_read(tmp_path, png_file(9, 13, unfiltered(RGB), more=more), RGB)


def test_every_shorter_file_and_every_changed_byte_is_refused(tmp_path: Path) -> None:
    content = encode_png(noise(5, 4, 4))
    for place in range(len(content)):
        assert refused(tmp_path, content[:place])
        changed = bytearray(content)
        changed[place] ^= 1 << (place % 8)
        assert refused(tmp_path, bytes(changed))


def idat(*data: bytes) -> bytes:
    """Return a file of 9 x 13 pixels whose data is in these chunks."""
    header = struct.pack(">IIBBBBB", 9, 13, 8, 2, 0, 0, 0)
    return join_png_chunks([(b"IHDR", header), *((b"IDAT", piece) for piece in data), (b"IEND", b"")])


ROWS = unfiltered(RGB)
DATA = zlib.compress(ROWS)
DAMAGED = "damaged: data that cannot be decoded"
SECOND_HEADER = (b"IHDR", struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0))


@pytest.mark.parametrize(
    ("contents", "why"),
    [
        ([png_file(9, 13, ROWS[:-missing]) for missing in (1, 28, len(ROWS) - 1)], DAMAGED),
        ([idat(DATA[:-cut]) for cut in (7, 60, len(DATA))], DAMAGED),
        ([png_file(9, 13, ROWS + bytes(more)) for more in (1, 28, 10**6)], DAMAGED),
        ([png_file(9, 13, ROWS, more=[strange]) for strange in (SECOND_HEADER, (b"ABCD", b""))], DAMAGED),
        ([png_file(0, 4, b"")], DAMAGED),
        ([WHOLE + b"\r\n", WHOLE + chunk(b"IEND", b"")], "followed by something else: {} bytes"),
        ([join_png_chunks([(b"IEND", b"")])], "damaged: {} bytes"),
        ([png_file(9, 13, ROWS, more=[(b"tEXt", b"")] * 2**16)], "in more than 65536 pieces: {} bytes"),
    ],
    ids=["few rows", "little data", "much data", "critical chunks", "no pixels", "after the end", "end", "many chunks"],
)
def test_damaged_files_are_refused(tmp_path: Path, contents: list[bytes], why: str) -> None:
    for content in contents:
        assert refused(tmp_path, content) == f"the PNG file is {why.format(len(content))}"


def test_data_may_be_in_many_chunks(tmp_path: Path) -> None:
    pieces = [DATA[start : start + 7] for start in range(0, len(DATA), 7)]
    assert_read(tmp_path, idat(*pieces, b""), RGB)
