"""Truncated files of every format, and headers that claim too much, end in an InputError.

Altered files are those of tests/fuzz.
"""

from __future__ import annotations

import gzip
import os
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
from volume_files import read, refused, write_image, written

VALUES = np.random.default_rng(0).integers(0, 2000, (6, 7, 8)).astype(np.uint16)
FORMATS = ("raw.nrrd", "gzip.nrrd", "raw.nhdr", "gzip.nhdr", "raw.mha", "zlib.mha", "raw.mhd", "zlib.mhd")
OTHERS = ("raw.nii", "gzip.nii.gz", "raw.tif", "packed.tif", "plain.npy")


def write(folder: Path, name: str) -> tuple[Path, Path]:
    """Write a volume; return the file to read and the file that holds the voxels."""
    path = folder / name
    if ".nii" in name:
        nib.Nifti1Image(VALUES.T, np.eye(4)).to_filename(path)
    else:
        write_image(path, VALUES, compressed=not name.startswith("raw"))
    others = [entry for entry in folder.iterdir() if entry != path]
    return path, others[0] if others else path


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("name", FORMATS + OTHERS)
def test_every_truncation_is_an_error(tmp_path, capfd, name):
    """Warnings of the libraries stay off the terminal."""
    path, data_file = write(tmp_path, name)
    np.testing.assert_array_equal(read(path).values, VALUES)
    data = data_file.read_bytes()
    for kept in (0, 1, 3, 60, 130, len(data) // 2, len(data) - 30, len(data) - 1):
        data_file.write_bytes(data[:kept])
        if name == "raw.tif" and kept == len(data) - 1:  # part of a number that says that no page follows
            np.testing.assert_array_equal(read(path).values, VALUES)
            continue
        refused(path)
    assert capfd.readouterr() == ("", "")


def test_gzip_of_several_members_is_whole(tmp_path):
    data = VALUES.tobytes()
    header = b"NRRD0004\ntype: uint16\ndimension: 3\nsizes: 8 7 6\nendian: little\nencoding: gzip\n\n"
    (tmp_path / "a.nrrd").write_bytes(header + gzip.compress(data[:100]) + gzip.compress(data[100:]))
    np.testing.assert_array_equal(read(tmp_path / "a.nrrd").values, VALUES)


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
        assert read(written(tmp_path / name, header.encode() + voxels)).shape_xyz == (5, 4, 3)
        refused(written(tmp_path / name, header.encode() + voxels[:118]), match="shorter than its header says")


def test_pipes_in_a_folder_are_not_opened(tmp_path):
    """Opening one would wait until somebody writes."""
    (tmp_path / "in").mkdir()
    os.mkfifo(tmp_path / "in" / "a.nrrd")
    refused(tmp_path, match="this folder holds no volume")
    write(tmp_path / "in", "raw.mha")
    np.testing.assert_array_equal(read(tmp_path).values, VALUES)
