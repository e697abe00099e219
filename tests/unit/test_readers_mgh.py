"""FreeSurfer volumes that nibabel wrote: types, places, frames, and headers that are damaged."""

from __future__ import annotations

import gzip
import struct
from pathlib import Path

import numpy as np
import pytest
from volume_files import NIBABEL, ramp, read, refused, written

from renderer.readers import find_volume

# Turned and anisotropic, in RAS, as conformed volumes have it.
AFFINE = np.array([[-2.0, 0, 0, 7], [0, 0, 3, -5], [0, -1.5, 0, 11], [0, 0, 0, 1]])
LPS = np.diag([-1.0, -1.0, 1.0, 1.0])


@pytest.mark.parametrize("dtype", ["uint8", "int32", "float32", "int16", "uint16"])
@pytest.mark.parametrize("name", ["a.mgh", "a.mgz", "a.MGZ"])
def test_types_and_places(tmp_path: Path, dtype: str, name: str) -> None:
    NIBABEL.MGHImage(ramp(dtype), AFFINE).to_filename(tmp_path / name)
    volume = read(tmp_path / name)
    np.testing.assert_array_equal(volume.values, ramp(dtype).T)
    assert volume.values.dtype == dtype
    np.testing.assert_allclose(volume.world_from_index, LPS @ AFFINE, atol=1e-6)
    stored = NIBABEL.load(tmp_path / name).affine
    np.testing.assert_allclose(volume.world_from_index, LPS @ stored, atol=1e-12)
    assert volume.note is None


def test_an_oblique_place_is_that_of_nibabel(tmp_path: Path) -> None:
    directions, _ = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))
    oblique = np.eye(4)
    oblique[:3, :3], oblique[:3, 3] = directions * [0.5, 2, 3], [100, -20, 3]
    NIBABEL.MGHImage(ramp("int16", (7, 4, 5)), oblique).to_filename(tmp_path / "a.mgz")
    np.testing.assert_allclose(read(tmp_path / "a.mgz").world_from_index, LPS @ oblique, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("name", ["a.mgh", "a.mgz"])
def test_frames_are_times(tmp_path: Path, name: str) -> None:
    values = ramp("int16", (5, 4, 3, 2))
    NIBABEL.MGHImage(values, AFFINE).to_filename(tmp_path / name)
    for time in range(2):
        np.testing.assert_array_equal(read(tmp_path / name, time=time).values, values[..., time].T)
    refused(tmp_path / name, match="there is no such time step", time=2)


def _changed(folder: Path, place: int, form: str, *numbers: float) -> Path:
    """Write a volume whose header has other numbers from byte `place` on."""
    NIBABEL.MGHImage(ramp("int16"), AFFINE).to_filename(folder / "a.mgh")
    data = bytearray((folder / "a.mgh").read_bytes())
    struct.pack_into(form, data, place, *numbers)
    return written(folder / "a.mgh", data)


def test_a_volume_without_a_place_is_coronal(tmp_path: Path) -> None:
    """As FreeSurfer has it: x to the left, y down, z to the front; nibabel turns y and z around."""
    volume = read(_changed(tmp_path, 28, ">h", 0))  # 3 x 4 x 5 voxels
    expected = [[1, 0, 0, -1.5], [0, 0, -1, 2.5], [0, -1, 0, 2], [0, 0, 0, 1]]
    np.testing.assert_array_equal(volume.world_from_index, expected)
    assert volume.note is not None and "does not give its place" in volume.note


@pytest.mark.parametrize(
    ("place", "form", "number", "match"),
    [
        (0, ">i", 2, "not an MGH file"), (4, ">i", 0, "no voxels"), (4, ">i", -3, "no voxels"),
        (4, ">i", 2**31 - 1, "shorter"), (16, ">i", 0, "no voxels"), (20, ">i", 6, "this type of MGH"),
        (30, ">f", 0, "no volume"), (42, ">f", float("nan"), "no volume"), (78, ">f", float("inf"), "no volume"),
    ],
)  # fmt: skip
def test_damaged_headers_are_refused(tmp_path: Path, place: int, form: str, number: float, match: str) -> None:
    refused(_changed(tmp_path, place, form, number), match)


@pytest.mark.parametrize("num_bytes", [1, 50, 89, 284, 400])
def test_truncated_files_are_refused(tmp_path: Path, num_bytes: int) -> None:
    NIBABEL.MGHImage(ramp("int16", (5, 6, 7)), AFFINE).to_filename(tmp_path / "a.mgh")
    data = (tmp_path / "a.mgh").read_bytes()[:num_bytes]
    refused(written(tmp_path / "a.mgh", data))
    refused(written(tmp_path / "b.mgz", gzip.compress(data)))
    refused(written(tmp_path / "b.mgz", gzip.compress((tmp_path / "a.mgh").read_bytes())[:-12]))


def test_what_follows_the_voxels_is_ignored(tmp_path: Path) -> None:
    NIBABEL.MGHImage(ramp("int16"), AFFINE).to_filename(tmp_path / "a.mgh")
    data = (tmp_path / "a.mgh").read_bytes() + bytes(5000)
    for name, content in (("a.mgh", data), ("a.mgz", gzip.compress(data)), ("a.mgh.gz", gzip.compress(data))):
        np.testing.assert_array_equal(read(written(tmp_path / name, content)).values, ramp("int16").T)


def test_a_folder_is_searched_for_it(tmp_path: Path) -> None:
    NIBABEL.MGHImage(ramp("int16"), AFFINE).to_filename(tmp_path / "a.mgz")
    assert find_volume(tmp_path)[:2] == (tmp_path / "a.mgz", "mgh")
