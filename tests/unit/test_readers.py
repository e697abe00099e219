"""Reading back what numpy and the formats' libraries wrote: every dtype, both byte orders, geometry, crops, NaN."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from dicom_files import image_fields, save
from hypothesis import given, strategies as st
from this_process import read_here
from volume_files import ramp, read, refused, write_image, write_volume

from renderer.errors import InputError
from renderer.readers import Image, crop_image, read_volume
from renderer.scene import ProceduralSource, RawSource, VolumeSpec
from renderer.volume import Volume, make_volume

NO_SPACING = "the file does not give its voxel size; 1 x 1 x 1 is assumed"

INTEGERS = ("int8", "uint8", "int16", "uint16", "int32", "uint32", "int64", "uint64")
FLOATS = ("float16", "float32", "float64")


def rotation() -> np.ndarray:
    """Return a rotation about no coordinate axis."""
    (cx, sx), (cz, sz) = ((np.cos(a), np.sin(a)) for a in (0.3, 0.7))
    return np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]]) @ np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])


def assert_usable(volume: Volume) -> None:
    """Check what the rest of the program relies on."""
    assert volume.values.flags.c_contiguous
    assert not volume.values.flags.writeable
    assert volume.values.dtype.isnative
    assert not isinstance(volume.values, np.memmap)
    assert volume.world_from_index.dtype == np.float64
    assert not volume.world_from_index.flags.writeable


@pytest.mark.parametrize(
    ("suffix", "dtype"),
    [
        (suffix, dtype)
        for suffix in (".npy", ".tif", ".nrrd", ".mha", ".nii")
        for dtype in INTEGERS + FLOATS
        if dtype != "float16" or suffix in (".npy", ".tif")
    ],
)
def test_every_format_keeps_every_dtype(tmp_path, suffix, dtype, monkeypatch):
    """Files in either byte order have the same voxels, which another process or this one has read."""
    for order in "<>":
        write_volume(tmp_path / f"a{suffix}", ramp(dtype), order)
        volume = read(tmp_path / f"a{suffix}")
        monkeypatch.setattr("renderer.readers.volume_reading.read_isolated", read_here)
        assert_usable(volume)
        assert volume.values.dtype == np.dtype(dtype)
        np.testing.assert_array_equal(volume.values, ramp(dtype))
        np.testing.assert_array_equal(np.abs(volume.world_from_index), np.eye(4))


@pytest.mark.parametrize("suffix", [".nrrd", ".mha", ".nii"])
def test_the_first_of_several_times_is_the_default(tmp_path, suffix):
    """Only where there are several; a spacing in place of an unknown one removes the note about that one."""
    values = ramp("int16", (2, 3, 4, 5))
    write_image(tmp_path / f"a{suffix}", values, spacing=(1.0, 2.0, 3.0))
    first, second = read(tmp_path / f"a{suffix}"), read(tmp_path / f"a{suffix}", time=1)
    np.testing.assert_array_equal(first.values, values[0])
    np.testing.assert_array_equal(second.values, values[1])
    np.testing.assert_allclose(second.spacing, [1.0, 2.0, 3.0])
    assert first.note == "2 times; the first is drawn; `time: k` chooses another"
    assert second.note is None
    write_image(tmp_path / f"b{suffix}", values[0])
    assert read(tmp_path / f"b{suffix}", time=0).note is None
    error = refused(tmp_path / f"b{suffix}", time=1, match="there is no such time step")
    assert error.expected == "0 or no `time` at all: the volume has one"


def test_unknown_axes_are_no_times_and_a_given_spacing_leaves_the_note_about_them(tmp_path):
    header = b"NRRD0004\ntype: uint8\ndimension: 4\nsizes: 2 3 4 5\nencoding: raw\n"
    (tmp_path / "a.nrrd").write_bytes(header + b"\n" + bytes(range(120)))
    error = refused(tmp_path / "a.nrrd", match="does not say which of its four axes is time")
    assert error.expected == "`time: k` with k from 0 to 4 if the last one is time"
    assert read(tmp_path / "a.nrrd", time=4).shape_xyz == (2, 3, 4)
    (tmp_path / "a.nrrd").write_bytes(header + b"kinds: list domain domain domain\n\n" + bytes(range(120)))
    assert read(tmp_path / "a.nrrd", component=1).shape_xyz == (3, 4, 5)
    (tmp_path / "a.nrrd").write_bytes(header + b"kinds: domain domain domain time\n\n" + bytes(range(120)))
    about_times = "5 times; the first is drawn; `time: k` chooses another"
    assert read(tmp_path / "a.nrrd").note == f"{NO_SPACING}; {about_times}"
    assert read(tmp_path / "a.nrrd", (1.0, 1.0, 2.0)).note == about_times


@pytest.mark.parametrize("dtype", INTEGERS + FLOATS)
@pytest.mark.parametrize("byte_order", ["little", "big"])
def test_raw_keeps_every_dtype(tmp_path, dtype, byte_order):
    values = ramp(dtype)
    stored = values.astype(values.dtype.newbyteorder("<" if byte_order == "little" else ">"))
    (tmp_path / "a.raw").write_bytes(b"12345" + stored.tobytes())
    source = RawSource(tmp_path / "a.raw", (5, 4, 3), dtype, byte_order, (0.5, 2.0, 3.0), offset=5)
    volume = read_volume(VolumeSpec(source))
    assert_usable(volume)
    np.testing.assert_array_equal(volume.values, values)
    np.testing.assert_array_equal(volume.world_from_index, np.diag([0.5, 2.0, 3.0, 1.0]))


@pytest.mark.parametrize(
    ("name", "compressed"), [("a.nrrd", False), ("a.nhdr", True), ("a.mha", True), ("a.mhd", False)]
)
def test_headers_of_text_keep_geometry(tmp_path, name, compressed):
    values, spacing, origin = ramp("int16"), np.array([0.5, 2.0, 3.0]), (-10.0, 20.0, 30.0)
    write_image(tmp_path / name, values, spacing=spacing, origin=origin, direction=rotation(), compressed=compressed)
    volume = read(tmp_path / name)
    assert_usable(volume)
    np.testing.assert_array_equal(volume.values, values)
    for index in ((0, 0, 0), (4, 0, 0), (0, 3, 2), (4, 3, 2)):
        here = volume.world_from_index @ [*index, 1]
        # Headers are text of about 15 digits; coordinates are some tens.
        np.testing.assert_allclose(here[:3], origin + rotation() @ (spacing * index), atol=1e-12)


@pytest.mark.parametrize(
    ("space", "axes", "expected"),
    [
        ("right-anterior-superior", "(2,0,0) (0,3,0) (0,0,4)", [[-2, 0, 0, -10], [0, -3, 0, -20], [0, 0, 4, 30]]),
        ("left-posterior-superior", "(2,0,0) (0,3,0) (0,1,4)", [[2, 0, 0, 10], [0, 3, 1, 20], [0, 0, 4, 30]]),
    ],
    ids=["RAS", "sheared"],
)
def test_nrrd_spaces_become_lps(tmp_path, space, axes, expected):
    header = (
        f"NRRD0004\ntype: uint8\ndimension: 3\nspace: {space}\nsizes: 5 4 3\n"
        f"space directions: {axes}\nspace origin: (10,20,30)\nencoding: raw\n\n"
    )
    (tmp_path / "a.nrrd").write_bytes(header.encode() + bytes(60))
    np.testing.assert_allclose(read(tmp_path / "a.nrrd").world_from_index[:3], expected, atol=1e-14)


@pytest.mark.parametrize("suffix", [".nrrd", ".mha"])
def test_the_first_of_several_components_is_the_default(tmp_path, suffix):
    values = ramp("uint8", (3, 4, 5, 3))
    write_image(tmp_path / f"a{suffix}", values, has_components=True)
    volume = read(tmp_path / f"a{suffix}")
    np.testing.assert_array_equal(volume.values, values[..., 0])
    hint = "; `component: color` draws the colours"
    assert volume.note == f"3 components; the first is drawn; `component: k` chooses another{hint}"
    for k in range(3):
        volume = read(tmp_path / f"a{suffix}", component=k)
        assert_usable(volume)
        np.testing.assert_array_equal(volume.values, values[..., k])
        assert volume.note is None


def test_axes_of_nrrd_with_a_direction_are_in_space(tmp_path):
    header = "NRRD0005\ntype: uint8\ndimension: 3\nspace: left-posterior-superior\nsizes: 2 2 2\nencoding: raw\n"
    header += "space directions: (1,0,0) (0,1,0) (0,0,1)\nkinds: domain domain domaif\n\n"
    (tmp_path / "a.nrrd").write_bytes(header.encode() + bytes(8))
    with pytest.raises(InputError, match="has a direction in space"):
        read(tmp_path / "a.nrrd")


def test_names_and_thicknesses_of_the_axes_of_nrrd_are_no_news(tmp_path):
    header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 3 4\nspacings: 1 1 2\nencoding: raw\n"
    stated = 'thicknesses: nan nan 4\nlabels: "left" "back" "up"\n'
    (tmp_path / "a.nrrd").write_bytes((header + stated + "\n").encode() + bytes(range(24)))
    assert read(tmp_path / "a.nrrd").note is None


def test_kinds_of_nrrd_name_colours(tmp_path):
    header = "NRRD0004\ntype: uint8\ndimension: 4\nsizes: 3 2 2 2\nspacings: nan 1 1 1\nencoding: raw\nkinds: {} "
    for kind, named in (("HSV-color", " (H, S, V)"), ("3-color", ""), ("RGBA-color", ""), ("vector", "")):
        text = header.format(kind) + "domain domain domain\n\n"
        (tmp_path / "a.nrrd").write_bytes(text.encode() + bytes(range(24)))
        volume = read(tmp_path / "a.nrrd")
        np.testing.assert_array_equal(volume.values.ravel(), np.arange(0, 24, 3))
        hint = "" if named else "; `component: color` draws the colours"
        assert volume.note == f"3 components{named}; the first is drawn; `component: k` chooses another{hint}"


def test_npy_axes(tmp_path):
    values = ramp("int32", (2, 3, 4, 5, 6))
    np.save(tmp_path / "5.npy", values)
    np.save(tmp_path / "4.npy", np.asfortranarray(values[0]))
    np.save(tmp_path / "2.npy", values[0, 0, 0])
    np.testing.assert_array_equal(read(tmp_path / "5.npy", time=1, component=2).values, values[1, ..., 2])
    np.testing.assert_array_equal(read(tmp_path / "4.npy", time=1).values, values[0, 1])
    np.testing.assert_array_equal(read(tmp_path / "4.npy", component=1).values, values[0, ..., 1])
    np.testing.assert_array_equal(read(tmp_path / "2.npy", time=0, component=0).values, values[0, 0, :1])


def test_a_short_first_axis_of_npy_holds_components(tmp_path):
    """With a last axis that is longer than components are, as of two channels of a microscope."""
    values = ramp("uint16", (2, 3, 4, 9))
    np.save(tmp_path / "a.npy", values)
    np.testing.assert_array_equal(read(tmp_path / "a.npy", component=1).values, values[1])
    np.testing.assert_array_equal(read(tmp_path / "a.npy", time=1).values, values[1])
    error = refused(tmp_path / "a.npy", match="four axes")
    assert "`component: k` with k from 0 to 1 if it holds components" in str(error.expected)
    assert error.hint is not None and error.hint.startswith("`component: all`")


def test_plane_is_one_slice(tmp_path):
    write_image(tmp_path / "a.mha", ramp("uint8")[0], spacing=(0.5, 2.0, 1.0), origin=(7.0, 8.0, 0.0))
    volume = read(tmp_path / "a.mha")
    assert volume.shape_xyz == (5, 4, 1)
    np.testing.assert_array_equal(volume.world_from_index, [[0.5, 0, 0, 7], [0, 2, 0, 8], [0, 0, 1, 0], [0, 0, 0, 1]])


def test_voxels_in_shared_memory_outlive_their_reader(tmp_path):
    values = np.random.default_rng(0).integers(0, 256, (64, 64, 64), np.uint8)
    write_image(tmp_path / "a.tif", values)
    volume = read(tmp_path / "a.tif")
    others = [read(tmp_path / "a.tif") for _ in range(3)]
    del others
    np.testing.assert_array_equal(volume.values, values)


def test_fingerprint_is_of_the_content_not_of_the_file(tmp_path):
    values = ramp("uint16")
    np.save(tmp_path / "a.npy", values.astype(">u2"))
    write_image(tmp_path / "a.nrrd", values, compressed=True)
    same = {read(tmp_path / name).fingerprint for name in ("a.npy", "a.nrrd")}
    negative_zeros = np.copysign(np.eye(4), np.eye(4) - 0.5)
    same |= {make_volume(values.copy(), affine, "here").fingerprint for affine in (np.eye(4), negative_zeros)}
    changed = values.copy()
    changed[1, 2, 3] += 1
    moved = np.eye(4)
    moved[0, 3] = 1e-9
    others = {
        make_volume(changed, np.eye(4), "").fingerprint,
        make_volume(values.copy(), moved, "").fingerprint,
        make_volume(values.astype(np.int16), np.eye(4), "").fingerprint,
        make_volume(values.reshape(4, 3, 5).copy(), np.eye(4), "").fingerprint,
    }
    assert len(same) == 1 and len(same | others) == 5


ranges = st.tuples(st.integers(0, 8), st.integers(1, 9)).map(lambda pair: (min(pair), max(pair[1], min(pair) + 1)))


@given(ranges, ranges, ranges, st.lists(st.floats(-100, 100), min_size=12, max_size=12))
def test_crop_leaves_voxels_where_they_are(x, y, z, numbers):
    values = np.arange(9**3).reshape(9, 9, 9)
    world_from_index = np.vstack([np.reshape(numbers, (3, 4)), [0, 0, 0, 1]])
    cropped = crop_image(Image(values, world_from_index), (x, y, z))
    assert cropped.values.shape == (z[1] - z[0], y[1] - y[0], x[1] - x[0])
    for corner in np.ndindex(2, 2, 2):
        index = [c * (n - 1) for c, n in zip(corner, cropped.values.shape[::-1], strict=True)]
        whole = [i + begin for i, (begin, _) in zip(index, (x, y, z), strict=True)]
        assert cropped.values[tuple(index[::-1])] == values[tuple(whole[::-1])]
        # Sums of four products of up to 900 in another order: some units in the last place of 3600.
        np.testing.assert_allclose(
            cropped.world_from_index @ [*index, 1], world_from_index @ [*whole, 1], rtol=0, atol=1e-11
        )


def oblique_file(path: Path) -> None:
    direction = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, -1.0]])
    write_image(path, ramp("uint16"), spacing=(0.8, 1.5, 2.5), origin=(-12.0, 5.0, 40.0), direction=direction)


@pytest.mark.parametrize("name", ["a.nrrd", "a.mha", "a.nii"])
def test_another_spacing_leaves_directions_and_the_first_voxel(tmp_path, name):
    oblique_file(tmp_path / name)
    file = tmp_path / name
    own = read(file)
    other = read(file, (3.0, 0.25, 7.0))
    np.testing.assert_allclose(other.spacing, [3.0, 0.25, 7.0], rtol=1e-15)
    np.testing.assert_allclose(
        other.world_from_index[:3, :3] / other.spacing, own.world_from_index[:3, :3] / own.spacing, atol=1e-15
    )
    np.testing.assert_array_equal(other.world_from_index[:3, 3], own.world_from_index[:3, 3])
    np.testing.assert_array_equal(other.values, own.values)
    assert own.file_spacing is None
    np.testing.assert_allclose(other.file_spacing, [0.8, 1.5, 2.5], rtol=1e-6)
    assert other.fingerprint != own.fingerprint


def test_another_spacing_moves_what_a_crop_leaves(tmp_path):
    oblique_file(tmp_path / "a.mha")
    whole = read(tmp_path / "a.mha", (3.0, 0.25, 7.0))
    cropped = read(tmp_path / "a.mha", (3.0, 0.25, 7.0), crop=((1, 5), (2, 4), (1, 3)))
    np.testing.assert_allclose(cropped.world_from_index @ [0, 0, 0, 1], whole.world_from_index @ [1, 2, 1, 1])


@pytest.mark.parametrize("spacing", [(1.0, 1.0, 1.0), (0.1, 0.1, 0.5), (1e-30, 3e-30, 1e-29), (1e30, 3e29, 1e29)])
def test_a_spacing_beside_a_file_is_that_of_a_raw_volume(tmp_path, spacing):
    """A spacing for a file gives the fingerprint of a raw volume with that spacing."""
    np.save(tmp_path / "a.npy", ramp("uint16"))
    ramp("uint16").tofile(tmp_path / "a.raw")
    x, y, z = ramp("uint16").shape[::-1]
    beside = read(tmp_path / "a.npy", spacing)
    raw = read_volume(VolumeSpec(RawSource(tmp_path / "a.raw", (x, y, z), "uint16", spacing=spacing)))
    assert beside.fingerprint == raw.fingerprint


@pytest.mark.parametrize("length", [1e-40, 1e40])
def test_another_spacing_in_place_of_lengths_that_cannot_be(tmp_path, length):
    head = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nspace dimension: 3\nencoding: raw\n"
    axes = f"space directions: ({length},0,0) (0,{length},0) (0,0,{2 * length})\n\n"
    (tmp_path / "a.nrrd").write_bytes((head + axes).encode() + bytes(8))
    refused(tmp_path / "a.nrrd", match="the spacing or the origin is out of range")
    volume = read(tmp_path / "a.nrrd", (1.0, 2.0, 3.0))
    np.testing.assert_array_equal(volume.spacing, [1, 2, 3])
    np.testing.assert_allclose(volume.file_spacing, [length, length, 2 * length])


@pytest.mark.parametrize("crop", [((0, 5), (0, 4), (1, 2)), ((1, 3), (0, 4), (0, 3)), ((0, 5), (0, 4), (0, 3))])
@pytest.mark.parametrize("name", ["a.npy", "a.nrrd", "a.mha"])
def test_cropped_volume_owns_just_its_voxels(tmp_path, crop, name):
    values = ramp("uint16")
    write_image(tmp_path / name, values)
    volume = read(tmp_path / name, crop=crop)
    assert_usable(volume)
    (x0, x1), (y0, y1), (z0, z1) = crop
    np.testing.assert_array_equal(volume.values, values[z0:z1, y0:y1, x0:x1])
    np.testing.assert_array_equal(volume.world_from_index[:3, 3], [x0, y0, z0])
    base = volume.values.base
    assert base is None or getattr(base, "nbytes", volume.values.nbytes) == volume.values.nbytes


@pytest.mark.parametrize("crop", [((0, 6), (0, 4), (0, 3)), ((2, 2), (0, 4), (0, 3)), ((-1, 5), (0, 4), (0, 3))])
def test_crop_outside_is_refused(tmp_path, crop):
    np.save(tmp_path / "a.npy", ramp("uint8"))
    refused(tmp_path / "a.npy", crop=crop, match="the crop does not fit the volume along x")


@pytest.mark.parametrize(("dtype", "bad"), [("float16", np.nan), ("float32", np.inf), ("float64", -np.inf)])
def test_nonfinite_voxels_have_no_data(tmp_path, dtype, bad):
    values = ramp(dtype) - 7
    np.save(tmp_path / "a.npy", values)
    assert read(tmp_path / "a.npy").num_absent == 0
    values[1, 2, 3], values[2, 0, 0] = np.nan, bad
    np.save(tmp_path / "a.npy", values)
    error = refused(
        tmp_path / "a.npy", nodata="none", crop=((1, 5), (1, 4), (1, 2)), match="voxels are NaN or infinite"
    )
    assert error.got == "the first at voxel x, y, z = 3, 2, 1"  # of the whole volume, not of the crop
    volume = read(tmp_path / "a.npy")
    np.testing.assert_array_equal(volume.values, np.where(np.isfinite(values), values, np.nan))
    assert volume.num_absent == 2
    assert not volume.values.flags.writeable


def test_procedural_volumes_are_cropped_and_have_one_time_step():
    spec = VolumeSpec(ProceduralSource("single_voxel", (6, 6, 6)), time=0, crop=((3, 4), (3, 4), (3, 4)))
    volume = read_volume(spec)
    assert volume.values.tolist() == [[[255]]]
    np.testing.assert_array_equal(volume.world_from_index[:3, 3], [3, 3, 3])
    with pytest.raises(InputError, match="there is no such time step"):
        read_volume(dataclasses.replace(spec, time=1))


@pytest.mark.parametrize("name", ["a.nrrd", "a.mha", "a.nii", "a.tif", "a.npz", "a.dcm"])
def test_voxels_that_do_not_fit_into_memory_are_refused(tmp_path, monkeypatch, one_process, name):
    values, path = ramp("int16"), tmp_path / name
    if name == "a.npz":
        np.savez_compressed(path, values)
    elif name == "a.dcm":
        save(path, image_fields(values, PixelSpacing=["1", "1"], SpacingBetweenSlices="1"))
    else:
        write_image(path, values)
    monkeypatch.setattr("renderer.readers.voxel_limits.free_bytes", lambda: 100)
    monkeypatch.setattr("renderer.readers.voxel_limits.free_swap_bytes", lambda: values.nbytes - 101)
    assert refused(path, match="the voxels of this file do not fit into memory").where == str(path)
    monkeypatch.setattr("renderer.readers.voxel_limits.free_swap_bytes", lambda: values.nbytes - 100)
    assert read(path).values.size == values.size
