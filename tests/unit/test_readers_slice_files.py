"""NRRD and MetaImage headers that name a file for each slice, by a list or by a pattern with numbers."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from hsplat_cli.scenes import expand_volumes
from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec

VALUES = np.random.default_rng(0).integers(0, 2000, (4, 7, 8)).astype("<u2")
LIST = "LIST\nslice01.raw\nslice02.raw\nslice03.raw\nslice04.raw\n"
NAMINGS = {
    "v.nhdr": ("NRRD0004\ntype: uint16\ndimension: 3\nsizes: 8 7 4\nendian: little\nencoding: raw\ndata file: "),
    "v.mhd": (
        "ObjectType = Image\nNDims = 3\nBinaryDataByteOrderMSB = False\nDimSize = 8 7 4\nElementType = MET_USHORT\n"
        "ElementDataFile = "
    ),
}


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    for number, plane in enumerate(VALUES, 1):
        Path(f"slice{number:02}.raw").write_bytes(plane.tobytes())
    return tmp_path


def read(header: str, text: str) -> npt.NDArray[np.generic]:
    Path(header).write_bytes(text.encode())
    return read_volume(VolumeSpec(FileSource(Path(header)))).values


def refusal(header: str, named: str) -> str:
    with pytest.raises(InputError) as error:
        read(header, NAMINGS[header] + named)
    return str(error.value)


@pytest.mark.parametrize("header", NAMINGS)
@pytest.mark.parametrize(
    "named", [LIST, LIST.replace("\n", "\r\n"), LIST.replace("LIST", "LIST 2"), "slice%02d.raw 1 4 1\n"]
)
def test_each_slice_has_a_file(header: str, named: str) -> None:
    np.testing.assert_array_equal(read(header, NAMINGS[header] + named), VALUES)


def test_blanks_behind_names_are_none_of_them() -> None:
    np.testing.assert_array_equal(read("v.mhd", NAMINGS["v.mhd"] + LIST.replace(".raw", ".raw \t")), VALUES)


def test_components_may_be_the_last_axis() -> None:
    text = NAMINGS["v.nhdr"].replace("sizes: 8 7 4", "sizes: 8 7 1 4\nkinds: domain domain domain vector")
    Path("v.nhdr").write_text(text.replace("dimension: 3", "dimension: 4") + LIST.replace("LIST", "LIST 3"), "ascii")
    found = read_volume(VolumeSpec(FileSource(Path("v.nhdr")), component=2)).values
    np.testing.assert_array_equal(found, VALUES[2:3])


@pytest.mark.parametrize("skipped", [-1, 0, 5])
def test_slices_behind_headers_of_their_own(skipped: int) -> None:
    header = f"HeaderSize = {skipped}\n" + NAMINGS["v.mhd"]
    for number, plane in enumerate(VALUES, 1):
        Path(f"slice{number:02}.raw").write_bytes(bytes(max(0, skipped)) + plane.tobytes())
    np.testing.assert_array_equal(read("v.mhd", header + LIST), VALUES)
    for named, what in ((LIST[:-12], "too few data files"), ("slice%02d.raw 1 4 3\n", "too few data files")):
        with pytest.raises(InputError, match=what):
            read("v.mhd", header + named)
    Path("slice03.raw").write_bytes(VALUES[2].tobytes()[:-1])
    with pytest.raises(InputError, match="shorter than its header says"):
        read("v.mhd", header + LIST)


def test_slices_may_be_compressed() -> None:
    for path in Path().glob("slice*.raw"):
        path.write_bytes(gzip.compress(path.read_bytes()))
    text = NAMINGS["v.nhdr"].replace("encoding: raw", "encoding: gzip") + LIST
    np.testing.assert_array_equal(read("v.nhdr", text), VALUES)
    damaged = bytearray(Path("slice03.raw").read_bytes())
    damaged[-6] ^= 0x10  # in the checksum
    Path("slice03.raw").write_bytes(damaged)
    with pytest.raises(InputError, match=r"slice03\.raw: the compressed voxels are damaged"):
        read("v.nhdr", text)


@pytest.mark.parametrize("header", NAMINGS)
def test_names_are_not_of_ascii_alone(header: str) -> None:
    Path("slice03.raw").rename("größe.raw")
    np.testing.assert_array_equal(read(header, NAMINGS[header] + LIST.replace("slice03", "größe")), VALUES)
    Path("Ålesund.raw").write_bytes(VALUES.tobytes())
    np.testing.assert_array_equal(read(header, NAMINGS[header] + "Ålesund.raw\n"), VALUES)


@pytest.mark.parametrize("header", NAMINGS)
def test_a_slice_that_is_not_there(header: str) -> None:
    Path("slice03.raw").unlink()
    for named in (LIST, "slice%02d.raw 1 4 1\n", "slice%02d.raw 1 999999999 1\n"):
        assert refusal(header, named) == (
            f"{header}: the data file that this header names is not there\n"
            "  got: slice03.raw\n"
            "  expected: a file slice03.raw\n"
            "  hint: the two belong together: move or copy both"
        )


@pytest.mark.parametrize("header", NAMINGS)
@pytest.mark.parametrize("named", [LIST, "slice%02d.raw 1 4 1\n"])
def test_a_slice_that_is_too_short(header: str, named: str) -> None:
    Path("slice03.raw").write_bytes(VALUES[2].tobytes()[:-1])
    assert refusal(header, named) == (
        "slice03.raw: the file is shorter than its header says\n"
        "  got: 111 bytes\n"
        "  expected: 112 bytes (8 x 7 voxels)\n"
        "  hint: the file is truncated or its header is wrong"
    )


@pytest.mark.parametrize(("named", "got", "few"), [(LIST[:-12], 3, "few"), (LIST + "slice01.raw\n", 5, "many")])
def test_another_number_of_slices(named: str, got: int, few: str) -> None:
    """SimpleITK would leave memory as it finds it where files are missing."""
    assert refusal("v.mhd", named) == (
        f"v.mhd: this header names too {few} data files\n"
        f"  got: {got}\n"
        "  expected: 4, one for each slice of 8 x 7 x 4 voxels"
    )
    assert refusal("v.nhdr", named) == (
        f"v.nhdr: cannot read the header\n  got: expected 4 filenames (of 2-D pieces) but got {got}\n"
        "  hint: the file is damaged, or of a kind that cannot be read"
    )


def test_a_single_file_that_is_listed_is_a_slice() -> None:
    Path("all.raw").write_bytes(VALUES.tobytes())
    assert "too few data files" in refusal("v.mhd", "LIST\nall.raw\n")


@pytest.mark.parametrize("header", NAMINGS)
@pytest.mark.parametrize(
    "named",
    [
        "slice%02d%n.raw 1 4 1",  # of these some would end the process: they are given to printf
        "slice%09999d.raw 1 4 1",
        "%s%d.raw 1 4 1",
        "slice%02d.raw 1 4 0",
        "slice%02d.raw 4 1 -1",
        "slice%02d.raw 1 4 1 2",
        "slice%02d.raw",
        "LIST 1",
        "LIST two",
        "LIST",
    ],
)
def test_other_ways_to_name_files(header: str, named: str) -> None:
    assert refusal(header, f"{named}\n") == (
        f"{header}: data files cannot be named in this way\n"
        f"  got: {named}\n"
        "  expected: one file, LIST, or a pattern with first number, last and step, such as slice%03d.raw 1 60 1\n"
        "  hint: write LIST, and below it the name of the file of each slice on its own line"
    )


def test_a_name_with_a_percent_sign() -> None:
    Path("100%.raw").write_bytes(VALUES.tobytes())
    np.testing.assert_array_equal(read("v.nhdr", NAMINGS["v.nhdr"] + "100%.raw\n"), VALUES)
    assert "cannot be named in this way" in refusal("v.mhd", "100%.raw\n")


@pytest.mark.parametrize("header", NAMINGS)
def test_slices_are_left_out_beside_their_header(header: str) -> None:
    Path(header).write_text(NAMINGS[header] + LIST, encoding="ascii")
    assert expand_volumes(["*"])[0] == [Path(header)]
