"""NRRD and MetaImage headers that name a file for each slice, by a list or by a pattern with numbers."""

from __future__ import annotations

import gzip
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
import volume_files
from transcripts import Case, cases
from volume_files import refused, written

from hsplat_cli.scenes import expand_volumes

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
def folder(folder: Path) -> Path:
    for number, plane in enumerate(VALUES, 1):
        Path(f"slice{number:02}.raw").write_bytes(plane.tobytes())
    return folder


def read(header: str, text: str) -> npt.NDArray[np.generic]:
    return volume_files.read(written(Path(header), text.encode())).values


@pytest.mark.parametrize("header", NAMINGS)
@pytest.mark.parametrize(
    "named",
    [
        LIST, LIST.replace("\n", "\r\n"), LIST.replace("slice", '"slice').replace(".raw", '.raw"'),
        '"slice%02d.raw" 1 4 1\n', LIST.replace("LIST", "LIST 2"), LIST.replace("LIST", "LIST 2D"),
        "slice%02d.raw 1 4 1\n", "slice%02d.raw 1 4 1 2\n", "slice%02d.raw\n",
    ],
)  # fmt: skip
def test_each_slice_has_a_file(header: str, named: str) -> None:
    np.testing.assert_array_equal(read(header, NAMINGS[header] + named), VALUES)


@pytest.mark.parametrize("header", NAMINGS)
def test_numbers_may_decrease_and_names_have_blanks(header: str) -> None:
    for number in range(1, 5):
        Path(f"slice{number:02}.raw").rename(f"a slice {number} of 4.raw")
    np.testing.assert_array_equal(read(header, NAMINGS[header] + "a slice %d of 4.raw 4 1 -1\n"), VALUES[::-1])


def test_blanks_after_names_are_ignored() -> None:
    np.testing.assert_array_equal(read("v.mhd", NAMINGS["v.mhd"] + LIST.replace(".raw", ".raw \t")), VALUES)


@pytest.mark.parametrize("header", NAMINGS)
@pytest.mark.parametrize("named", ["LIST 3\nslab1.raw\nslab2.raw\n", "slab%d.raw 1 2 1 3\n"])
def test_each_slab_has_a_file(header: str, named: str) -> None:
    """As teem reads files that have all axes of the array."""
    for number in (1, 2):
        Path(f"slab{number}.raw").write_bytes(VALUES[2 * number - 2 : 2 * number].tobytes())
    np.testing.assert_array_equal(read(header, NAMINGS[header] + named), VALUES)
    refused(
        written(Path(header), (NAMINGS[header] + LIST.replace("LIST", "LIST 3")[:-12]).encode()), match="3 files for 4"
    )


def test_slabs_of_steps_in_time() -> None:
    text = NAMINGS["v.nhdr"].replace("3\nsizes: 8 7 4", "4\nkinds: domain domain domain time\nsizes: 8 7 1 4")
    for number in (1, 2):
        Path(f"slab{number}.raw").write_bytes(VALUES[2 * number - 2 : 2 * number].tobytes())
    Path("v.nhdr").write_text(text + "LIST 4\nslab1.raw\nslab2.raw\n", "ascii")
    np.testing.assert_array_equal(volume_files.read(Path("v.nhdr"), time=2).values, VALUES[2:3])


@pytest.mark.parametrize("header", NAMINGS)
def test_files_lie_beside_the_file_that_a_header_is_a_link_to(header: str) -> None:
    written(Path(header), (NAMINGS[header] + LIST).encode())
    Path("elsewhere").mkdir()
    link = Path("elsewhere", header)
    link.symlink_to(Path(header).absolute())
    np.testing.assert_array_equal(volume_files.read(link).values, VALUES)
    Path("elsewhere", "slice01.raw").write_bytes(bytes(2 * 8 * 7))  # one beside the link counts
    assert not volume_files.read(link).values[0].any()


def test_components_may_be_the_last_axis() -> None:
    text = NAMINGS["v.nhdr"].replace("sizes: 8 7 4", "sizes: 8 7 1 4\nkinds: domain domain domain vector")
    Path("v.nhdr").write_text(text.replace("dimension: 3", "dimension: 4") + LIST.replace("LIST", "LIST 3"), "ascii")
    found = volume_files.read(Path("v.nhdr"), component=2).values
    np.testing.assert_array_equal(found, VALUES[2:3])


@pytest.mark.parametrize("skipped", [-1, 0, 5])
def test_slices_may_have_headers_of_their_own(skipped: int) -> None:
    header = f"HeaderSize = {skipped}\n" + NAMINGS["v.mhd"]
    for number, plane in enumerate(VALUES, 1):
        Path(f"slice{number:02}.raw").write_bytes(bytes(max(0, skipped)) + plane.tobytes())
    np.testing.assert_array_equal(read("v.mhd", header + LIST), VALUES)
    for named in (LIST[:-12], "slice%02d.raw 1 4 3\n"):
        refused(written(Path("v.mhd"), (header + named).encode()), match="too few data files")
    Path("slice03.raw").write_bytes(VALUES[2].tobytes()[:-1])
    refused(written(Path("v.mhd"), (header + LIST).encode()), match="shorter than its header says")


def test_slices_may_be_compressed() -> None:
    for path in Path().glob("slice*.raw"):
        path.write_bytes(gzip.compress(path.read_bytes()))
    text = NAMINGS["v.nhdr"].replace("encoding: raw", "encoding: gzip") + LIST
    np.testing.assert_array_equal(read("v.nhdr", text), VALUES)
    damaged = bytearray(Path("slice03.raw").read_bytes())
    damaged[-6] ^= 0x10  # in the checksum
    Path("slice03.raw").write_bytes(damaged)
    refused(written(Path("v.nhdr"), text.encode()), match=r"slice03\.raw: the compressed voxels are damaged")


@pytest.mark.parametrize("header", NAMINGS)
def test_names_are_not_of_ascii_alone(header: str) -> None:
    Path("slice03.raw").rename("größe.raw")
    np.testing.assert_array_equal(read(header, NAMINGS[header] + LIST.replace("slice03", "größe")), VALUES)
    Path("Ålesund.raw").write_bytes(VALUES.tobytes())
    np.testing.assert_array_equal(read(header, NAMINGS[header] + "Ålesund.raw\n"), VALUES)


# Names of data files that are refused.
REFUSED = {
    "gone": LIST.replace("slice03", "gone03"), "gone-in-pattern": "gone%02d.raw 1 4 1\n",
    "gone-at-once": "gone%02d.raw 1 999999999 1\n", "short": LIST.replace("slice03", "short03"),
    "short-in-pattern": "short%02d.raw 1 4 1\n", "few": LIST[:-12], "many": LIST + "slice01.raw\n",
    "one": "LIST\nall.raw\n", "way-0": "slice%02d%n.raw 1 4 1\n", "way-1": "slice%09999d.raw 1 4 1\n",
    "way-2": "%s%d.raw 1 4 1\n", "way-3": "slice%02d.raw 1 4 0\n", "way-7": "LIST 1\n", "way-8": "LIST two\n",
    "way-9": "LIST\n", "percent": "100%.raw\n",
}  # fmt: skip


@cases("slice_files.txt")
def test_messages(case: Case, capfd: pytest.CaptureFixture[str]) -> None:
    for header, start in NAMINGS.items():
        for name, named in REFUSED.items():
            Path(header).with_stem(name).write_text(start + named)
    for number, plane in enumerate(VALUES, 1):
        Path(f"short{number:02}.raw").write_bytes(plane.tobytes()[: 111 if number == 3 else None])
        if number != 3:
            Path(f"gone{number:02}.raw").write_bytes(plane.tobytes())
    Path("all.raw").write_bytes(VALUES.tobytes())
    case.check(capfd)


@pytest.mark.parametrize("header", NAMINGS)
def test_a_name_with_a_percent_sign(header: str) -> None:
    Path("100%.raw").write_bytes(VALUES.tobytes())
    np.testing.assert_array_equal(read(header, NAMINGS[header] + "100%.raw\n"), VALUES)


@pytest.mark.parametrize("header", NAMINGS)
def test_files_may_hold_fewer_axes_than_a_slice(header: str) -> None:
    for number, row in enumerate(VALUES.reshape(28, 8), 1):
        Path(f"row{number:02}.raw").write_bytes(row.tobytes())
    np.testing.assert_array_equal(read(header, NAMINGS[header] + "row%02d.raw 1 28 1 1\n"), VALUES)


@pytest.mark.parametrize("header", NAMINGS)
def test_slices_are_left_out_beside_their_header(header: str) -> None:
    Path(header).write_text(NAMINGS[header] + LIST, encoding="ascii")
    assert expand_volumes(["*"])[0] == [Path(header)]
