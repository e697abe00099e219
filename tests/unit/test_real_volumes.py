"""Real volumes have their published shapes and spacings, their kind, and voxels and positions as other readers have."""

from __future__ import annotations

from itertools import product

import nibabel as nib
import nrrd
import numpy as np
import pydicom
import pytest
from volume_files import read
from vtkmodules.util import numpy_support
from vtkmodules.vtkIOImage import vtkMetaImageReader

from renderer.readers import read_volume
from renderer.scene import RawSource, VolumeSpec
from renderer.statistics import compute_statistics
from renderer.suggest import suggest
from renderer.volume import Volume

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
    "neghip.nhdr": "smooth field",
    "marschnerlobb.nhdr": "filled scan",
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


@pytest.mark.parametrize("name", ["engine.nhdr", "neghip.nhdr", "medical/headsq_quarter.nrrd"])
def test_voxels_and_corners_as_in_pynrrd(data_dir, name):
    volume = read(data_dir / name)
    values, header = nrrd.read(str(data_dir / name), index_order="C")
    np.testing.assert_array_equal(volume.values, values)
    axes = header["space directions"].T if "space directions" in header else np.diag(header["spacings"])
    origin = header.get("space origin", np.zeros(3))
    assert header.get("space", "left-posterior-superior") == "left-posterior-superior"
    np.testing.assert_allclose(positions(volume), [origin + axes @ index for index in corners(volume)], atol=1e-9)


def test_voxels_and_corners_as_in_vtk(data_dir):
    volume = read(data_dir / "medical/LIDC2.mha")
    reader = vtkMetaImageReader()
    reader.SetFileName(str(data_dir / "medical/LIDC2.mha"))
    reader.Update()
    image = reader.GetOutput()
    np.testing.assert_array_equal(volume.values.ravel(), numpy_support.vtk_to_numpy(image.GetPointData().GetScalars()))
    lps = np.multiply(corners(volume), image.GetSpacing()) * [1, -1, -1]  # by its TransformMatrix, which VTK ignores
    np.testing.assert_allclose(positions(volume), image.GetOrigin() + lps, atol=1e-9)


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


def test_dicom_series_as_in_its_files(data_dir):
    volume = read(data_dir / "medical/t1_dicom_part")
    files = [pydicom.dcmread(path) for path in sorted((data_dir / "medical/t1_dicom_part").iterdir())]
    np.testing.assert_array_equal(volume.values, [file.pixel_array for file in files])
    # Positions in the files have 12 significant digits, and are not quite even.
    places = [(volume.world_from_index @ [0, 0, k, 1])[:3] for k in range(len(files))]
    np.testing.assert_allclose(places, [file.ImagePositionPatient for file in files], atol=1e-6)
    across, down = np.reshape(files[0].ImageOrientationPatient, (2, 3))
    spacing = files[0].PixelSpacing
    axes = np.column_stack([across * spacing[1], down * spacing[0]])
    np.testing.assert_allclose(volume.world_from_index[:3, :2], axes, atol=1e-9)


def test_raw_walnut(data_dir):
    source = RawSource(data_dir / "walnut.raw", (128, 96, 114), "uint16", spacing=(0.015625,) * 3)
    volume = read_volume(VolumeSpec(source))
    assert (volume.values.min(), volume.values.max()) == (0, 22526)
    assert volume.values.shape == (114, 96, 128)
