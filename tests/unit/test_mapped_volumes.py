"""Volumes that stay in their files: the same voxels as in memory, and a clear error where the file does not stay."""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from brickwork import scalar_texels
from film_stages import PLAIN, SPLATS
from volume_files import read, write_volume

from renderer.bricks import make_bricks, mean_texels
from renderer.draw import BrickRasterizer
from renderer.errors import InputError
from renderer.frame import Stage, deserialize_stage, prepare_stage, render_frames, serialize_stage
from renderer.readers import read_volume
from renderer.scene import ErrorSpec, PyramidSpec, RawSource, Scene, VolumeSpec
from renderer.statistics import compute_statistics
from renderer.transfer import TransferFunction

Array = npt.NDArray[Any]

SOFT = TransferFunction(np.array([60.0, 250.0]), np.ones((2, 3)), np.array([0.0, 1.0]), 1.0)

HINT = "large volumes are read from their files while they are drawn: start again, and do not change this file"


@pytest.fixture(autouse=True)
def _everything_mapped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Map volumes of any size."""
    monkeypatch.setattr("renderer.readers.voxel_limits._MIN_MAPPED_BYTES", 1)


def noise(shape: tuple[int, ...] = (9, 7, 11), dtype: str = "uint8") -> Array:
    return np.random.default_rng(0).integers(0, 100, shape).astype(dtype)


def raw(path: Path, values: Array) -> VolumeSpec:
    values.tofile(path)
    z, y, x = values.shape
    return VolumeSpec(RawSource(path, (x, y, z), values.dtype.name, spacing=(1.0, 1.0, 1.0)))


@pytest.mark.parametrize("name", ["v.npy", "v.nrrd", "v.mha", "v.nii"])
@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint16", "int32", "float32", "float64"])
def test_the_same_voxels_as_in_memory(name: str, dtype: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Files in native byte order are mapped, others are copied."""
    for order in "<>":
        write_volume(tmp_path / name, noise(dtype=dtype), order)
        volume = read(tmp_path / name)
        with monkeypatch.context() as patch:
            patch.setattr("renderer.readers.voxel_limits._MIN_MAPPED_BYTES", 2**20)
            copied = read(tmp_path / name)
        assert copied.source is None
        np.testing.assert_array_equal(volume.values, noise(dtype=dtype))
        assert type(volume.values) is np.ndarray and volume.values.dtype.isnative
        assert not volume.values.flags.writeable and volume.values.flags.c_contiguous
        assert volume.fingerprint == copied.fingerprint
        assert np.array_equal(volume.world_from_index, copied.world_from_index)
        assert volume.value_range() == copied.value_range()
        assert compute_statistics(volume.values, volume.source).mean == compute_statistics(copied.values).mean
        is_native = order == "<" or dtype == "uint8"
        assert (volume.source is not None) == is_native


DETACHED = {
    "v.nhdr": "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 11 7 9\nencoding: raw\n{}data file: voxels.raw\n",
    "v.mhd": "NDims = 3\nDimSize = 11 7 9\nElementType = MET_UCHAR\n{}ElementDataFile = voxels.raw\n",
}


@pytest.mark.parametrize(
    ("name", "line", "skipped"),
    [
        ("v.nhdr", "", 0), ("v.nhdr", "byte skip: 5\n", 5), ("v.nhdr", "byte skip: -1\n", 5), ("v.mhd", "", 0),
        ("v.mhd", "HeaderSize = 5\n", 5), ("v.mhd", "HeaderSize = -1\n", 5),
    ],
)  # fmt: skip
def test_detached_voxels(name: str, line: str, skipped: int, tmp_path: Path) -> None:
    (tmp_path / "voxels.raw").write_bytes(bytes(skipped) + noise().tobytes())
    (tmp_path / name).write_text(DETACHED[name].format(line))
    volume = read(tmp_path / name)
    np.testing.assert_array_equal(volume.values, noise())
    assert volume.source is not None and volume.source.path == tmp_path / "voxels.raw"


def test_contiguous_parts_are_mapped(tmp_path: Path) -> None:
    values = noise((3, 9, 7, 11), "int16")
    np.save(tmp_path / "v.npy", values)
    for options, part, is_mapped in (
        ({"time": 1}, values[1], True),
        ({"time": 2, "crop": ((0, 11), (0, 7), (2, 5))}, values[2, 2:5], True),
        ({"time": 2, "crop": ((0, 11), (1, 7), (2, 5))}, values[2, 2:5, 1:], False),
        ({"component": 1}, values[1], True),
    ):
        volume = read(tmp_path / "v.npy", **options)
        np.testing.assert_array_equal(volume.values, part)
        assert (volume.source is not None) == is_mapped
    np.save(tmp_path / "last.npy", values[..., :8])
    volume = read(tmp_path / "last.npy", component=4)
    np.testing.assert_array_equal(volume.values, values[..., 4])
    assert volume.source is None


def test_volumes_with_voxels_without_data_are_copied(tmp_path: Path) -> None:
    values = noise(dtype="float32")
    spec = raw(tmp_path / "v.raw", values)
    assert read_volume(spec).source is not None
    values[3, 4, 5] = np.nan
    volume = read_volume(raw(tmp_path / "v.raw", values))
    assert volume.source is None
    np.testing.assert_array_equal(volume.values, values)


def test_unaligned_voxels(tmp_path: Path) -> None:
    """The header has an odd length."""
    values = noise((20, 18, 17), "uint16")
    (tmp_path / "v.raw").write_bytes(b"abc" + values.tobytes())
    source = RawSource(tmp_path / "v.raw", (17, 18, 20), "uint16", spacing=(1.0, 1.0, 1.0), offset=3)
    volume = read_volume(VolumeSpec(source))
    assert volume.source is not None and not volume.values.flags.aligned
    in_memory = replace(volume, values=values, source=None)
    one, other = (make_bricks(v, SOFT, spec=PyramidSpec(), error=ErrorSpec()) for v in (volume, in_memory))
    for level, level_in_memory in zip(one.levels, other.levels, strict=True):
        np.testing.assert_array_equal(level.visible_bounds, level_in_memory.visible_bounds)
        np.testing.assert_array_equal(level.step_errors, level_in_memory.step_errors)


# Files that do not stay as they are


def resize(path: Path, change: int, what: str) -> str:
    num_bytes = path.stat().st_size
    os.truncate(path, num_bytes + change)
    return (
        f"{path}: the volume's file {what} while it was in use\n"
        f"  got: {num_bytes + change} bytes\n  expected: {num_bytes} bytes, as when it was opened\n  hint: {HINT}"
    )


def shrink(path: Path) -> str:
    return resize(path, -100, "became shorter")


def grow(path: Path) -> str:
    return resize(path, 1, "grew")


def write(path: Path) -> str:
    os.utime(path, ns=(0, path.stat().st_mtime_ns + 1))
    return f"{path}: the volume's file was written to while it was in use\n  hint: {HINT}"


def remove(path: Path) -> str:
    path.unlink()
    return (
        f"{path}: the volume's file was removed while it was in use\n  got: No such file or directory\n  hint: {HINT}"
    )


def swap(path: Path) -> str:
    """Put another volume of the same length and time under the same name."""
    status = path.stat()
    other = path.with_suffix(".other")
    other.write_bytes(bytes(status.st_size))
    os.utime(other, ns=(0, status.st_mtime_ns))
    os.replace(other, path)
    return f"{path}: the volume's file was replaced by another while it was in use\n  hint: {HINT}"


def film(path: Path, scene: Scene, shape: tuple[int, int, int] = (20, 28, 32)) -> Stage:
    scene = replace(scene, error=ErrorSpec(0.0)).with_layers(volume=raw(path, noise(shape) * 2))
    return prepare_stage(scene, clock=lambda: 0.0, num_threads=1)


@pytest.mark.parametrize(
    ("scene", "change"), [(PLAIN, grow), (PLAIN, write), (PLAIN, remove), (PLAIN, swap), (SPLATS, shrink)]
)
def test_a_file_that_changes_between_build_and_frame(scene, change, tmp_path, rasterizer_for) -> None:
    stage = film(tmp_path / "v.raw", scene)
    list(render_frames(stage, [0], rasterizer_for(scene), clock=lambda: 0.0))
    message = change(tmp_path / "v.raw")
    with pytest.raises(InputError) as raised:
        list(render_frames(stage, [1], rasterizer_for(scene), clock=lambda: 0.0))
    assert str(raised.value) == message


def test_a_file_that_shrinks_before_texels_are_read(tmp_path: Path) -> None:
    stage = film(tmp_path / "v.raw", PLAIN, (40, 40, 40))
    bricks = stage.layers[0].bricks
    assert bricks is not None
    shrink(tmp_path / "v.raw")
    first = np.zeros((1, 3), np.int32)
    with pytest.raises(InputError, match="became shorter while it was in use"):
        scalar_texels(bricks, first, lit=False)
    with pytest.raises(InputError, match="became shorter while it was in use"):
        mean_texels(bricks, 1, first)


def test_a_file_that_shrinks_while_the_stage_is_serialized(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Voxels are read when all pieces are joined."""
    stage = film(tmp_path / "v.raw", PLAIN, (100, 90, 80))
    join = np.concatenate

    def joined(pieces: list[npt.NDArray[np.uint8]]) -> npt.NDArray[np.uint8]:
        content = join(pieces)
        shrink(tmp_path / "v.raw")
        return content

    monkeypatch.setattr("renderer.frame.transport.np.concatenate", joined)
    with pytest.raises(InputError, match="became shorter while it was in use"):
        serialize_stage(stage)


def test_a_serialized_stage_needs_no_file(tmp_path: Path, brick_rasterizer: BrickRasterizer) -> None:
    """It goes to machines that do not have the file, and draws the same there."""
    here = film(tmp_path / "v.raw", PLAIN, (100, 90, 80))
    there = deserialize_stage(serialize_stage(here).data)
    (ours,) = render_frames(here, [1], brick_rasterizer, clock=lambda: 0.0)
    shrink(tmp_path / "v.raw")
    (theirs,) = render_frames(there, [1], brick_rasterizer, clock=lambda: 0.0)
    np.testing.assert_array_equal(theirs.image, ours.image)
    (layer,) = there.layers
    assert layer.bricks is not None
    for volume in (layer.volume, layer.bricks.volume):
        assert volume.source is None
        np.testing.assert_array_equal(volume.values, noise((100, 90, 80)) * 2)
