"""Real volumes have their published shapes and spacings, their kind, and positions as SimpleITK or nibabel has them."""

from __future__ import annotations

from itertools import product

import nibabel as nib
import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813

from renderer.readers import read_volume
from renderer.scene import RawSource, VolumeSpec
from renderer.suggest import compute_statistics, suggest
from renderer.volume import Volume
from tests.support.volume_files import read

pytestmark = pytest.mark.real_data

# name: choice, shape, spacing (four digits as published), dtype, lowest and highest value
PUBLISHED = {
    "engine.nhdr": ({}, (256, 256, 128), (1, 1, 1), "uint8", 0, 255),
    "bonsai.nhdr": ({}, (256, 256, 256), (1, 1, 1), "uint8", 0, 255),
    "fuel.nhdr": ({}, (64, 64, 64), (1, 1, 1), "uint8", 0, 255),
    "neghip.nhdr": ({}, (64, 64, 64), (1, 1, 1), "uint8", 0, 255),
    "hydrogenAtom.nhdr": ({}, (128, 128, 128), (1, 1, 1), "uint8", 0, 250),
    "marschnerlobb.nhdr": ({}, (41, 41, 41), (1, 1, 1), "uint8", 0, 255),
    "medical/LIDC2.mha": ({}, (256, 256, 133), (1.406, 1.406, 2.5), "uint8", 0, 255),
    "medical/CT_pitch.nii.gz": ({}, (175, 248, 58), (0.8125, 0.8125, 2.397), "uint8", 0, 255),
    "medical/headsq_quarter.nrrd": ({}, (64, 64, 93), (3.2, 3.2, 1.5), "uint16", 0, 3926),
    "medical/t1_dicom_part": ({}, (274, 384, 40), (0.70, 0.667, 0.667), "int16", 0, 179),
    "medical/example4d.nii.gz": ({"time": 1}, (128, 96, 24), (2, 2, 2.2), "int16", 0, 1140),
    "medical/functional.nii": ({"time": 19}, (17, 21, 3), (4, 4, 8), "float32", 829.7300415039062, 5541.08203125),
}
KINDS = {
    "engine.nhdr": "scan without an absolute scale",
    "neghip.nhdr": "smooth data",
    "marschnerlobb.nhdr": "filled volume",
    "medical/headsq_quarter.nrrd": "CT in Hounsfield units",
    "medical/t1_dicom_part": "scan without an absolute scale",
}


def corners(volume: Volume) -> list[tuple[int, int, int]]:
    return list(product(*((0, n - 1) for n in volume.shape_xyz)))


def positions(volume: Volume) -> np.ndarray:
    return np.array([(volume.world_from_index @ [*index, 1])[:3] for index in corners(volume)])


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_facts(data_dir, name):
    choice, shape, spacing, dtype, lowest, highest = PUBLISHED[name]
    volume = read(data_dir / name, **choice)
    assert volume.shape_xyz == shape
    assert volume.values.dtype == np.dtype(dtype)
    assert (volume.values.min(), volume.values.max()) == (lowest, highest)
    np.testing.assert_allclose(volume.spacing, spacing, rtol=6e-4)
    if name in KINDS:
        assert suggest(volume, compute_statistics(volume.values)).kind == KINDS[name]


@pytest.mark.parametrize("name", ["engine.nhdr", "medical/LIDC2.mha", "medical/headsq_quarter.nrrd"])
def test_voxels_and_corners_as_in_simpleitk(data_dir, name):
    volume = read(data_dir / name)
    image = sitk.ReadImage(str(data_dir / name))
    np.testing.assert_array_equal(volume.values, sitk.GetArrayViewFromImage(image))
    expected = [image.TransformIndexToPhysicalPoint(index) for index in corners(volume)]
    np.testing.assert_allclose(positions(volume), expected, atol=1e-9)


@pytest.mark.parametrize(
    ("name", "time"), [("medical/CT_pitch.nii.gz", 0), ("medical/example4d.nii.gz", 1), ("medical/functional.nii", 7)]
)
def test_voxels_and_corners_as_in_nibabel(data_dir, name, time):
    volume = read(data_dir / name, time=time)
    image = nib.load(data_dir / name)
    data = image.get_fdata()
    np.testing.assert_array_equal(
        volume.values, (data[..., time] if data.ndim == 4 else data).T.astype(volume.values.dtype)
    )
    ras = np.array([nib.affines.apply_affine(image.affine, index) for index in corners(volume)])
    np.testing.assert_allclose(positions(volume), ras * [-1, -1, 1], atol=1e-9)


def test_dicom_series_as_in_simpleitk(data_dir):
    volume = read(data_dir / "medical/t1_dicom_part")
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(data_dir / "medical/t1_dicom_part")))
    image = reader.Execute()
    np.testing.assert_array_equal(volume.values, sitk.GetArrayViewFromImage(image))
    expected = [image.TransformIndexToPhysicalPoint(index) for index in corners(volume)]
    # Positions in the files have 12 significant digits.
    np.testing.assert_allclose(positions(volume), expected, atol=1e-6)


def test_raw_walnut(data_dir):
    source = RawSource(data_dir / "walnut.raw", (128, 96, 114), "uint16", spacing=(0.015625,) * 3)
    volume = read_volume(VolumeSpec(source))
    assert (volume.values.min(), volume.values.max()) == (0, 22526)
    assert volume.values.shape == (114, 96, 128)
