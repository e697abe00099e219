"""NIfTI that nibabel wrote: affines of every kind, scaling, time and components, pairs."""

from __future__ import annotations

import gzip
import struct

import nibabel as nib
import numpy as np
import pytest
from volume_files import ramp, read, refused, written

# Sheared, anisotropic and moved, in RAS.
AFFINE = np.array([[2.0, 0.5, 0.0, -7.0], [0.0, 1.5, 0.25, 5.0], [0.0, 0.0, 3.0, 11.0], [0.0, 0.0, 0.0, 1.0]])
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz", "a.hdr", "a.hdr.gz"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_byte_orders_and_sheared_affine(tmp_path, name, order):
    values = ramp("int16")
    kind = nib.Nifti1Pair if ".hdr" in name else nib.Nifti1Image
    kind(values, AFFINE, kind.header_class(endianness=order), dtype="int16").to_filename(tmp_path / name)
    volume = read(tmp_path / name)
    np.testing.assert_array_equal(volume.values, values.T)
    np.testing.assert_array_equal(volume.world_from_index, LPS @ AFFINE)  # exact in the header's float32


def test_qform_is_used_without_sform(tmp_path):
    image = nib.Nifti1Image(ramp("uint8"), np.eye(4))
    turned = np.array([[0.0, -2.0, 0.0, 1.0], [2.0, 0.0, 0.0, 2.0], [0.0, 0.0, 3.0, 3.0], [0.0, 0.0, 0.0, 1.0]])
    image.set_sform(None, 0)
    image.set_qform(turned, 1)
    image.to_filename(tmp_path / "a.nii")
    # The header holds the rotation as a float32 quaternion.
    np.testing.assert_allclose(read(tmp_path / "a.nii").world_from_index, LPS @ turned, atol=1e-6)


@pytest.mark.parametrize("kind", [nib.Nifti1Image, nib.Nifti2Image])
def test_sizes_alone_mirror_nothing(tmp_path, kind):
    """Method 1 of the standard, where both codes are 0: x, y and z are the indices by their sizes."""
    image = kind(ramp("uint8"), None)
    image.header.set_zooms((2.0, 3.0, 4.0))
    image.set_sform(None, 0)
    image.set_qform(None, 0)
    image.to_filename(tmp_path / "a.nii")
    np.testing.assert_array_equal(read(tmp_path / "a.nii").world_from_index, LPS @ np.diag([2.0, 3.0, 4.0, 1.0]))


@pytest.mark.parametrize(
    ("kind", "place", "code", "least"), [(nib.Nifti1Image, 108, "f", 352), (nib.Nifti2Image, 168, "q", 544)]
)
@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_voxels_within_the_header(tmp_path, kind, place, code, least, name, order):
    path = tmp_path / name
    image = kind(ramp("int16"), AFFINE, kind.header_class(endianness=order), dtype="int16")
    data = bytearray(image.to_bytes())
    for offset in (0, 100, least - 4, -8, *([float("nan"), float("inf")] if code == "f" else [])):
        struct.pack_into(order + code, data, place, offset)
        path.write_bytes(gzip.compress(data) if name == "a.nii.gz" else data)
        error = refused(path)
        assert str(error) == (
            f"{path}: the voxels of this NIfTI file cannot be where its header says\n"
            f"  got: vox_offset = {offset:g}\n"
            f"  expected: {least} or more, behind the header\n"
            "  hint: save it again, or correct the header"
        )
    struct.pack_into(order + code, data, place, least + 16)
    longer = data[:least] + bytes(16) + data[least:]
    path.write_bytes(gzip.compress(longer) if name == "a.nii.gz" else longer)
    np.testing.assert_array_equal(read(path).values, ramp("int16").T)


def test_extensions_are_skipped_whatever_they_are(tmp_path):
    """Programs leave bytes there that only look like one."""
    data = bytearray(nib.Nifti1Image(ramp("int16"), AFFINE, dtype="int16").to_bytes())
    struct.pack_into("<f", data, 108, 352 + 32)
    for extension in (struct.pack("<ii24x", 16, 6), struct.pack("<ii24x", -5, 6), struct.pack("<ii24x", 1 << 30, 6)):
        (tmp_path / "a.nii").write_bytes(data[:348] + b"\1\0\0\0" + extension + data[352:])
        np.testing.assert_array_equal(read(tmp_path / "a.nii").values, ramp("int16").T)


def test_singular_sform_gives_way_to_the_qform(tmp_path):
    image = nib.Nifti1Image(ramp("uint8"), np.eye(4))
    image.set_qform(np.diag([2.0, 3.0, 4.0, 1.0]), 1)
    image.header.set_sform(np.diag([0.0, 0.0, 0.0, 1.0]), 1)
    nib.Nifti1Image(ramp("uint8"), None, image.header).to_filename(tmp_path / "a.nii")
    np.testing.assert_allclose(read(tmp_path / "a.nii").spacing, [2.0, 3.0, 4.0], atol=1e-6)


@pytest.mark.parametrize(("dtype", "expected"), [("int16", "float32"), ("int32", "float64")])
def test_slope_and_intercept_are_applied(tmp_path, dtype, expected):
    values = ramp(dtype)
    image = nib.Nifti1Image(values, AFFINE)
    image.header.set_slope_inter(0.5, -10.0)
    image.to_filename(tmp_path / "a.nii")
    volume = read(tmp_path / "a.nii")
    assert volume.values.dtype == np.dtype(expected)
    np.testing.assert_array_equal(volume.values, 0.5 * values.T - 10.0)


@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz"])
def test_time_and_component(tmp_path, name):
    values = ramp("int16", (5, 4, 3, 2, 3))
    nib.Nifti1Image(values, AFFINE).to_filename(tmp_path / name)
    for time in range(2):
        for component in range(3):
            volume = read(tmp_path / name, time=time, component=component)
            np.testing.assert_array_equal(volume.values, values[:, :, :, time, component].T)


def test_colours_are_components(tmp_path):
    values = np.zeros((3, 4, 5), [("R", "u1"), ("G", "u1"), ("B", "u1")])
    values["G"] = ramp("uint8")
    nib.Nifti1Image(values, AFFINE).to_filename(tmp_path / "a.nii")
    second = read(tmp_path / "a.nii", component=1)
    np.testing.assert_array_equal(second.values, ramp("uint8").T)
    assert second.note is None
    first = read(tmp_path / "a.nii")
    assert not first.values.any()
    hint = "; `component: color` draws the colours"
    assert first.note == f"3 components (R, G, B); the first is drawn; `component: k` chooses another{hint}"
    error = refused(tmp_path / "a.nii", component=3, match="there is no such component")
    assert error.expected == "0 to 2"


def test_the_first_component_of_a_probabilistic_atlas_is_its_label(tmp_path):
    values = np.zeros((3, 4, 5), [(name, "u1") for name in "RGBA"])
    values["R"] = ramp("uint8")
    image = nib.Nifti1Image(values, AFFINE)
    image.header.set_intent("label")
    image.to_filename(tmp_path / "a.nii")
    volume = read(tmp_path / "a.nii")
    np.testing.assert_array_equal(volume.values, ramp("uint8").T)
    assert volume.note is not None and volume.note.startswith("4 components (label, second label, probability, ")


def test_plane_and_line_become_volumes(tmp_path):
    nib.Nifti1Image(ramp("uint8", (5, 4)), AFFINE).to_filename(tmp_path / "a.nii")
    assert read(tmp_path / "a.nii").shape_xyz == (5, 4, 1)
    nib.Nifti1Image(ramp("uint8", (5,)), AFFINE).to_filename(tmp_path / "a.nii")
    assert read(tmp_path / "a.nii").shape_xyz == (5, 1, 1)


def test_repairs_of_a_header_are_not_printed(tmp_path, capfd):
    nib.Nifti1Image(ramp("uint8"), AFFINE).to_filename(tmp_path / "a.nii")
    data = bytearray((tmp_path / "a.nii").read_bytes())
    data[76:80] = np.float32(5).tobytes()  # pixdim[0], which may only be 1 or -1
    np.testing.assert_array_equal(read(written(tmp_path / "a.nii", data)).values, ramp("uint8").T)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("kind", "place", "code"), [("Nifti1Image", 112, "<f4"), ("Nifti2Image", 176, "<f8")])
def test_infinite_slopes_are_refused(tmp_path, kind, place, code):
    """nibabel takes them for none."""
    getattr(nib, kind)(np.ones((3, 4, 5), np.uint8), np.eye(4)).to_filename(tmp_path / "a.nii")
    data = bytearray((tmp_path / "a.nii").read_bytes())
    for slope in (np.inf, -np.inf):
        data[place : place + int(code[2])] = np.array(slope, code).tobytes()
        refused(written(tmp_path / "a.nii", data), match="scales its values by a number that is not finite")
    data[place : place + int(code[2])] = np.array(np.nan, code).tobytes()
    assert read(written(tmp_path / "a.nii", data)).values.dtype == np.uint8


@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz"])
def test_what_follows_the_voxels_is_ignored(tmp_path, name):
    """The standard allows it; a stream that goes on without end is refused."""
    values = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)
    nib.Nifti1Image(values.T, np.eye(4)).to_filename(tmp_path / "whole.nii")
    pack = gzip.compress if name.endswith(".gz") else bytes
    (tmp_path / name).write_bytes(pack((tmp_path / "whole.nii").read_bytes() + b"made by a program" * 10))
    np.testing.assert_array_equal(read(tmp_path / name).values, values)
    if name.endswith(".gz"):
        (tmp_path / name).write_bytes(pack((tmp_path / "whole.nii").read_bytes() + bytes(1 << 26)))
        refused(tmp_path / name, match="the file is longer than its header says")


@pytest.mark.parametrize("end", [1, 100, 347, 352, 353])
def test_gzip_members_may_end_anywhere(tmp_path, end):
    values = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)
    nib.Nifti1Image(values.T, np.eye(4)).to_filename(tmp_path / "whole.nii")
    data = (tmp_path / "whole.nii").read_bytes()
    (tmp_path / "a.nii.gz").write_bytes(gzip.compress(data[:end]) + gzip.compress(data[end:]))
    np.testing.assert_array_equal(read(tmp_path / "a.nii.gz").values, values)


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("dtype", ["uint8", "int16", "int32", "float32", "float64"])
@pytest.mark.parametrize("name", ["a.hdr", "a.img", "a.hdr.gz"])
def test_analyze(tmp_path, order, dtype, name):
    """Types, byte orders, and x to the left around the middle; a pair has two names."""
    values = ramp(dtype)
    image = nib.AnalyzeImage(values, None, nib.AnalyzeHeader(endianness=order), dtype=dtype)
    image.header.set_zooms((2.0, 3.0, 4.0))
    image.to_filename(tmp_path / name)
    volume = read(tmp_path / name)
    np.testing.assert_array_equal(volume.values, values.T)
    assert volume.values.dtype == dtype
    np.testing.assert_array_equal(volume.world_from_index, LPS @ nib.load(tmp_path / name).affine)
    np.testing.assert_array_equal(volume.world_from_index[:3, 0], [2.0, 0.0, 0.0])  # x of LPS is to the left
    assert "x runs from right to left" in volume.note


@pytest.mark.parametrize("order", ["<", ">"])
def test_analyze_by_spm_has_a_scale_and_an_origin(tmp_path, order):
    header = nib.Spm99AnalyzeHeader(endianness=order)
    image = nib.Spm99AnalyzeImage(ramp("int16"), None, header, dtype="int16")
    image.header.set_zooms((2.0, 3.0, 4.0))
    image.to_filename(tmp_path / "a.img")
    (tmp_path / "a.mat").unlink(missing_ok=True)
    data = bytearray((tmp_path / "a.hdr").read_bytes())
    struct.pack_into(order + "f", data, 112, 0.5)  # funused1
    struct.pack_into(order + "5h", data, 253, 3, 2, 5, 0, 0)  # of voxels, from 1
    volume = read(written(tmp_path / "a.hdr", data))
    np.testing.assert_array_equal(volume.values, ramp("int16").T * np.float32(0.5))
    np.testing.assert_array_equal(volume.world_from_index @ [2, 1, 4, 1], [0, 0, 0, 1])


def test_a_folder_with_a_pair_is_a_volume(tmp_path):
    nib.AnalyzeImage(ramp("uint8"), None, dtype="uint8").to_filename(tmp_path / "a.img")
    (tmp_path / "b.hdr").write_bytes(b"ENVI\ndescription = another format\n")
    np.testing.assert_array_equal(read(tmp_path).values, ramp("uint8").T)


def test_a_damaged_mark_is_not_analyze(tmp_path):
    nib.Nifti1Pair(ramp("uint8"), AFFINE).to_filename(tmp_path / "a.img")
    data = bytearray((tmp_path / "a.hdr").read_bytes())
    data[346:347] = b"x"
    refused(written(tmp_path / "a.hdr", data), match="this is not a NIfTI file, or it is damaged")


@pytest.mark.parametrize("kind", [nib.AnalyzeImage, nib.Nifti1Pair])
@pytest.mark.parametrize("num_axes", [-3, 0, 8, 32767])
def test_an_impossible_number_of_axes_is_refused(tmp_path, kind, num_axes):
    kind(ramp("uint8"), None, dtype="uint8").to_filename(tmp_path / "a.img")
    data = bytearray((tmp_path / "a.hdr").read_bytes())
    struct.pack_into("<h", data, 40, num_axes)
    refused(written(tmp_path / "a.hdr", data), match="this is not a NIfTI file, or it is damaged")


@pytest.mark.parametrize("code", [0, 1, 32, 99])
def test_other_types_of_analyze_are_refused(tmp_path, code):
    nib.AnalyzeImage(ramp("uint8"), None, dtype="uint8").to_filename(tmp_path / "a.img")
    data = bytearray((tmp_path / "a.hdr").read_bytes())
    struct.pack_into("<h", data, 70, code)
    refused(written(tmp_path / "a.hdr", data))


def test_sizes_of_0_are_1_with_a_note(tmp_path):
    image = nib.Nifti1Image(ramp("int16", (1, 4, 5)).T, np.diag([2.0, 2, 3, 1]))
    image.set_sform(None, 0)
    image.to_filename(tmp_path / "a.nii")
    data = bytearray((tmp_path / "a.nii").read_bytes())
    data[46:48], data[84:88] = bytes(2), bytes(4)  # dim[3], pixdim[2]
    volume = read(written(tmp_path / "a.nii", bytes(data)))
    np.testing.assert_array_equal(volume.values, ramp("int16", (1, 4, 5)))
    np.testing.assert_allclose(volume.spacing, [2, 1, 3])
    assert volume.note == (
        "the file has a number of voxels of 0 along z; 1 is assumed; "
        "the file has a voxel size of 0 along y; 1 is assumed"
    )


def test_a_compressed_header_of_a_pair_has_its_checksum(tmp_path):
    header, data = tmp_path / "a.hdr.gz", tmp_path / "a.img.gz"
    pair = nib.Nifti1Pair(ramp("int16").transpose(2, 1, 0), np.eye(4))
    pair.to_filename(str(tmp_path / "a.img.gz"))
    assert data.exists() and read(header).shape_xyz == (5, 4, 3)
    content = header.read_bytes()
    header.write_bytes(content[:-8] + bytes(4) + content[-4:])
    refused(header, match="damaged")
    header.write_bytes(content[:-4])
    refused(header, match="the compressed header is damaged")


@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz"])
def test_how_a_scan_was_made_and_is_shown_elsewhere_is_no_news(tmp_path, name):
    image = nib.Nifti1Image(ramp("int16"), AFFINE)
    image.header["cal_min"], image.header["cal_max"] = 2, 9
    image.header["slice_code"], image.header["slice_duration"] = 3, 0.1
    image.to_filename(tmp_path / name)
    assert read(tmp_path / name).note is None


def test_bytes_behind_the_voxels_are_counted_and_taken_for_no_header(tmp_path):
    nib.Nifti1Image(ramp("int16"), AFFINE).to_filename(tmp_path / "a.nii")
    with (tmp_path / "a.nii").open("ab") as file:
        file.write(bytes(352))
    assert read(tmp_path / "a.nii").note == "the data have 352 bytes more than their voxels"
