"""The whole texts of what a user reads when a volume cannot be read."""

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
from renderer.scene import FileSource, RawSource, VolumeSpec
from tests.support.tiff_files import COMPRESSION, SHORT, tiff

KNOWN = "NRRD (.nrrd, .nhdr), MetaImage (.mha, .mhd), NIfTI (.nii, .nii.gz), TIFF (.tif), NumPy (.npy) or DICOM"
NUMERIC = "int8 to int64, uint8 to uint64, float16, float32 or float64"
VALUES = np.arange(60, dtype=np.uint16).reshape(3, 4, 5)


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """The working directory, so that messages hold names without a path."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def message(name: str, **choice) -> str:
    with pytest.raises(InputError) as error:
        read_volume(VolumeSpec(FileSource(Path(name)), **choice))
    return str(error.value)


def raw_message(**declared) -> str:
    source = RawSource(Path("a.raw"), **{"shape": (5, 4, 3), "dtype": "uint16", **declared})
    with pytest.raises(InputError) as error:
        read_volume(VolumeSpec(source))
    return str(error.value)


def save(values: np.ndarray) -> None:
    np.save("a.npy", values)


def test_missing_file(folder):
    save(VALUES)
    assert message("b.npy") == "b.npy: no such file or folder\n  hint: did you mean a.npy?"
    assert message("nowhere/scan.nrrd") == "nowhere/scan.nrrd: no such file or folder"


def test_neither_file_nor_folder(folder):
    os.mkfifo("a.npy")
    assert message("a.npy") == "a.npy: this is neither a file nor a folder"


def test_no_permission(folder, monkeypatch):
    save(VALUES)
    monkeypatch.setattr("os.access", lambda *_: False)  # root may read everything
    assert message("a.npy") == "a.npy: no permission to read this"


def test_error_of_the_system(folder, monkeypatch):
    save(VALUES)

    def fail(*_args):
        raise OSError(5, "Input/output error")

    monkeypatch.setattr("numpy.memmap", fail)
    assert message("a.npy") == "a.npy: cannot read this file\n  got: Input/output error"


def test_unknown_format(folder):
    Path("a.vol").write_bytes(b"hello")
    hint = "  hint: voxels without a header are read with `raw: {file, shape, dtype, spacing}`"
    what = "this is not a volume in a known format, or it is damaged"
    assert message("a.vol") == f"a.vol: {what}\n  expected: {KNOWN}\n{hint}"
    Path("a.nrrd").touch()
    assert message("a.nrrd") == f"a.nrrd: {what}\n  got: an empty file\n  expected: {KNOWN}\n{hint}"


def test_empty_files(folder):
    for name, what in {
        "a.nii": "this is not a NIfTI file, or it is damaged\n  got: an empty file\n"
        "  expected: a header of NIfTI-1 or NIfTI-2, whose type of voxels and axes are known",
        "a.tif": "this is not a TIFF file\n  got: an empty file\n"
        "  expected: II or MM and 42 or 43, by which TIFF and BigTIFF begin",
        "a.npy": "this is not a .npy file\n  got: an empty file\n  expected: an array saved by numpy.save",
        "a.mha": "this is not a MetaImage header, or it is damaged\n  got: an empty file\n  expected: a line "
        "`NDims = ...` and a line `DimSize = ...` and a line `ElementType = ...` and a line `ElementDataFile = ...`",
    }.items():
        Path(name).touch()
        assert message(name) == f"{name}: {what}"


def test_empty_folder(folder):
    Path("scan").mkdir()
    assert message("scan") == (
        "scan: this folder holds neither a DICOM series nor TIFF slices\n"
        "  got: an empty folder\n"
        "  expected: the files of one DICOM series, or .tif files, directly in the folder"
    )


@pytest.mark.parametrize("name", ["a.nhdr", "a.mhd"])
def test_missing_data_file(folder, name):
    sitk.WriteImage(sitk.GetImageFromArray(VALUES), name)
    Path("a.raw").unlink()
    assert message(name) == (
        f"{name}: the data file that this header names is not there\n"
        "  got: a.raw\n"
        "  expected: a file a.raw\n"
        "  hint: the two belong together: move or copy both"
    )


def test_missing_half_of_a_nifti_pair(folder):
    nib.Nifti1Pair(VALUES, np.eye(4)).to_filename("a.hdr")
    Path("a.img").unlink()
    assert message("a.hdr") == (
        "a.hdr: the data file that belongs to this header is not there\n  expected: a file a.img"
    )


@pytest.mark.parametrize("name", ["a.nrrd", "a.mha", "a.nii"])
def test_truncated(folder, name):
    sitk.WriteImage(sitk.GetImageFromArray(VALUES), name)
    Path(name).write_bytes(Path(name).read_bytes()[:-7])
    assert message(name) == (
        f"{name}: the file is shorter than its header says\n"
        "  got: 113 bytes\n"
        "  expected: 120 bytes (5 x 4 x 3 voxels)\n"
        "  hint: the file is truncated or its header is wrong"
    )


def test_truncated_data_file(folder):
    sitk.WriteImage(sitk.GetImageFromArray(VALUES), "a.nhdr")
    Path("a.raw").write_bytes(bytes(3))
    assert message("a.nhdr") == (
        "a.raw: the file is shorter than its header says\n"
        "  got: 3 bytes\n"
        "  expected: 120 bytes (5 x 4 x 3 voxels)\n"
        "  hint: the file is truncated or its header is wrong"
    )


def test_damaged_compression(folder):
    header = b"NRRD0004\ntype: uint16\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: gzip\n\n"
    data = gzip.compress(VALUES.tobytes())
    Path("a.nrrd").write_bytes(header + data[:-4] + bytes(4))
    assert message("a.nrrd") == (
        "a.nrrd: the compressed voxels are damaged\n"
        "  got: Error -3 while decompressing data: incorrect length check\n"
        "  hint: copy or download the file again"
    )
    Path("a.nrrd").write_bytes(header + data[:-1])
    assert message("a.nrrd") == (
        "a.nrrd: the compressed voxels are damaged\n"
        "  got: the compressed data break off after 120 bytes of voxels\n"
        "  hint: copy or download the file again"
    )
    Path("a.nrrd").write_bytes(header + gzip.compress(bytes(100)))
    assert message("a.nrrd") == (
        "a.nrrd: the file is shorter than its header says\n"
        "  got: 100 bytes after decompression\n"
        "  expected: 120 bytes (5 x 4 x 3 voxels)\n"
        "  hint: the file is truncated or its header is wrong"
    )


def test_unreadable_header(folder):
    Path("a.nrrd").write_bytes(b"NRRD0004\ntype: half\ndimension: 3\nsizes: 5 4 3\nencoding: raw\n\n")
    assert message("a.nrrd") == (
        'a.nrrd: cannot read the header\n  got: couldn\'t parse type "half"\n'
        "  hint: the file is damaged, or of a kind that cannot be read"
    )


def test_bzip2(folder):
    Path("a.nrrd").write_bytes(b"NRRD0004\ntype: uint8\ndimension: 3\nsizes: 5 4 3\nencoding: bzip2\n\nBZh9")
    assert message("a.nrrd") == (
        "a.nrrd: voxels that are compressed by bzip2 cannot be read\n"
        "  got: encoding: bzip2\n"
        "  expected: encoding: raw or gzip\n"
        "  hint: save it again with gzip"
    )


def test_truncated_tiff(folder):
    sitk.WriteImage(sitk.GetImageFromArray(VALUES), "a.tif")
    Path("a.tif").write_bytes(Path("a.tif").read_bytes()[:400])
    assert message("a.tif") == (
        "a.tif: the file ends within its directory\n  got: 400 bytes, 1 complete pages\n  hint: the file is truncated"
    )


def test_tiff_slices_that_differ(folder):
    Path("stack").mkdir()
    for k, width in enumerate((5, 5, 6)):
        sitk.WriteImage(sitk.GetImageFromArray(np.zeros((4, width), np.uint8)), f"stack/{k}.tif")
    assert message("stack") == (
        "stack/2.tif: the slices of this folder differ\n  got: 6 x 4 uint8\n  expected: 5 x 4 uint8 as in 0.tif"
    )
    sitk.WriteImage(sitk.GetImageFromArray(np.zeros((2, 4, 5), np.uint8)), "stack/2.tif")
    assert message("stack") == (
        "stack/2.tif: a file among these slices has several pages\n"
        "  got: 2 pages\n"
        "  expected: a slice in each file, or one file with all slices"
    )


def test_tiff_pages_that_differ(folder):
    sitk.WriteImage(sitk.GetImageFromArray(np.zeros((2, 4, 5), np.uint8)), "a.tif")
    data = bytearray(Path("a.tif").read_bytes())
    tag = bytes([254, 0, 4, 0, 1, 0, 0, 0])  # what kind of page it is, a number
    place = data.index(tag, data.index(tag) + 1) + len(tag)
    data[place] = 1
    Path("a.tif").write_bytes(data)
    assert message("a.tif") == (
        "a.tif: the pages differ\n"
        "  got: 1 in TIFF field 254 on page 2\n"
        "  expected: 2 in TIFF field 254 as on page 1\n"
        "  hint: previews among the slices? save the slices alone"
    )


def test_too_large(folder):
    Path("a.nrrd").write_bytes(
        b"NRRD0004\ntype: uint16\ndimension: 3\nsizes: 100000 90000 80000\nendian: big\nencoding: raw\n\n"
    )
    assert message("a.nrrd") == (
        "a.nrrd: the volume is too large\n"
        "  got: 100000 x 90000 x 80000 voxels of uint16, 1341104.5 GiB\n"
        "  expected: at most 1024 GiB\n"
        "  hint: if the file is smaller than that, its header is wrong"
    )


def test_no_volume_in_the_affine(folder):
    image = nib.Nifti1Image(VALUES, np.eye(4))
    image.header.set_sform(np.diag([np.nan, 1, 1, 1]), 1)
    image.header["pixdim"][1:4] = np.nan
    nib.Nifti1Image(VALUES, None, image.header).to_filename("a.nii")
    assert message("a.nii").splitlines()[0] == "a.nii: the spacing, origin and direction give the voxels no volume"
    assert message("a.nii").splitlines()[2] == (
        "  expected: finite numbers, positive spacings and three independent axes"
    )


ROWS = "9 numbers, 3 linearly independent rows"
# A key of a MetaImage header, a value that it cannot have, and what is expected instead.
NOT_NUMBERS = {
    "no length": ("ElementSpacing", "0 1 1", "3 numbers, none of them 0"),
    "no number": ("ElementSpacing", "nan 1 1", "3 numbers, none of them 0"),
    "no lengths, by their other name": ("ElementSize", "1 1 -inf", "3 numbers, none of them 0"),
    "too few": ("DimSize", "5 4", "3 whole numbers"),
    "no counts": ("DimSize", "5 4 -3", "3 whole numbers"),
    "parts": ("DimSize", "5 4 2.5", "3 whole numbers"),
    "a number of axes": ("NDims", "three", "2, 3 or 4"),
    "an origin": ("Offset", "nan 0 0", "3 numbers"),
    "half an origin": ("Position", "0 0", "3 numbers"),
    "a flat matrix": ("TransformMatrix", "1 0 0 0 1 0 0 0 0", ROWS),
    "digits": ("TransformMatrix", f"{6 * '0.90630778703664994 '}0 0 0", ROWS),
    "a bell": ("Offset", r"'\x07 0 0'", "3 numbers"),
    "a matrix with an axis twice": ("TransformMatrix", "1 0 0 0 1 0 1 0 0", ROWS),
}


@pytest.mark.parametrize("case", NOT_NUMBERS)
def test_metaimage_lines_without_their_numbers(folder, case, capfd):
    key, value, expected = NOT_NUMBERS[case]
    image = sitk.GetImageFromArray(VALUES)
    sitk.WriteImage(image, "a.mhd")
    lines = [line for line in Path("a.mhd").read_text().splitlines() if line.split()[0] != key]
    if key in ("ElementSize", "Position"):
        lines = [line for line in lines if line.split()[0] not in ("ElementSpacing", "Offset")]
    written = "\a 0 0" if case == "a bell" else value
    Path("a.mhd").write_text("\n".join([*lines[:2], f"{key} = {written}", *lines[2:]]) + "\n")
    assert message("a.mhd") == (
        "a.mhd: a line of this MetaImage header does not have the numbers that belong there\n"
        f"  got: {key} = {value}\n"
        f"  expected: {key} = {expected}\n"
        "  hint: correct that line, or save the file again"
    )
    assert capfd.readouterr().err == ""  # of the library, which writes there by itself


def test_metaimage_numbers_on_several_lines(folder):
    sitk.WriteImage(sitk.GetImageFromArray(VALUES), "a.mhd")
    text = Path("a.mhd").read_text().replace("TransformMatrix = 1 0 0 0 1 0 ", "TransformMatrix = 1 0 0\n0 1 0\n")
    assert "0 1 0\n0 0 1" in text
    Path("a.mhd").write_text(text)
    np.testing.assert_array_equal(read_volume(VolumeSpec(FileSource(Path("a.mhd")))).values, VALUES)


def test_axes_that_other_headers_leave_flat(folder):
    head = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspace dimension: 3\nencoding: raw\n"
    Path("a.nrrd").write_bytes(f"{head}space directions: (1,0,0) (1,0,0) (0,0,1)\n\n".encode() + bytes(8))
    assert message("a.nrrd") == (
        "a.nrrd: the spacing, origin and direction give the voxels no volume\n"
        "  got: [1 1 0 0], [0 0 0 0], [0 0 1 0] (world from voxel index)\n"
        "  expected: finite numbers, positive spacings and three independent axes\n"
        "  hint: correct them in the file's header, or export it again from its source"
    )


@pytest.mark.parametrize(("number", "name"), [(50000, ", Zstandard"), (34925, ", LZMA"), (50001, ", WebP"), (4321, "")])
def test_tiff_compressions_that_are_not_there(folder, number, name):
    Path("a.tif").write_bytes(tiff({COMPRESSION: (SHORT, 1, number)}))
    first, got, *rest = message("a.tif").splitlines()
    assert first == "a.tif: this TIFF file's compression is not supported"
    assert got.startswith(f"  got: compression {number}{name}: ")
    assert rest == [
        "  expected: no compression, LZW, Deflate, PackBits or JPEG",
        "  hint: save it again without compression or with Deflate, or as NRRD or .npy",
    ]


def test_tiff_that_is_damaged_in_a_compression_that_is_there(folder):
    Path("a.tif").write_bytes(tiff({COMPRESSION: (SHORT, 1, 8)}))
    assert message("a.tif").splitlines()[0] == "a.tif: cannot read the voxels"
    assert message("a.tif").splitlines()[-1] == "  hint: the file is truncated or damaged"


def test_voxels_of_which_no_volume_is_a_number(folder):
    Path("a.raw").write_bytes(bytes(120))
    assert raw_message(spacing=(1e-200, 1e-200, 1e-200)) == (
        "a.raw: the spacing or the origin is out of range\n"
        "  got: [1e-200 0 0 0], [0 1e-200 0 0], [0 0 1e-200 0] (world from voxel index)\n"
        "  expected: lengths from 1e-30 to 1e+30\n"
        "  hint: give lengths in another unit"
    )


def test_integers_that_float64_cannot_tell_apart(folder):
    np.save("a.npy", 2**60 + VALUES.astype(np.int64))
    assert message("a.npy") == (
        "a.npy: these integers are too large for their differences to be drawn\n"
        "  got: values from 1152921504606846976 to 1152921504606847035, where numbers of float64 are 256 apart\n"
        "  expected: integers from -2^53 to 2^53, or a range of 16777216 or more\n"
        "  hint: subtract the smallest value before saving"
    )


def test_time_and_component(folder):
    sitk.WriteImage(sitk.GetImageFromArray(np.zeros((7, 3, 4, 5), np.uint8), isVector=False), "a.mha")
    assert message("a.mha") == (
        "a.mha: the volume has 7 time steps, and one is rendered\n  expected: `time: k` with k from 0 to 6"
    )
    assert message("a.mha", time=7) == "a.mha: there is no such time step\n  got: time: 7\n  expected: 0 to 6"
    assert message("a.mha", time=0, component=1) == (
        "a.mha: there is no such component\n"
        "  got: component: 1\n"
        "  expected: 0 or no `component` at all: the volume has one"
    )
    sitk.WriteImage(sitk.GetImageFromArray(np.zeros((3, 4, 5, 3), np.uint8), isVector=True), "a.mha")
    assert message("a.mha") == (
        "a.mha: the volume has 3 components, and one is rendered\n  expected: `component: k` with k from 0 to 2"
    )


def test_npy_axes(folder):
    save(np.zeros((2, 3, 4, 5)))
    assert message("a.npy") == (
        "a.npy: the array has four axes\n"
        "  got: 2 x 3 x 4 x 5\n"
        "  expected: `time: k` with k from 0 to 1 if the first axis is time, or "
        "`component: k` with k from 0 to 4 if the last axis holds components"
    )
    save(np.float32(1))
    expected = "[z, y, x], or [time, z, y, x] with `time`, or [z, y, x, component] with `component`"
    assert message("a.npy") == (
        f"a.npy: the array does not have the axes of a volume\n  got: 0 axes, a single number\n  expected: {expected}"
    )


@pytest.mark.parametrize(
    ("dtype", "got", "hint"),
    [
        (bool, "bool", "save it as uint8"),
        (complex, "complex128", "save its magnitude or its real part"),
        ([("a", "u1"), ("b", "f4")], "records with the fields a, b", "save one of its fields as a separate array"),
        (object, "object", "save it as an array of numbers; Python objects are never loaded"),
    ],
)
def test_npy_types(folder, dtype, got, hint):
    save(np.zeros((2, 2, 2), dtype))
    assert message("a.npy") == (
        f"a.npy: voxels of this type cannot be rendered\n  got: {got}\n  expected: {NUMERIC}\n  hint: {hint}"
    )


def test_npy_truncated(folder):
    save(VALUES)
    Path("a.npy").write_bytes(Path("a.npy").read_bytes()[:-1])
    assert message("a.npy") == (
        "a.npy: the file is shorter than its header says\n"
        "  got: 119 bytes of voxels\n"
        "  expected: 120 bytes (3 x 4 x 5 values of uint16)\n"
        "  hint: the file is truncated"
    )


def test_npy_without_voxels(folder):
    save(np.zeros((3, 0, 4)))
    assert message("a.npy") == "a.npy: the volume has no voxels\n  got: 4 x 0 x 3"


def test_raw_of_another_size(folder):
    Path("a.raw").write_bytes(bytes(160))
    what = "a.raw: the size of the file does not fit the declared shape and type"
    assert raw_message() == (
        f"{what}\n  got: 160 bytes\n  expected: 120 bytes (5 x 4 x 3 voxels of uint16)\n"
        "  hint: these would fit: shape [5, 4, 4]; offset 40, if a header comes before the voxels"
    )
    assert raw_message(offset=10) == (
        f"{what}\n  got: 150 bytes after the offset of 10\n"
        "  expected: 120 bytes (5 x 4 x 3 voxels of uint16) after the offset of 10\n"
        "  hint: these would fit: shape [5, 5, 3]; offset 40, if a header comes before the voxels"
    )
    assert raw_message(dtype="int32", shape=(5, 4, 2), offset=80) == (
        f"{what}\n  got: 80 bytes after the offset of 80\n"
        "  expected: 160 bytes (5 x 4 x 2 voxels of int32) after the offset of 80\n"
        "  hint: these would fit: shape [5, 2, 2]; shape [5, 4, 1]; a type of 16 bits"
    )
    assert raw_message(dtype="float64", shape=(7, 7, 7)) == (
        f"{what}\n  got: 160 bytes\n  expected: 2744 bytes (7 x 7 x 7 voxels of float64)"
    )
    assert raw_message(offset=200) == (
        f"{what}\n  got: 160 bytes in all\n  expected: 120 bytes (5 x 4 x 3 voxels of uint16) after the offset of 200"
    )


def test_raw_of_no_such_type(folder):
    Path("a.raw").write_bytes(bytes(120))
    assert raw_message(dtype="short16") == (
        "a.raw: no such data type\n  got: short16\n  expected: a numpy name such as uint8, int16 or float32"
    )


def test_crop_outside(folder):
    save(VALUES)
    assert message("a.npy", crop=((0, 5), (1, 9), (0, 3))) == (
        "a.npy: the crop does not fit the volume along y\n"
        "  got: [1, 9]\n"
        "  expected: [first, end] with 0 <= first < end <= 4"
    )


def test_nonfinite(folder):
    values = VALUES.astype(np.float32)
    values[1, 2, 3] = values[2, 0, 0] = np.nan
    save(values)
    assert message("a.npy") == (
        "a.npy: 2 of 60 voxels are NaN or infinite\n"
        "  got: the first at voxel x, y, z = 3, 2, 1\n"
        "  expected: finite values\n"
        "  hint: `nonfinite: lowest` replaces them with the lowest finite value"
    )
    save(np.full((2, 2, 2), np.inf))
    assert message("a.npy", nonfinite="lowest") == "a.npy: no voxel is finite: all are NaN or infinite"
    save(values.astype(np.float16))
    assert message("a.npy", nonfinite=-1e6) == (
        "a.npy: the value that replaces NaN and infinities is out of the range of the voxels\n"
        "  got: `nonfinite: -1e+06`\n"
        "  expected: a number from -65504 to 65504, for float16"
    )


def test_out_of_memory(folder, monkeypatch):
    save(VALUES)

    def fail(*_args):
        raise MemoryError

    monkeypatch.setattr("renderer.readers.read._load", fail)
    assert message("a.npy") == (
        "a.npy: there is not enough memory for this volume\n  hint: `crop` it, or render on a larger machine"
    )
