"""Folders of TIFF slices, of which only the names say which is which: gaps, several stacks, and DICOM among them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from renderer.errors import InputError
from renderer.readers import read_volume
from renderer.scene import FileSource, VolumeSpec


def write(folder: Path, names: list[str]) -> None:
    """A slice by each name, which holds its place among them."""
    for k, name in enumerate(names):
        sitk.WriteImage(sitk.GetImageFromArray(np.full((4, 5), k, np.uint8)), str(folder / name))


def refusal(folder: Path) -> str:
    with pytest.raises(InputError) as error:
        read_volume(VolumeSpec(FileSource(folder)))
    return str(error.value).removeprefix(f"{folder}: ")


@pytest.mark.parametrize(
    "names",
    [
        ["s0.tif", "s1.tif", "s2.tif", "s3.tif"],
        ["s08.tif", "S09.TIF", "s10.tif", "s11.tif"],
        ["2024_z0.tif", "2024_z10.tif", "2024_z20.tif", "2024_z30.tif"],  # one number goes on, in steps
        ["z1_121503.tif", "z2_121504.tif", "z3_121509.tif", "z4_121511.tif"],  # a time that belongs to each
        ["121503_z1.tif", "121504_z2.tif", "121509_z3.tif", "121511_z4.tif"],
        ["only.tif"],
    ],
)
def test_one_stack(tmp_path: Path, names: list[str]) -> None:
    write(tmp_path, names)
    (tmp_path / "notes 7.txt").write_text("no slice")
    values = read_volume(VolumeSpec(FileSource(tmp_path))).values
    assert values[:, 0, 0].tolist() == list(range(len(names)))


def test_slices_that_are_missing(tmp_path: Path) -> None:
    write(tmp_path, [f"s{k:03}.tif" for k in range(20) if k not in (5, 6, 7)])
    assert refusal(tmp_path) == (
        "slices of this folder are missing\n"
        "  got: s008.tif after s004.tif\n"
        "  expected: numbers in steps of 1\n"
        "  hint: put the missing files back, or renumber the existing ones"
    )


def test_several_numbers_that_go_on(tmp_path: Path) -> None:
    write(tmp_path, [f"scan_ch{c}_z{z:02}.tif" for c in range(2) for z in range(4)])
    assert refusal(tmp_path) == (
        "the names of these slices have several increasing numbers\n"
        "  got: scan_ch0_z00.tif, ..., scan_ch1_z03.tif\n"
        "  expected: one number, in even steps, such as slice001.tif and slice002.tif\n"
        "  hint: channels or time steps? put each stack into its own folder"
    )


def test_several_prefixes(tmp_path: Path) -> None:
    write(tmp_path, ["dapi_0.tif", "dapi_1.tif", "gfp_0.tif", "gfp_1.tif"])
    assert refusal(tmp_path) == (
        "the slices of this folder are named in several ways\n"
        "  got: dapi_0.tif and gfp_0.tif\n"
        "  expected: names that differ in one number, such as slice001.tif and slice002.tif\n"
        "  hint: put each stack into its own folder, or rename its files"
    )


def test_one_number_twice(tmp_path: Path) -> None:
    write(tmp_path, ["s1.tif", "s2.tif", "s02.tif", "s3.tif"])
    assert refusal(tmp_path) == (
        "two slices of this folder have the same number\n"
        "  got: s02.tif and s2.tif\n"
        "  expected: one file for each number"
    )


def test_dicom_among_slices(tmp_path: Path) -> None:
    write(tmp_path, ["s0.tif", "s1.tif"])
    sitk.WriteImage(sitk.GetImageFromArray(np.zeros((4, 5), np.uint8)), str(tmp_path / "a.dcm"))
    assert refusal(tmp_path) == (
        "this folder holds both TIFF slices and DICOM files\n"
        "  got: s0.tif and a.dcm\n"
        "  expected: the slices of one volume\n"
        "  hint: put each volume into its own folder"
    )
