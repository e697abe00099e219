"""A folder of masks on one grid is one volume of labels, named after its files."""

from __future__ import annotations

from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import volume_files
from volume_files import refused

from hsplat_cli.scenes import expand_volumes
from renderer.job import volume_files as files_of
from renderer.readers import find_volume
from renderer.scene import FileSource, VolumeSpec, file_source
from renderer.volume import Array

AFFINE = np.diag([1.0, 2.0, 3.0, 1.0])


def mask(name: str, *places: int, shape: tuple[int, int, int] = (4, 3, 2), value: int = 1, dtype: str = "u1") -> None:
    values = np.zeros(shape, dtype)
    values.reshape(-1)[list(places)] = value
    header = nib.Nifti1Header(endianness=">" if dtype[0] == ">" else "<")
    header.set_data_dtype(values.dtype)
    nib.Nifti1Image(values, AFFINE, header).to_filename(name)


@pytest.fixture(autouse=True)
def folder(folder: Path) -> Path:
    mask("liver.nii.gz", 0, 1, 2)
    mask("rib_2.nii.gz", 4)
    mask("rib_10.nii.gz", 2, 3)
    mask("spleen.nii.gz")
    Path("statistics.json").write_text("{}")
    return folder


def labels_at(values: Array) -> list[int]:
    return list(np.asarray(values).T.reshape(-1)[:5])


def test_masks_are_labels(folder: Path) -> None:
    """A voxel in several masks belongs to the smallest; masks without voxels have no label."""
    volume = volume_files.read(folder)
    assert labels_at(volume.values) == [1, 1, 3, 3, 2]
    assert [(each.value, each.name) for each in volume.labels] == [(1, "liver"), (2, "rib_2"), (3, "rib_10")]
    np.testing.assert_allclose(volume.spacing, (1, 2, 3))
    assert volume.note == (
        "its 4 masks are one volume of labels; 1 mask without a voxel; "
        "1 voxel in several masks belongs to the smallest of them"
    )


def test_masks_overlap_as_segments_do(folder: Path) -> None:
    """A voxel belongs to the smallest one, and to the last one of those that are equal."""
    generator = np.random.default_rng(1)
    inside = {number: {*generator.permutation(24)[:size].tolist()} for number, size in enumerate((9, 9, 4, 12, 9), 1)}
    for name, places in zip(("liver", "rib_2", "rib_10", "spleen", "tooth"), inside.values(), strict=True):
        mask(f"{name}.nii.gz", *places)
    expected, num_shared = np.zeros(24, np.uint8), 0
    for place in range(24):
        numbers = [number for number, places in inside.items() if place in places]
        expected[place] = min(numbers, key=lambda number: (len(inside[number]), -number), default=0)
        num_shared += len(numbers) > 1
    volume = volume_files.read(folder)
    np.testing.assert_array_equal(np.asarray(volume.values).T.reshape(-1), expected)
    assert (volume.note or "").endswith(f"; {num_shared} voxels in several masks belong to the smallest of them")


def test_the_folder_is_one_volume(folder: Path) -> None:
    assert expand_volumes([str(folder)]) == ([folder], [])
    assert expand_volumes(["*.nii.gz"])[0] == [Path(name) for name in sorted(each.name for each in folder.glob("*.gz"))]
    assert {each.name for each in files_of(VolumeSpec(FileSource(folder)))} >= {"liver.nii.gz", "spleen.nii.gz"}


@pytest.mark.parametrize("case", ["other grid", "other values", "another volume", "one mask"])
def test_other_folders_are_volumes(folder: Path, case: str) -> None:
    if case == "other grid":
        mask("a.nii.gz", 1, shape=(2, 3, 4))
    elif case == "other values":
        mask("a.nii.gz", 1, value=2)
    elif case == "another volume":
        np.save("a.npy", np.zeros((2, 3, 4), np.uint8))
    else:
        for name in ("rib_2", "rib_10", "spleen"):
            Path(f"{name}.nii.gz").unlink()
        assert find_volume(folder)[0] == folder / "liver.nii.gz"
        return
    assert len(expand_volumes([str(folder)])[0]) == 5


@pytest.mark.parametrize("dtype", ["i1", "<u2", ">i2"])
def test_masks_of_other_types(folder: Path, dtype: str) -> None:
    """A number whose bytes are 0 and 1 is not a mask's."""
    for name in ("liver", "rib_2", "rib_10", "spleen"):
        mask(f"{name}.nii.gz", 3, dtype=dtype)
    assert find_volume(folder)[1] == "masks"
    assert labels_at(volume_files.read(folder).values) == [0, 0, 0, 4, 0]
    if dtype != "i1":
        mask("liver.nii.gz", 3, value=256, dtype=dtype)
        assert len(expand_volumes([str(folder)])[0]) == 4


def test_files_that_differ_in_one_number_are_steps_in_time(folder: Path) -> None:
    """To a scene, too, which a turntable of them writes: it must not show the first mask alone."""
    for number, file in enumerate(sorted(folder.glob("*.nii.gz"))):
        file.rename(f"step_{number}.nii.gz")
    source = file_source(str(folder))
    assert isinstance(source, FileSource)
    assert len(expand_volumes([str(folder)])[0]) == len(source.steps) == 4


@pytest.mark.parametrize("num_bytes", [0, 30, -9])
@pytest.mark.parametrize("name", ["liver", "spleen"])
def test_a_truncated_mask_is_named(folder: Path, name: str, num_bytes: int) -> None:
    """It is the first or a further one, which is being written; the folder is one of masks anyway."""
    file = folder / f"{name}.nii.gz"
    file.write_bytes(file.read_bytes()[:num_bytes])
    assert len(expand_volumes([str(folder)])[0]) == 1
    assert refused(folder).where == str(file)


def test_masks_that_change_meanwhile(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.readers.masks.masks_in", lambda _: [])
    assert refused(folder, "these masks changed while they were read").where == str(folder)


def test_a_huge_volume_of_zeros_is_not_read_to_its_end(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.readers.sniff._MAX_MASK_BYTES", 4)
    mask("liver.nii.gz", 5, value=2)
    assert find_volume(folder)[1] == "masks"
    mask("liver.nii.gz", 18, value=2)
    assert len(expand_volumes([str(folder)])[0]) == 4


def test_a_mask_that_did_not_change_is_looked_at_once(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert find_volume(folder)[1] == "masks"
    with monkeypatch.context() as patch:
        patch.setattr("renderer.readers.sniff._opened", None)
        assert find_volume(folder)[1] == "masks"
    mask("liver.nii.gz", 5, 6, 7, 8, value=2)
    assert len(expand_volumes([str(folder)])[0]) == 4


def test_wrong_masks(folder: Path) -> None:
    mask("spleen.nii.gz", 3, value=2)
    error = refused(folder, "a mask beside others has only 0 and 1")
    assert (error.where, error.got) == (str(folder / "spleen.nii.gz"), "a voxel of 2")
    assert refused(folder, "there is no such component", component=1).got == "component: 1"
