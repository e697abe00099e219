"""MetaImage headers that say where the voxels are, how long they are compressed, and that they are to be scaled."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec

VALUES = np.random.default_rng(0).integers(0, 2000, (4, 7, 8)).astype("<u2")
RAW, PACKED = VALUES.tobytes(), zlib.compress(VALUES.tobytes())
HEAD = "ObjectType = Image\nNDims = 3\nBinaryDataByteOrderMSB = False\nDimSize = 8 7 4\nElementType = MET_USHORT\n"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def write(lines: str, data: bytes, *, is_local: bool = True) -> Path:
    """A header with `lines`, and the voxels behind it or in a file beside it."""
    path = Path("a.mha" if is_local else "a.mhd")
    header = f"{HEAD}{lines}ElementDataFile = {'LOCAL' if is_local else 'a.zraw'}\n".encode()
    path.write_bytes(header + data if is_local else header)
    if not is_local:
        Path("a.zraw").write_bytes(data)
    return path


def read(path: Path) -> npt.NDArray[np.generic]:
    return read_volume(VolumeSpec(FileSource(path))).values


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as error:
        read(path)
    return str(error.value)


@pytest.mark.parametrize("is_local", [True, False])
@pytest.mark.parametrize("padding", [0, 60])
def test_compressed_voxels_of_a_length_that_is_said(is_local: bool, padding: int) -> None:
    lines = f"CompressedData = True\nCompressedDataSize = {len(PACKED)}\n"
    np.testing.assert_array_equal(read(write(lines, PACKED + bytes(padding), is_local=is_local)), VALUES)


@pytest.mark.parametrize("is_local", [True, False])
def test_compressed_voxels_of_a_wrong_length(is_local: bool, capfd: pytest.CaptureFixture[str]) -> None:
    """Their reader would leave the values as it finds the memory, or fail with words of its own on the terminal."""
    lines = "CompressedData = True\nCompressedDataSize = "
    short = write(f"{lines}{len(PACKED) // 2}\n", PACKED, is_local=is_local)
    assert "the compressed voxels are damaged\n  got: the compressed data break off after" in refusal(short)
    long = write(f"{lines}{len(PACKED) + 9}\n", PACKED, is_local=is_local)
    assert refusal(long) == (
        f"{'a.mha' if is_local else 'a.zraw'}: the file is shorter than its header says\n"
        f"  got: {len(PACKED)} bytes\n"
        f"  expected: {len(PACKED) + 9} bytes of compressed voxels\n"
        "  hint: the file is truncated or its header is wrong"
    )
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("size", ["", "CompressedDataSize = 0\n"])
def test_compressed_voxels_of_no_length(size: str) -> None:
    lines = f"CompressedData = True\n{size}"
    np.testing.assert_array_equal(read(write(lines, PACKED, is_local=False)), VALUES)
    assert refusal(write(lines, PACKED)) == (
        "a.mha: this MetaImage header does not say how long its compressed voxels are\n"
        "  got: no CompressedDataSize\n"
        "  expected: CompressedDataSize = n, in bytes, before ElementDataFile\n"
        f"  hint: n is {len(PACKED)} where nothing comes behind them"
    )
    behind = write(f"HeaderSize = 5\n{lines}", b"12345" + PACKED, is_local=False)
    assert "does not say how long its compressed voxels are" in refusal(behind)
    assert "does not say where its compressed voxels begin" in refusal(write(f"HeaderSize = -1\n{lines}", PACKED))


def test_header_size_of_local_voxels() -> None:
    num_bytes = len(f"{HEAD}HeaderSize = 999\nElementDataFile = LOCAL\n")
    for skipped in ("0", "-1", f"{num_bytes:03}"):
        np.testing.assert_array_equal(read(write(f"HeaderSize = {skipped:>3}\n", RAW)), VALUES)
    assert refusal(write("HeaderSize = 100\n", RAW)) == (
        "a.mha: this MetaImage header places the voxels elsewhere than behind it\n"
        "  got: HeaderSize = 100 with ElementDataFile = LOCAL\n"
        f"  expected: HeaderSize = {num_bytes}, the bytes of the header, or none\n"
        "  hint: remove the line HeaderSize"
    )
    for skipped in ("0", "-1"):  # whose reader would take the header's text for voxels with the second
        assert "shorter than its header says" in refusal(write(f"HeaderSize = {skipped}\n", RAW[:-9]))


def test_header_size_of_another_file() -> None:
    np.testing.assert_array_equal(read(write("HeaderSize = 5\n", b"12345" + RAW + bytes(500), is_local=False)), VALUES)
    np.testing.assert_array_equal(read(write("HeaderSize = -1\n", b"12345" + RAW, is_local=False)), VALUES)
    assert "shorter than its header says" in refusal(write("HeaderSize = 5\n", RAW, is_local=False))


@pytest.mark.parametrize("line", ["Slope = 2", "Offset = -1024", "Slope = x"])
def test_values_that_are_to_be_scaled(line: str) -> None:
    neutral = "ElementToIntensityFunctionSlope = 1\nElementToIntensityFunctionOffset = 0.0\n"
    np.testing.assert_array_equal(read(write(neutral, RAW)), VALUES)
    assert refusal(write(f"ElementToIntensityFunction{line}\n", RAW)) == (
        "a.mha: MetaImage voxels that are to be scaled cannot be read\n"
        f"  got: ElementToIntensityFunction{line}\n"
        f"  expected: ElementToIntensityFunction{line.split(maxsplit=1)[0]} = {0 if 'Offset' in line else 1}\n"
        "  hint: correct that line to have the values as they are in the file, or save scaled ones"
    )
