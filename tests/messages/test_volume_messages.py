"""What a user reads when a volume cannot be read; nothing of it is a library's."""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.readers.headers import check_nrrd_header
from renderer.readers.itk import shorten_itk_error
from renderer.scene import FileSource, RawSource, VolumeSpec
from tests.support.tiff_files import COMPRESSION, SHORT, tiff
from tests.support.transcripts import Case, cases

VALUES = np.arange(60, dtype=np.uint16).reshape(3, 4, 5)
NRRD = "NRRD0004\ntype: uint16\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n"
META = "NDims = 3\nDimSize = 5 4 3\nElementType = MET_USHORT\nElementDataFile = LOCAL\n"
SCENE = """\
volume: {file: scan.npy}
transfer_function: {points: [{value: 0, color: white, opacity: 0}, {value: 60, color: white, opacity: 1}]}
camera: {path: {type: turntable, frames: 2}}
output: {file: film.mp4, size: [32, 32]}
"""

# Lines of a MetaImage header that do not have their numbers, by the name of the file.
META_LINES = {
    "no-length": "ElementSpacing = 0 1 1",
    "no-number": "ElementSpacing = nan 1 1",
    "no-size": "ElementSize = 1 1 -inf",
    "too-few": "DimSize = 5 4",
    "no-counts": "DimSize = 5 4 -3",
    "parts": "DimSize = 5 4 2.5",
    "no-axes": "NDims = three",
    "no-origin": "Offset = nan 0 0",
    "half-an-origin": "Position = 0 0",
    "flat": "TransformMatrix = 1 0 0 0 1 0 0 0 0",
    "digits": f"TransformMatrix = {6 * '0.90630778703664994 '}0 0 0",
    "bell": "Offset = \a 0 0",
    "axis-twice": "TransformMatrix = 1 0 0 0 1 0 1 0 0",
}


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of volumes, most of them with one fault."""
    folder = tmp_path_factory.mktemp("volumes")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("scene.yaml").write_text(SCENE, "utf-8")
        os.mkfifo("pipe.npy")
        for name in ("empty.nrrd", "empty.nii", "empty.tif", "empty.npy", "empty.mha"):
            Path(name).touch()
        Path("text.vol").write_bytes(b"hello")
        write_arrays()
        write_images()
        write_headers()
    return folder


def write_arrays() -> None:
    np.save("scan.npy", VALUES)
    Path("short.npy").write_bytes(Path("scan.npy").read_bytes()[:-1])
    with_nan = VALUES.astype(np.float32)
    with_nan[1, 2, 3] = with_nan[2, 0, 0] = np.nan
    for name, values in {
        "nan": with_nan,
        "half": with_nan.astype(np.float16),
        "inf": np.full((2, 2, 2), np.inf),
        "four": np.zeros((2, 3, 4, 5)),
        "single": np.float32(1),
        "none": np.zeros((3, 0, 4)),
        "large": 2**60 + VALUES.astype(np.int64),
        "bool": np.zeros((2, 2, 2), bool),
        "complex": np.zeros((2, 2, 2), complex),
        "records": np.zeros((2, 2, 2), [("a", "u1"), ("b", "f4")]),
        "objects": np.zeros((2, 2, 2), object),
    }.items():
        np.save(f"{name}.npy", values)
    for name, damage in {"header": slice(10, 40), "brackets": slice(60, 70), "bracket": slice(20, 21)}.items():
        data = bytearray(Path("scan.npy").read_bytes())
        data[damage] = b"(" * len(data[damage])
        Path(f"{name}.npy").write_bytes(data)
    Path("bare.raw").write_bytes(bytes(160))


def write_images() -> None:
    """Write volumes by their libraries, and remove or change a part of them."""
    image = sitk.GetImageFromArray(VALUES)
    for name in ("lonely.nhdr", "lonely.mhd", "cut.nhdr", "cut.nrrd", "cut.mha", "cut.nii", "pages.tif", "cut.tif"):
        sitk.WriteImage(image, name)
    Path("lonely.raw").unlink()
    Path("cut.raw").write_bytes(bytes(3))
    for name in ("cut.nrrd", "cut.mha", "cut.nii"):
        Path(name).write_bytes(Path(name).read_bytes()[:-7])
    Path("cut.tif").write_bytes(Path("cut.tif").read_bytes()[:400])
    data, kind_of_page = bytearray(Path("pages.tif").read_bytes()), bytes([254, 0, 4, 0, 1, 0, 0, 0])
    data[data.index(kind_of_page, data.index(kind_of_page) + 1) + len(kind_of_page)] = 1
    Path("pages.tif").write_bytes(data)
    nib.Nifti1Pair(VALUES, np.eye(4)).to_filename("half.hdr")
    Path("half.img").unlink()
    nifti = nib.Nifti1Image(VALUES, np.eye(4))
    nifti.header.set_sform(np.diag([np.nan, 1, 1, 1]), 1)
    nifti.header["pixdim"][1:4] = np.nan
    nib.Nifti1Image(VALUES, None, nifti.header).to_filename("nan.nii")
    sitk.WriteImage(sitk.GetImageFromArray(np.zeros((7, 3, 4, 5), np.uint8), isVector=False), "times.mha")
    sitk.WriteImage(sitk.GetImageFromArray(np.zeros((3, 4, 5, 3), np.uint8), isVector=True), "colours.mha")
    for folder in ("nothing", "widths", "several"):
        Path(folder).mkdir()
        for k, width in enumerate((5, 5, 6) if folder == "widths" else (5, 5) if folder == "several" else ()):
            sitk.WriteImage(sitk.GetImageFromArray(np.zeros((4, width), np.uint8)), f"{folder}/{k}.tif")
    sitk.WriteImage(sitk.GetImageFromArray(np.zeros((2, 4, 5), np.uint8)), "several/2.tif")
    sitk.WriteImage(image, "whole.mhd")
    lines = Path("whole.mhd").read_text().splitlines()
    for name, line in META_LINES.items():
        key = {"Position": "Offset", "ElementSize": "ElementSpacing"}.get(line.split()[0], line.split()[0])
        kept = [each for each in lines if each.split()[0] != key]
        assert len(kept) == len(lines) - 1
        Path(f"{name}.mhd").write_text("\n".join([*kept[:2], line, *kept[2:]]) + "\n")


def write_headers() -> None:
    """Write files byte by byte."""
    packed, gzip_header = gzip.compress(VALUES.tobytes()), NRRD.replace("raw", "gzip")
    voxels, axes = bytes(8), "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspace dimension: 3\nencoding: raw\n"
    for name, header, data in (
        ("checksum", gzip_header, packed[:-4] + bytes(4)),
        ("broken-off", gzip_header, packed[:-1]),
        ("too-little", gzip_header, gzip.compress(bytes(100))),
        ("half", NRRD.replace("uint16", "half"), b""),
        ("bzip2", NRRD.replace("raw", "bzip2"), b"BZh9"),
        ("huge", NRRD.replace("5 4 3", "100000 90000 80000"), b""),
        ("flat", f"{axes}space directions: (1,0,0) (1,0,0) (0,0,1)\n", voxels),
        ("no-length", f"{NRRD}spacings: NaN 1 2\n", VALUES.tobytes()),
        ("ten-axes", NRRD.replace("dimension: 3", "dimension: 10").replace("5 4 3", "1 " * 10), bytes(2)),
    ):
        Path(f"{name}.nrrd").write_bytes(f"{header}\n".encode() + data)
    Path("words.mha").write_bytes(f"BinaryData = False\n{META}".encode() + b"no digits " * 60)
    for number in (50000, 34925, 50001, 4321, 8):
        Path(f"{number}.tif").write_bytes(tiff({COMPRESSION: (SHORT, 1, number)}))


@cases("volumes.txt")
def test_messages(case: Case, files: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(files)
    case.check(capfd)


def message(name: str) -> str:
    with pytest.raises(InputError) as error:
        read_volume(VolumeSpec(FileSource(Path(name))))
    return str(error.value)


def raising(error: Exception):
    def fail(*_args):
        raise error

    return fail


@pytest.mark.parametrize(
    ("target", "replacement", "expected"),
    [
        ("os.access", lambda *_: False, "no permission to read this"),  # root may read everything
        ("numpy.memmap", raising(OSError(5, "Input/output error")), "cannot read this file\n  got: Input/output error"),
        (
            "renderer.readers.read._load",
            raising(MemoryError()),
            "there is not enough memory for this volume\n  hint: `crop` it, or render on a larger machine",
        ),
        (
            "SimpleITK.ImageFileReader.Execute",
            raising(RuntimeError("Exception thrown in SimpleITK ImageFileReader_Execute:\nstd::bad_alloc")),
            "there is not enough memory for this volume\n  hint: `crop` it, or render on a larger machine",
        ),
    ],
)
def test_errors_of_the_system(folder, monkeypatch, target, replacement, expected):
    name = "a.mha" if "SimpleITK" in target else "a.npy"
    if name == "a.npy":
        np.save(name, VALUES)
    else:
        sitk.WriteImage(sitk.GetImageFromArray(VALUES), name, True)
    monkeypatch.setattr(target, replacement)
    assert message(name) == f"{name}: {expected}"


def test_messages_have_no_words_of_a_library():
    text = "itk ERROR: GDCMImageIO(0x1): GetVR().Compatible( de.GetVR() ) || de.GetVR() == VR::INVALID"
    assert [shorten_itk_error(each) for each in (text, "std::bad_alloc")] == [None, None]
    assert shorten_itk_error("a()\n[nrrd] nrrdLoad: couldn't parse type") == "couldn't parse type"


def test_a_raw_file_of_a_type_that_only_the_python_api_can_name(folder):
    Path("a.raw").write_bytes(bytes(120))
    with pytest.raises(InputError) as error:
        read_volume(VolumeSpec(RawSource(Path("a.raw"), (5, 4, 3), "short16")))
    expected = "  got: short16\n  expected: a numpy name such as uint8, int16 or float32"
    assert str(error.value) == f"a.raw: no such data type\n{expected}"


def test_numbers_of_a_metaimage_may_stand_on_several_lines(folder):
    sitk.WriteImage(sitk.GetImageFromArray(VALUES), "a.mhd")
    text = Path("a.mhd").read_text().replace("TransformMatrix = 1 0 0 0 1 0 ", "TransformMatrix = 1 0 0\n0 1 0\n")
    assert "0 1 0\n0 0 1" in text
    Path("a.mhd").write_text(text)
    np.testing.assert_array_equal(read_volume(VolumeSpec(FileSource(Path("a.mhd")))).values, VALUES)


ASSUMED = "the file does not give its voxel size; 1 x 1 x 1 is assumed"


@pytest.mark.parametrize(
    ("name", "header", "spacing", "note"),
    [
        ("a.nrrd", f"{NRRD}\n", [1, 1, 1], ASSUMED),
        ("a.nrrd", f"{NRRD}space: LPS\nspace origin: (0,0,0)\n\n", [1, 1, 1], ASSUMED),
        ("a.mha", META, [1, 1, 1], ASSUMED),
        ("a.mha", f"elementspacing = 1 2 3\n{META}", [1, 1, 1], ASSUMED),  # no key of its reader's
        ("a.mha", META.replace("DimSize", "ElementSize = 1 1 1\nDimSize"), [1, 1, 1], None),
        (
            "a.nrrd",
            NRRD.replace(": 3", ": 4").replace("5 4 3", "1 5 4 3")
            + "spacings: NaN 1 2 3\nkinds: vector domain domain domain\n\n",
            [1, 2, 3],
            None,
        ),
    ],
)
def test_missing_lengths_are_1_and_noted(folder, name, header, spacing, note):
    Path(name).write_bytes(header.encode() + VALUES.tobytes())
    volume = read_volume(VolumeSpec(FileSource(Path(name))))
    assert (volume.spacing.tolist(), volume.note) == (spacing, note)
    assert read_volume(VolumeSpec(FileSource(Path(name), (1.0, 1.0, 2.0)))).note is None


# NRRD headers at which SimpleITK would end the process


def too_long(place: str, shown: str) -> str:
    return (
        f"{place}: a line of this NRRD header is too long\n"
        f"  got: '{shown:.56}...\n"
        "  expected: at most 900 bytes\n"
        "  hint: shorten or remove that line"
    )


@pytest.mark.parametrize("start", ["", "# ", "key:=", "content: ", "data file: "])
@pytest.mark.parametrize(
    ("name", "end"), [("a.nrrd", "\n"), ("a.NRRD", "\r\n"), ("a.nhdr", "\r"), ("a.foo", "\n"), ("a", "\r\n")]
)
def test_lines_have_at_most_900_bytes(folder, name, end, start):
    header = NRRD.replace("\n", end) + start + "x" * (901 - len(start))
    for rest in (end * 2 + "voxels", ""):
        Path(name).write_bytes((header + rest).encode())
        assert message(name) == too_long(f"{name}:7", start + "x" * 57)
    if start != "data file: " and end != "\r":
        longest = (NRRD + start + "x" * (900 - len(start)) + "\n\n").replace("\n", end)
        Path("b.nrrd").write_bytes((longest if start else NRRD + "\n").encode() + VALUES.tobytes())
        np.testing.assert_array_equal(read_volume(VolumeSpec(FileSource(Path("b.nrrd")))).values, VALUES)


def test_voxels_have_no_lines(folder):
    Path("a.nrrd").write_bytes(NRRD.encode() + b"\n" + b"x" * 120)
    assert read_volume(VolumeSpec(FileSource(Path("a.nrrd")))).shape_xyz == (5, 4, 3)
    Path("a.mha").write_bytes(b"x" * 2000)
    check_nrrd_header(Path("a.mha"))


@pytest.mark.parametrize("key", ["data file: LIST", "datafile:  LIST 2", "DATA FILE: list"])
def test_names_in_a_list_have_at_most_900_bytes(folder, key):
    Path("a.nhdr").write_text(f"{NRRD}{key}\nslice.raw\n\n" + "x" * 901 + "\n", "ascii")
    assert message("a.nhdr") == too_long("a.nhdr:10", "x" * 57)


@pytest.mark.parametrize("dimension", ["11", "16", "+11", "11abc", "4294967307", "0", "-1", "abc", "3.5", "3 11"])
@pytest.mark.parametrize("line", ["dimension: {}", "Dimension:   {} "])
def test_dimensions_are_from_1_to_10(folder, line, dimension):
    for before in ("", "dimension: 3\n"):
        text = NRRD.replace("dimension: 3", before + line.format(dimension)).replace("5 4 3", "1 " * 11)
        Path("a.nrrd").write_text(text + "\n", "ascii")
        assert message("a.nrrd") == (
            f"a.nrrd:{4 if before else 3}: this NRRD header has a dimension that cannot be read\n"
            f"  got: {dimension}\n"
            "  expected: a whole number from 1 to 10\n"
            "  hint: correct that line, or save the file again"
        )


def test_paths_have_at_most_900_bytes(folder):
    file = Path(*["d" * 200] * 5, "a.nrrd")
    file.parent.mkdir(parents=True)
    file.write_bytes(NRRD.encode() + b"\n" + VALUES.tobytes())
    assert message(str(file)) == (
        f"{file}: the path of this NRRD file is too long\n"
        "  got: 1011 bytes\n"
        "  expected: at most 900 bytes\n"
        "  hint: move the file, or name it from a folder near it"
    )
