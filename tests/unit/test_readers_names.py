"""Names of files and folders that are not ASCII, or no text at all, in any locale."""

from __future__ import annotations

import os
import shutil
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


@pytest.mark.slow
@pytest.mark.parametrize("locale", LOCALES)
def test_names_of_any_bytes_are_read_in_any_locale(folder: Path, locale: str) -> None:
    """Names in UTF-8 of files and of their folder, and others."""
    os.mkdir(UTF_8)
    for file in (path for path in folder.iterdir() if path.is_file() and path.name not in FILES):
        shutil.copy(os.fsencode(file.name), UTF_8)  # the voxels of headers
    for name in FILES[:-1]:
        for begin in (UTF_8, OTHER):
            shutil.copy(name.encode(), UTF_8 + b"/" + begin + name.encode())
    for begin in (UTF_8, OTHER):
        series = UTF_8 + b"/" + begin + b"dicom"
        shutil.copytree(b"dicom", series)
        os.rename(series + b"/97.dcm", series + b"/" + begin)
    names = [UTF_8 + b"/" + begin + name.encode() for name in FILES for begin in (UTF_8, OTHER)]
    assert found(locale, names) == [str(VALUES.sum())] * 10 + ["303"] * 2


def test_headers_may_name_data_files_of_any_name(folder: Path) -> None:
    for number, data in enumerate((UTF_8, OTHER)):
        Path(os.fsdecode(data)).write_bytes(VALUES.tobytes())
        header = b"NRRD0004\ntype: uint16\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\ndata file: "
        Path(f"{number}.nhdr").write_bytes(header + data + b"\n")
        header = b"NDims = 3\nDimSize = 5 4 3\nElementType = MET_USHORT\nElementDataFile = "
        Path(f"{number}.mhd").write_bytes(header + data + b"\n")
    assert found("ascii", [b"0.nhdr", b"0.mhd", b"1.nhdr", b"1.mhd"]) == [str(VALUES.sum())] * 4
