"""Names of files and folders that are not ASCII, or no text at all, in any locale."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import python
from dicom_files import NORMAL, write_series
from volume_files import write_image

VALUES = np.arange(60, dtype=np.uint16).reshape(3, 4, 5)
READ = """\
import sys
from pathlib import Path
from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec
for name in sys.argv[1:]:
    try:
        print(int(read_volume(VolumeSpec(FileSource(Path(name)))).values.sum()))
    except InputError as error:
        print(ascii(str(error)))
"""
LOCALES = {"utf-8": {"LC_ALL": "C.UTF-8", "PYTHONUTF8": "1"}, "ascii": {"LC_ALL": "C", "PYTHONUTF8": "0"}}
FILES = ("v.nrrd", "v.nhdr", "v.mha", "v.mhd", "v.tif", "dicom")
UTF_8, OTHER = "größe".encode(), b"f\xfcel"

pytestmark = pytest.mark.skipif(sys.platform == "darwin", reason="names of its files are UTF-8")


@pytest.fixture
def folder(folder: Path) -> Path:
    """The current folder, with VALUES in FILES, and a series."""
    for name in FILES[:-1]:
        write_image(Path(name), VALUES, compressed=True)
    Path("dicom").mkdir()
    write_series(Path("dicom"), [k * NORMAL for k in range(3)])
    return folder


def found(locale: str, names: list[bytes]) -> list[str]:
    """Return the sum of the voxels of each file, or a message, from a process in this locale."""
    child = python("-c", READ, *names, **LOCALES[locale])
    assert child.returncode == 0, child.stderr
    return child.stdout.splitlines()


@pytest.mark.parametrize("locale", LOCALES)
def test_names_in_utf_8_are_read_in_any_locale(folder: Path, locale: str) -> None:
    names = [UTF_8 + name.encode() for name in FILES]
    for old, new in zip(FILES, names, strict=True):
        os.rename(old, new)
    sums = [str(VALUES.sum())] * 5 + ["303"]
    assert found(locale, names) == sums
    os.mkdir(UTF_8)
    for name in os.listdir(b"."):
        if name != UTF_8:
            os.rename(name, UTF_8 + b"/" + name)
    os.rename(UTF_8 + b"/" + names[-1] + b"/97.dcm", UTF_8 + b"/" + names[-1] + b"/" + UTF_8)
    assert found(locale, [UTF_8 + b"/" + name for name in names]) == sums


def test_other_names_are_read_as_well(folder: Path) -> None:
    names = [OTHER + name.encode() for name in FILES]
    for old, new in zip(FILES, names, strict=True):
        os.rename(old, new)
    os.rename(names[-1] + b"/97.dcm", names[-1] + b"/" + OTHER)
    for locale in LOCALES:
        assert found(locale, names) == [str(VALUES.sum())] * 5 + ["303"]


def test_headers_may_name_data_files_of_any_name(folder: Path) -> None:
    for number, data in enumerate((UTF_8, OTHER)):
        Path(os.fsdecode(data)).write_bytes(VALUES.tobytes())
        header = b"NRRD0004\ntype: uint16\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\ndata file: "
        Path(f"{number}.nhdr").write_bytes(header + data + b"\n")
        header = b"NDims = 3\nDimSize = 5 4 3\nElementType = MET_USHORT\nElementDataFile = "
        Path(f"{number}.mhd").write_bytes(header + data + b"\n")
    assert found("ascii", [b"0.nhdr", b"0.mhd", b"1.nhdr", b"1.mhd"]) == [str(VALUES.sum())] * 4
