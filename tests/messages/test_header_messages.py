"""What a user reads about headers that are damaged or say no lengths, and that nothing of it is a library's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.readers.itk import shorten_itk_error
from renderer.scene import FileSource, VolumeSpec

VALUES = np.arange(60, dtype=np.uint16).reshape(3, 4, 5)

META = "NDims = 3\nDimSize = 5 4 3\nElementType = MET_USHORT\nElementDataFile = LOCAL\n"


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """The working directory, so that messages hold names without a path."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def message(name: str) -> str:
    with pytest.raises(InputError) as error:
        read_volume(VolumeSpec(FileSource(Path(name))))
    return str(error.value)


@pytest.mark.parametrize("damage", [slice(10, 40), slice(60, 70), slice(20, 21)])
def test_header_of_npy_that_is_damaged(folder, damage):
    np.save("a.npy", VALUES)
    data = bytearray(Path("a.npy").read_bytes())
    data[damage] = b"(" * len(data[damage])
    Path("a.npy").write_bytes(data)
    assert message("a.npy") == (
        "a.npy: cannot read the header\n"
        "  expected: an array saved by numpy.save\n"
        "  hint: the file is truncated or damaged"
    )


def test_no_words_of_a_program(folder):
    said = "itk ERROR: GDCMImageIO(0x1): GetVR().Compatible( de.GetVR() ) || de.GetVR() == VR::INVALID"
    assert [shorten_itk_error(text) for text in (said, "std::bad_alloc")] == [None, None]
    assert shorten_itk_error("a()\n[nrrd] nrrdLoad: couldn't parse type") == "couldn't parse type"


def test_memory_that_a_library_does_not_get(folder, monkeypatch):
    sitk.WriteImage(sitk.GetImageFromArray(VALUES), "a.mha", True)

    def fail(_reader):
        raise RuntimeError("Exception thrown in SimpleITK ImageFileReader_Execute:\nstd::bad_alloc")

    monkeypatch.setattr(sitk.ImageFileReader, "Execute", fail)
    assert message("a.mha") == (
        "a.mha: there is not enough memory for this volume\n  hint: `crop` it, or render on a larger machine"
    )


def test_libraries_are_silent(folder, capfd):
    Path("a.mha").write_bytes(f"BinaryData = False\n{META}".encode() + b"no digits " * 60)
    assert message("a.mha").splitlines()[0] == "a.mha: cannot read the voxels"
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("lines", ["", "space: LPS\nspace origin: (0,0,0)\n"])
def test_nrrd_without_lengths(folder, lines):
    header = f"NRRD0004\ntype: uint16\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n{lines}\n"
    Path("a.nrrd").write_bytes(header.encode() + VALUES.tobytes())
    volume = read_volume(VolumeSpec(FileSource(Path("a.nrrd"))))
    assert volume.spacing.tolist() == [1, 1, 1]
    assert volume.note == "the file does not give its voxel size; 1 x 1 x 1 is assumed"
    assert read_volume(VolumeSpec(FileSource(Path("a.nrrd"), (1.0, 1.0, 2.0)))).note is None


def test_metaimage_without_lengths(folder):
    for line in ("", "elementspacing = 1 2 3\n"):  # no key of its reader's
        Path("a.mha").write_bytes(META.replace("DimSize", f"{line}DimSize").encode() + VALUES.tobytes())
        volume = read_volume(VolumeSpec(FileSource(Path("a.mha"))))
        assert volume.spacing.tolist() == [1, 1, 1]
        assert volume.note == "the file does not give its voxel size; 1 x 1 x 1 is assumed"
    Path("a.mha").write_bytes(META.replace("DimSize", "ElementSize = 1 1 1\nDimSize").encode() + VALUES.tobytes())
    assert read_volume(VolumeSpec(FileSource(Path("a.mha")))).note is None


def test_nrrd_with_a_length_that_is_not_known(folder):
    header = "NRRD0004\ntype: uint16\ndimension: {}\nsizes: {}\nendian: little\nencoding: raw\n{}\n"
    Path("a.nrrd").write_bytes(header.format(3, "5 4 3", "spacings: NaN 1 2\n").encode() + VALUES.tobytes())
    assert message("a.nrrd") == (
        "a.nrrd: this NRRD header does not have the length of an axis\n"
        "  got: spacings: NaN 1 2\n"
        "  expected: a number for each axis of space\n"
        "  hint: correct that line; without it, voxels are 1 long"
    )
    others = "spacings: NaN 1 2 3\nkinds: vector domain domain domain\n"
    Path("a.nrrd").write_bytes(header.format(4, "1 5 4 3", others).encode() + VALUES.tobytes())
    volume = read_volume(VolumeSpec(FileSource(Path("a.nrrd"))))
    assert (volume.spacing.tolist(), volume.note) == ([1, 2, 3], None)
