"""What a user reads about NRRD headers at which SimpleITK would end the process."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.readers.headers import check_nrrd_header
from renderer.scene import FileSource, VolumeSpec

VALUES = np.arange(60, dtype=np.uint16).reshape(3, 4, 5)
START = "NRRD0004\ntype: uint16\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n"


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch) -> None:
    """The working directory, so that messages hold names without a path."""
    monkeypatch.chdir(tmp_path)


def message(name: str) -> str:
    with pytest.raises(InputError) as error:
        read_volume(VolumeSpec(FileSource(Path(name))))
    return str(error.value)


def too_long(place: str, shown: str) -> str:
    return (
        f"{place}: a line of this NRRD header is too long\n"
        f"  got: '{shown:.56}...\n"
        "  expected: at most 900 bytes\n"
        "  hint: shorten or remove that line"
    )


@pytest.mark.parametrize("start", ["", "# ", "key:=", "content: ", "data file: "])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("name", ["a.nrrd", "a.NRRD", "a.nhdr", "a.foo", "a"])
def test_line_that_is_too_long(name, end, start):
    header = START.replace("\n", end) + start + "x" * (901 - len(start))
    for rest in (end * 2 + "voxels", ""):
        Path(name).write_bytes((header + rest).encode())
        assert message(name) == too_long(f"{name}:7", start + "x" * 57)


@pytest.mark.parametrize("start", ["# ", "key:=", "content: "])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_line_of_the_longest_kind(end, start):
    header = (START + start + "x" * (900 - len(start)) + "\n\n").replace("\n", end)
    Path("a.nrrd").write_bytes(header.encode() + VALUES.tobytes())
    np.testing.assert_array_equal(read_volume(VolumeSpec(FileSource(Path("a.nrrd")))).values, VALUES)


def test_voxels_have_no_lines():
    Path("a.nrrd").write_bytes(START.encode() + b"\n" + b"x" * 120)
    assert read_volume(VolumeSpec(FileSource(Path("a.nrrd")))).shape_xyz == (5, 4, 3)


@pytest.mark.parametrize("key", ["data file: LIST", "datafile:  LIST 2", "DATA FILE: list"])
def test_name_in_a_list_that_is_too_long(key):
    Path("a.nhdr").write_text(f"{START}{key}\nslice.raw\n\n" + "x" * 901 + "\n", "ascii")
    assert message("a.nhdr") == too_long("a.nhdr:10", "x" * 57)


@pytest.mark.parametrize("dimension", ["11", "16", "+11", "11abc", "4294967307", "0", "-1", "abc", "3.5", "3 11"])
@pytest.mark.parametrize("line", ["dimension: {}", "Dimension:   {} "])
def test_dimension_that_cannot_be_read(line, dimension):
    for before in ("", "dimension: 3\n"):
        text = START.replace("dimension: 3", before + line.format(dimension))
        Path("a.nrrd").write_text(text.replace("5 4 3", "1 " * 11) + "\n", "ascii")
        assert message("a.nrrd") == (
            f"a.nrrd:{4 if before else 3}: this NRRD header has a dimension that cannot be read\n"
            f"  got: {dimension}\n"
            "  expected: a whole number from 1 to 10\n"
            "  hint: correct that line, or save the file again"
        )


def test_most_dimensions():
    text = START.replace("dimension: 3", "dimension: 10").replace("5 4 3", "1 " * 10)
    Path("a.nrrd").write_bytes(text.encode() + b"\n" + bytes(2))
    assert message("a.nrrd") == "a.nrrd: the volume has too many axes\n  got: 10\n  expected: 2 to 4"


def test_path_that_is_too_long():
    folder = Path(*["d" * 200] * 5)
    folder.mkdir(parents=True)
    file = folder / "a.nrrd"
    file.write_bytes(START.encode() + b"\n" + VALUES.tobytes())
    assert message(str(file)) == (
        f"{file}: the path of this NRRD file is too long\n"
        "  got: 1011 bytes\n"
        "  expected: at most 900 bytes\n"
        "  hint: move the file, or name it from a folder near it"
    )


def test_other_formats_are_left_alone():
    Path("a.mha").write_bytes(b"x" * 2000)
    check_nrrd_header(Path("a.mha"))
