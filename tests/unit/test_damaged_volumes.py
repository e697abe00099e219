"""Truncated and altered files of every format end in an InputError or in a volume, never in anything else."""

from __future__ import annotations

import gzip
import os
from collections.abc import Iterator
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest

from renderer.errors import HsplatError
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec
from tests.support.dicom_files import image_fields, save
from tests.support.tiff_files import described, field_places, ome
from tests.support.volume_files import refused, write_image, written

VALUES = np.random.default_rng(0).integers(0, 2000, (6, 7, 8)).astype(np.uint16)
FORMATS = ("raw.nrrd", "gzip.nrrd", "raw.nhdr", "gzip.nhdr", "raw.mha", "zlib.mha", "raw.mhd", "zlib.mhd")
OTHERS = ("raw.nii", "gzip.nii.gz", "raw.tif", "packed.tif", "plain.npy")
DIGITS = b"0123456789.e+-\\\n"  # and what else makes up numbers, and ends them


def write(folder: Path, name: str) -> tuple[Path, Path]:
    """Write a volume; return the file to read and the file that holds the voxels."""
    path = folder / name
    if ".nii" in name:
        nib.Nifti1Image(VALUES.T, np.eye(4)).to_filename(path)
    else:
        write_image(path, VALUES, compressed=not name.startswith("raw"))
    others = [entry for entry in folder.iterdir() if entry != path]
    return path, others[0] if others else path


def read(path: Path) -> np.ndarray:
    return read_volume(VolumeSpec(FileSource(path))).values


@pytest.mark.parametrize("name", FORMATS + OTHERS)
def test_every_truncation_is_an_error(tmp_path, name):
    path, data_file = write(tmp_path, name)
    np.testing.assert_array_equal(read(path), VALUES)
    data = data_file.read_bytes()
    for kept in (0, 1, 3, 60, 130, len(data) // 2, len(data) - 30, len(data) - 1):
        data_file.write_bytes(data[:kept])
        if name == "raw.tif" and kept == len(data) - 1:  # part of a number that says that no page follows
            np.testing.assert_array_equal(read(path), VALUES)
            continue
        refused(path)


@pytest.mark.parametrize("name", ["gzip.nrrd", "gzip.nhdr", "zlib.mha", "zlib.mhd", "gzip.nii.gz"])
def test_damage_within_compressed_voxels_is_an_error(tmp_path, name):
    """A checksum guards every bit, also where the stream still decompresses."""
    path, data_file = write(tmp_path, name)
    data = bytearray(data_file.read_bytes())
    for place in range(len(data) - 100, len(data), 9):
        damaged = data.copy()
        damaged[place] ^= 0x10
        data_file.write_bytes(damaged)
        refused(path)


def header_places(name: str, data: bytes) -> np.ndarray:
    """Return the places of the header in a file, which is decompressed if it is gzip."""
    if name.endswith(".tif"):
        return field_places(data)
    if name.endswith(".nrrd"):
        return np.arange(data.index(b"\n\n") + 2)
    if name.endswith(".mha"):
        return np.arange(data.index(b"\n", data.index(b"ElementDataFile")) + 1)
    return np.arange({".nii": 352, ".npy": 128}.get(name[-4:], len(data)))


def altered(data: bytes, places: np.ndarray, seed: int, num_altered: int) -> Iterator[bytes]:
    """Yield the data with one to three bytes at `places` changed: to any, by a bit, to an end, to a digit."""
    rng = np.random.default_rng(seed)
    for _ in range(num_altered):
        damaged = bytearray(data)
        for place in places[rng.integers(len(places), size=rng.integers(1, 4))]:
            to, bit, digit = rng.integers(256), rng.integers(8), rng.integers(len(DIGITS))
            damaged[place] = (to, damaged[place] ^ 1 << bit, 0, 255, DIGITS[digit], DIGITS[digit])[rng.integers(6)]
        yield bytes(damaged)


def read_or_refuse(path: Path, **choice: int) -> bool:
    """Return whether there is a volume; anything but a volume and an error for users fails."""
    try:
        return read_volume(VolumeSpec(FileSource(path), **choice)).values.ndim == 3
    except HsplatError:
        return False


def require_mixed_results(path: Path, damaged: Iterator[bytes]) -> None:
    """Read a file that holds one after the other; alterations that do nothing, or destroy all, would test nothing."""
    results = set()
    for data in damaged:
        path.write_bytes(data)
        results.add(read_or_refuse(path.parent if path.suffix == ".dcm" else path))
    assert results == {True, False}


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize(("seed", "name"), list(enumerate(FORMATS + OTHERS)))
def test_altered_headers_never_escape(tmp_path, seed, name):
    """Files of FORMATS are several of the same kind, and have their hundreds together."""
    path, _ = write(tmp_path, name)
    is_gzip = name.endswith(".gz")
    data = gzip.decompress(path.read_bytes()) if is_gzip else path.read_bytes()
    num_altered = 300 if name.endswith(".tif") else 60 if name in FORMATS else 150
    damaged = altered(data, header_places(name.removesuffix(".gz"), data), seed, num_altered)
    require_mixed_results(path, (gzip.compress(each, 1) if is_gzip else each for each in damaged))


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize(
    "data",
    [
        described("ImageJ=1.53\nimages=1\nchannels=1\nslices=1\nframes=1\nspacing=0.75\n"),
        ome('DimensionOrder="XYZCT" SizeZ="1" SizeC="1" SizeT="1" PhysicalSizeX="0.5" PhysicalSizeZ="1.5"'),
    ],
    ids=["ImageJ", "OME"],
)
def test_altered_descriptions_never_escape(tmp_path, data):
    require_mixed_results(tmp_path / "a.tif", altered(data, np.arange(24, data.index(b"\0", 24)), 0, 300))


@pytest.mark.usefixtures("one_process")
@pytest.mark.filterwarnings("ignore::UserWarning:pydicom")
def test_altered_dicom_never_escapes(tmp_path):
    save(tmp_path / "a.dcm", image_fields(VALUES[0]))
    data = (tmp_path / "a.dcm").read_bytes()
    places = np.arange(data.rindex(b"\xe0\x7f\x10\x00") + 8)
    require_mixed_results(tmp_path / "a.dcm", altered(data, places, 0, 300))


def test_gzip_of_several_members_is_whole(tmp_path):
    data = VALUES.tobytes()
    header = b"NRRD0004\ntype: uint16\ndimension: 3\nsizes: 8 7 6\nendian: little\nencoding: gzip\n\n"
    (tmp_path / "a.nrrd").write_bytes(header + gzip.compress(data[:100]) + gzip.compress(data[100:]))
    np.testing.assert_array_equal(read(tmp_path / "a.nrrd"), VALUES)


def test_headers_that_claim_too_much_take_no_memory(tmp_path):
    nrrd = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: {0} {0} {0}\nencoding: {1}\n\n"
    meta = "ObjectType = Image\nNDims = 3\nDimSize = {0} {0} {0}\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n"
    for name, header in (("a.nrrd", nrrd), ("a.mha", meta)):
        for size in (1_000_000, 10_000):
            for encoding in ("raw", "gzip", "raw\nline skip: 1"):
                data = gzip.compress(bytes(100)) if encoding == "gzip" else bytes(100)
                (tmp_path / name).write_bytes(header.format(size, encoding).encode() + data)
                refused(tmp_path / name, match=r"too large|shorter than its header says")
    header = nib.Nifti1Header()
    header.set_data_dtype(np.uint8)
    header["vox_offset"] = 352
    for size in (30_000, 8_000):
        header.set_data_shape((size, size, size))
        (tmp_path / "a.nii").write_bytes(header.binaryblock + bytes(100))
        (tmp_path / "a.nii.gz").write_bytes(gzip.compress(header.binaryblock + bytes(100)))
        for name in ("a.nii", "a.nii.gz"):
            refused(tmp_path / name, match=r"too large|shorter than its header says")


def test_headers_of_text_that_claim_too_much_take_no_memory(tmp_path):
    """A value takes a digit at least, and something between it and the next."""
    nrrd = "NRRD0004\ntype: uint16\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: {}\n\n"
    meta = "ObjectType = Image\nNDims = 3\nDimSize = 5 4 3\nElementType = MET_USHORT\nBinaryData = False\n"
    text = b"7 " * 60
    for name, header, voxels in (
        ("a.nrrd", nrrd.format("text"), text),
        ("a.nrrd", nrrd.format("hex"), b"0007" * 60),
        ("a.mha", meta + "ElementDataFile = LOCAL\n", text),
    ):
        assert read(written(tmp_path / name, header.encode() + voxels)).shape == (3, 4, 5)
        refused(written(tmp_path / name, header.encode() + voxels[:118]), match="shorter than its header says")


def test_extensions_that_inflate_take_no_memory(tmp_path):
    for header, place in ((nib.Nifti1Header(), 352), (nib.Nifti2Header(), 544)):
        header.set_data_dtype(np.uint8)
        header.set_data_shape((4, 4, 4))
        for num_bytes, is_fine in ((2**10, True), (2**26, False)):
            header["magic"], header["vox_offset"] = header.single_magic, place + num_bytes
            extension = b"\1\0\0\0" + np.array([num_bytes, 6], "<i4").tobytes() + bytes(num_bytes - 8)
            (tmp_path / "a.nii.gz").write_bytes(gzip.compress(header.binaryblock + extension + bytes(64), 1))
            if is_fine:
                assert read(tmp_path / "a.nii.gz").shape == (4, 4, 4)
                continue
            refused(tmp_path / "a.nii.gz", match="too much before the voxels")


def test_warnings_of_the_libraries_stay_off_the_terminal(tmp_path, capfd):
    for name in FORMATS + OTHERS:
        folder = tmp_path / name
        folder.mkdir()
        path, data_file = write(folder, name)
        read(path)
        data_file.write_bytes(data_file.read_bytes()[:-40])
        refused(path)
    assert capfd.readouterr() == ("", "")


def test_pipes_in_a_folder_are_not_opened(tmp_path):
    """Opening one would wait until somebody writes."""
    (tmp_path / "in").mkdir()
    os.mkfifo(tmp_path / "in" / "a.nrrd")
    refused(tmp_path, match="this folder holds no volume")
    write(tmp_path / "in", "raw.mha")
    np.testing.assert_array_equal(read(tmp_path), VALUES)
