"""Archives of arrays, cube files and segmentations, compressed DICOM; volumes found in folders or by content."""

from __future__ import annotations

import gzip
import os
import shutil

import gdcm
import nrrd
import numpy as np
import pytest
from dicom_files import NORMAL, image_fields, save, transcode, write_series, write_slice
from volume_files import ramp, read, refused, write_image, written

VALUES = ramp("int16")


# Arrays


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_archives_of_one_array(tmp_path, save):
    save(tmp_path / "a.npz", np.asfortranarray(VALUES))
    np.testing.assert_array_equal(read(tmp_path / "a.npz").values, VALUES)
    save(tmp_path / "a.npz", np.stack([VALUES, VALUES + 1]))
    np.testing.assert_array_equal(read(tmp_path / "a.npz", time=1).values, VALUES + 1)


def test_archives_of_several_arrays_need_a_component(tmp_path):
    np.savez(tmp_path / "a.npz", density=VALUES, energy=VALUES + 1)
    np.testing.assert_array_equal(read(tmp_path / "a.npz", component=1).values, VALUES + 1)
    assert str(refused(tmp_path / "a.npz")) == (
        f"{tmp_path / 'a.npz'}: this archive holds 2 arrays, and one is rendered\n"
        "  got: 0 is density, 1 is energy\n"
        "  expected: `component: k` with k from 0 to 1"
    )


def test_masks_are_0_and_1(tmp_path):
    np.save(tmp_path / "a.npy", VALUES % 2 == 0)
    np.testing.assert_array_equal(read(tmp_path / "a.npy").values, (VALUES % 2 == 0).astype(np.uint8))


# Cube files


def cube(values: np.ndarray, orbitals: str = "", num_atoms: int = 1) -> str:
    nx, ny, nz = values.shape[:3]
    text = f"water\ndensity\n {num_atoms} -1.0 2.0 0.5\n {nx} 0.5 0 0\n {ny} 0.1 0.25 0\n {nz} 0 0 2\n 8 8.0 0 0 0\n"
    rows = values.reshape(nx * ny, -1)
    return text + orbitals + "".join(" ".join(f"{value:.5E}" for value in row) + "\n" for row in rows)


@pytest.mark.parametrize("exponent", ["E", "D", "d"])
def test_cube_files(tmp_path, exponent):
    """Fortran may write D for exponents."""
    values = np.arange(60).reshape(3, 4, 5) / 8
    (tmp_path / "a.cube").write_text(cube(values).replace("E", exponent))
    volume = read(tmp_path / "a.cube")
    np.testing.assert_array_equal(volume.values, values.T.astype(np.float32))
    np.testing.assert_array_equal(volume.world_from_index[:3], [[0.5, 0.1, 0, -1], [0, 0.25, 0, 2], [0, 0, 2, 0.5]])


def test_orbitals_are_components(tmp_path):
    values = np.arange(120).reshape(3, 4, 5, 2) / 8
    (tmp_path / "a.cube").write_text(cube(values, " 2 20 21\n", num_atoms=-1))
    np.testing.assert_array_equal(read(tmp_path / "a.cube", component=1).values, values[..., 1].T)
    first = read(tmp_path / "a.cube")
    np.testing.assert_array_equal(first.values, values[..., 0].T)
    assert first.note == "2 components (orbital 20, orbital 21); the first is drawn; `component: k` chooses another"


@pytest.mark.filterwarnings("error")
def test_numbers_beyond_float32_are_infinite(tmp_path):
    (tmp_path / "a.cube").write_text(cube(np.full((3, 4, 5), 1e300)))
    refused(tmp_path / "a.cube", match="no voxel has data")


@pytest.mark.parametrize("num_lines", [1, 4, 6, 7, 12])
def test_truncated_cube_files_are_refused(tmp_path, num_lines):
    lines = cube(np.zeros((3, 4, 5))).splitlines(keepends=True)
    (tmp_path / "a.cube").write_text("".join(lines[:num_lines]))
    refused(tmp_path / "a.cube")


# Headers of text


@pytest.mark.parametrize("encoding", ["raw", "gzip", "bzip2", "ascii"])
def test_encodings_of_nrrd(tmp_path, encoding):
    nrrd.write(str(tmp_path / "a.nrrd"), VALUES, {"encoding": encoding}, index_order="C")
    np.testing.assert_array_equal(read(tmp_path / "a.nrrd").values, VALUES)


@pytest.mark.parametrize(
    ("magic", "lines"),
    [
        ("NRRD00.01", "dimension: 3\nsizes: 5 4 3\n"),
        ("NRRD0005", "dimension: 4\nsizes: 1 5 4 3\nspace: LPS\nspace directions: None (1,0,0) (0,1,0) (0,0,1)\n"),
        ("NRRD0004", "dimension: 5\nsizes: 1 1 5 4 3\nkinds: stub vector domain domain domain\n"),
        ("NRRD0004", "dimension: 6\nsizes: 1 1 5 4 1 3\nkinds: vector list space space time space\n"),
    ],
)
def test_headers_of_nrrd_that_are_rare(tmp_path, magic, lines):
    (tmp_path / "a.nrrd").write_bytes(f"{magic}\ntype: int16\nencoding: raw\n{lines}\n".encode() + VALUES.tobytes())
    np.testing.assert_array_equal(read(tmp_path / "a.nrrd").values, VALUES)


@pytest.mark.parametrize("layer_axis", ["none", "list"])
def test_segmentations_of_slicer(tmp_path, layer_axis):
    """Layers are components; older files have no kind for their axis."""
    layers = np.stack([VALUES, VALUES + 1], axis=-1).astype(np.uint16)
    kinds = f"kinds: {layer_axis if layer_axis == 'list' else '???'} domain domain domain\n"
    header = (
        f"NRRD0004\ntype: unsigned short\ndimension: 4\nspace: left-posterior-superior\nsizes: 2 5 4 3\n{kinds}"
        "space directions: none (1,0,0) (0,2,0) (0,0,3)\nspace origin: (1,2,3)\nendian: little\nencoding: gzip\n"
        "Segment0_ID:=Segment_1\nSegment0_LabelValue:=1\n\n"
    )
    volume = read(written(tmp_path / "a.seg.nrrd", header.encode() + gzip.compress(layers.tobytes())), component=1)
    np.testing.assert_array_equal(volume.values, VALUES.astype(np.uint16) + 1)
    np.testing.assert_array_equal(volume.spacing, [1, 2, 3])


@pytest.mark.parametrize(
    ("lines", "spacing", "origin"),
    [
        ("spacings: 1 2 3\naxis mins: 10 20 30\n", [1, 2, 3], [10.5, 21, 31.5]),
        ("spacings: 1 2 3\naxis mins: 10 20 30\ncenters: node node node\n", [1, 2, 3], [10, 20, 30]),
        ("axis mins: 0 0 0\naxis maxs: 5 8 9\n", [1, 2, 3], [0.5, 1, 1.5]),
        ("axis mins: 0 0 0\naxis maxs: 4 6 6\ncenterings: node node node\n", [1, 2, 3], [0, 0, 0]),
    ],
)
def test_places_of_nrrd_without_a_space(tmp_path, lines, spacing, origin):
    header = f"NRRD0004\ntype: short\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n{lines}\n"
    volume = read(written(tmp_path / "a.nrrd", header.encode() + VALUES.tobytes()))
    np.testing.assert_array_equal(volume.spacing, spacing)
    np.testing.assert_array_equal(volume.world_from_index[:3, 3], origin)


@pytest.mark.parametrize(
    ("line", "where"),
    [("sizes: 5 4 3", 8), ("spacinks: 1 2 3", 8), ("no field at all", 8), ("spacings: 1 2", 8), ("space: XYZ", 8)],
)
def test_lines_of_nrrd_that_cannot_be_read_are_located(tmp_path, line, where):
    header = "NRRD0004\n# made by hand\ntype: short\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n"
    error = refused(written(tmp_path / "a.nrrd", f"{header}{line}\n\n".encode() + VALUES.tobytes()))
    assert error.where == f"{tmp_path / 'a.nrrd'}:{where}"


def test_voxels_without_an_empty_line_before_them_are_refused(tmp_path):
    header = b"NRRD0004\ntype: short\ndimension: 3\nsizes: 5 4 3\nendian: little\nencoding: raw\n"
    refused(written(tmp_path / "a.nrrd", header + VALUES.tobytes()), match="this line of a NRRD header cannot be read")


# Folders and content


@pytest.mark.usefixtures("one_process")
def test_slices_beside_volumes_are_read_and_the_others_named(tmp_path):
    write_series(tmp_path, [k * NORMAL for k in range(3)])
    assert read(tmp_path).note is None
    write_image(tmp_path / "b.nrrd", VALUES)
    write_image(tmp_path / "a.mha", VALUES)
    volume = read(tmp_path)
    assert len(volume.values) == 3
    assert volume.note == "its DICOM slices are one volume, which is read; left out: a.mha, b.nrrd"


@pytest.mark.usefixtures("one_process")
def test_the_only_volume_in_a_folder(tmp_path):
    (tmp_path / "study" / "scan").mkdir(parents=True)
    (tmp_path / "study" / "notes.txt").write_text("no volume")
    os.mkfifo(tmp_path / "study" / "pipe.nrrd")
    write_image(tmp_path / "study" / "scan" / "a.nrrd", VALUES)
    volume = read(tmp_path)
    np.testing.assert_array_equal(volume.values, VALUES)
    assert volume.note == "the only volume in this folder, study/scan/a.nrrd, is read"
    (tmp_path / "series").mkdir()
    write_series(tmp_path / "series", [k * NORMAL for k in range(3)])
    error = refused(tmp_path)
    assert str(error) == (
        f"{tmp_path}: this folder holds 2 volumes, and one is rendered\n"
        "  got: series, study/scan/a.nrrd\n"
        f"  hint: name one of them: {tmp_path / 'series'}; `hsplat turntable {tmp_path}` draws each of them"
    )
    shutil.rmtree(tmp_path / "study")
    write_slice(tmp_path / "DICOMDIR", np.zeros((4, 5)), 0 * NORMAL)  # an index of a medium is DICOM, too
    assert read(tmp_path).shape_xyz == (5, 6, 3)
    assert read(tmp_path).note == "the only volume in this folder, series, is read"


def test_a_search_that_does_not_see_all_finds_nothing(tmp_path, monkeypatch):
    """Another volume may be among the rest."""
    monkeypatch.setattr("renderer.readers.sniff._MAX_ENTRIES", 3)
    for name in "abc":
        (tmp_path / name).mkdir()
    np.save(tmp_path / "a" / "a.npy", VALUES)
    refused(tmp_path, match="too many files to be searched")


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("name", ["a.nrrd", "a.npy", "a.tif"])
def test_formats_are_known_by_their_content(tmp_path, name):
    write_image(tmp_path / name, VALUES)
    (tmp_path / name).rename(tmp_path / "scan.nii")
    np.testing.assert_array_equal(read(tmp_path / "scan.nii").values, VALUES)


@pytest.mark.usefixtures("one_process")
def test_dicom_may_have_any_name(tmp_path):
    write_series(tmp_path, [0 * NORMAL])
    (tmp_path / "99.dcm").rename(tmp_path / "image.img")
    assert read(tmp_path / "image.img").shape_xyz == (5, 6, 1)


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("syntax", ["JPEGLosslessProcess14_1", "JPEGLSLossless", "JPEG2000Lossless"])
def test_compressed_pixels_of_dicom(tmp_path, syntax):
    values = np.arange(60 * 50, dtype=np.uint16).reshape(60, 50)
    save(tmp_path / "plain.dcm", image_fields(values))
    transcode(tmp_path / "plain.dcm", tmp_path / "a.dcm", getattr(gdcm.TransferSyntax, syntax))
    np.testing.assert_array_equal(read(tmp_path / "a.dcm").values[0], values)
    (tmp_path / "a.dcm").write_bytes((tmp_path / "a.dcm").read_bytes()[:-200])
    refused(tmp_path / "a.dcm", match="this DICOM slice cannot be read")


# More bytes than voxels


@pytest.mark.parametrize("num", [0, 1, 13, 352])
@pytest.mark.parametrize("encoding", ["raw", "gzip"])
def test_bytes_beside_the_voxels_are_counted(tmp_path, encoding, num):
    values = ramp("int16", (4, 20, 30))
    data = bytes(num) + values.tobytes()
    written(tmp_path / "a.dat", gzip.compress(data) if encoding == "gzip" else data)
    lines = "NRRD0004\ntype: short\ndimension: 3\nsizes: 30 20 4\nspacings: 1 1 1\nendian: little\n"
    lines += f"encoding: {encoding}\n"
    header = written(tmp_path / "a.nhdr", f"{lines}data file: a.dat\n".encode())
    note = read(header).note
    if num == 0:
        assert note is None
        return
    assert note.startswith(f"the data have {num} byte{'s' * (num > 1)} more than their voxels")
    hint = {"raw": "byte skip: -1", "gzip": "byte skip: 352"}[encoding]
    assert (f"`{hint}`" in note) == (num == 352)
    if num == 352:  # what the hint says is right
        read_again = read(written(tmp_path / "a.nhdr", f"{lines}{hint}\ndata file: a.dat\n".encode()))
        np.testing.assert_array_equal(read_again.values, values)
        assert read_again.note is None


def test_a_header_of_nifti_with_extensions_is_recognised(tmp_path):
    values = ramp("int16", (20, 20, 30))
    start = (348).to_bytes(4, "little") + bytes(396)
    written(tmp_path / "a.raw", start + values.tobytes())
    lines = "NDims = 3\nDimSize = 30 20 20\nElementSpacing = 1 1 1\nElementType = MET_SHORT\n"
    header = written(tmp_path / "a.mhd", f"{lines}ElementDataFile = a.raw\n".encode())
    assert "400 bytes more than their voxels, which begin like NIfTI: if" in read(header).note
    written(header, f"{lines}HeaderSize = -1\nElementDataFile = a.raw\n".encode())
    np.testing.assert_array_equal(read(header).values, values)
