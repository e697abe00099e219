"""Truncated and altered files of every format end in an InputError or in a volume, never in anything else."""

from __future__ import annotations

import gzip
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec

VALUES = np.random.default_rng(0).integers(0, 2000, (6, 7, 8)).astype(np.uint16)
FORMATS = ("raw.nrrd", "gzip.nrrd", "raw.nhdr", "gzip.nhdr", "raw.mha", "zlib.mha", "raw.mhd", "zlib.mhd")
OTHERS = ("raw.nii", "gzip.nii.gz", "raw.tif", "packed.tif", "plain.npy")


def write(folder: Path, name: str) -> tuple[Path, Path]:
    """The file to read and the file that holds the voxels."""
    path = folder / name
    if name.endswith(".npy"):
        np.save(path, VALUES)
    elif ".nii" in name:
        nib.Nifti1Image(VALUES.T, np.eye(4)).to_filename(path)
    else:
        sitk.WriteImage(sitk.GetImageFromArray(VALUES), str(path), not name.startswith("raw"))
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
        with pytest.raises(InputError):
            read(path)


@pytest.mark.parametrize("name", ["gzip.nrrd", "gzip.nhdr", "zlib.mha", "zlib.mhd", "gzip.nii.gz"])
def test_damage_within_compressed_voxels_is_an_error(tmp_path, name):
    """A checksum guards every bit, also where the stream still decompresses."""
    path, data_file = write(tmp_path, name)
    data = bytearray(data_file.read_bytes())
    for place in range(len(data) - 100, len(data), 9):
        damaged = data.copy()
        damaged[place] ^= 0x10
        data_file.write_bytes(damaged)
        with pytest.raises(InputError):
            read(path)


@pytest.mark.parametrize("name", FORMATS + OTHERS)
def test_altered_headers_never_escape(tmp_path, name):
    path, _ = write(tmp_path, name)
    data = path.read_bytes()
    rng = np.random.default_rng(1)
    for _ in range(40):
        altered = bytearray(data)
        for place in rng.integers(0, min(len(data), 400), 3):
            altered[place] = rng.integers(0, 256)
        path.write_bytes(altered)
        try:
            values = read(path)
        except InputError:
            continue
        assert values.ndim == 3


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
            for encoding in ("raw", "gzip"):
                data = gzip.compress(bytes(100)) if encoding == "gzip" else bytes(100)
                (tmp_path / name).write_bytes(header.format(size, encoding).encode() + data)
                with pytest.raises(InputError, match=r"too large|shorter than its header says"):
                    read(tmp_path / name)
    header = nib.Nifti1Header()
    header.set_data_dtype(np.uint8)
    for size in (30_000, 8_000):
        header.set_data_shape((size, size, size))
        (tmp_path / "a.nii").write_bytes(header.binaryblock + bytes(100))
        (tmp_path / "a.nii.gz").write_bytes(gzip.compress(header.binaryblock + bytes(100)))
        for name in ("a.nii", "a.nii.gz"):
            with pytest.raises(InputError, match=r"too large|shorter than its header says"):
                read(tmp_path / name)


def test_warnings_of_the_libraries_stay_off_the_terminal(tmp_path, capfd):
    for name in FORMATS + OTHERS:
        folder = tmp_path / name
        folder.mkdir()
        path, data_file = write(folder, name)
        read(path)
        data_file.write_bytes(data_file.read_bytes()[:-40])
        with pytest.raises(InputError):
            read(path)
    assert capfd.readouterr() == ("", "")
