"""Images of other libraries are placed in the world as their files are, and no library is imported for them."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import nibabel
import numpy as np
import pytest
from nibabel import Nifti1Image

from renderer.errors import InputError
from renderer.readers import is_image_object, read_object, read_volume
from renderer.scene import FileSource, VolumeSpec

VALUES = np.arange(60, dtype=np.int16).reshape(3, 4, 5)
RAS_FROM_INDEX = np.array([[-0.5, 0.1, 0, 9], [0.1, 0.7, 0, -5], [0, 0, 2, 3], [0, 0, 0, 1.0]])


class Itk(SimpleNamespace):
    """An image of ITK, whose array it is; one of SimpleITK has its array from a function of its module."""

    spacing, origin = (0.5, 0.7, 2.0), (1.0, 2.0, 3.0)
    direction: Any = (0, 1, 0, 1, 0, 0, 0, 0, -1)
    values = VALUES

    def GetSpacing(self) -> Any:  # noqa: N802
        return self.spacing

    def GetOrigin(self) -> Any:  # noqa: N802
        return self.origin

    def GetDirection(self) -> Any:  # noqa: N802
        return self.direction

    def __array__(self, *_: Any, **__: Any) -> Any:
        return self.values


class Coordinates(SimpleNamespace):
    """The coordinates along an axis of a DataArray."""

    def __init__(self, values: Any, **attributes: str) -> None:
        self.values = np.asarray(values)
        super().__init__(dtype=self.values.dtype, ndim=self.values.ndim, attrs=attributes)

    def __array__(self, *_: Any, **__: Any) -> Any:
        return self.values


def data_array(dims: str, values: Any = VALUES, **coordinates: Coordinates) -> Coordinates:
    """A DataArray of xarray: its axes have a letter each."""
    made = Coordinates(values, units="K")
    made.__dict__.update(dims=tuple(dims), shape=made.values.shape, coords=coordinates, name="heat")
    return made


def napari_layer(**properties: Any) -> SimpleNamespace:
    return SimpleNamespace(**{"data": VALUES, "scale": (2.0, 0.7, 0.5), "translate": (3.0, 2.0, 1.0)} | properties)


STEPS = {
    "z": Coordinates(3.0 + 2.0 * np.arange(3), units="mm"),
    "y": Coordinates(2.0 - 0.7 * np.arange(4), units="mm"),
    "x": Coordinates(1.0 + 0.5 * np.arange(5), units="millimetres"),
}
PLACED = [[0.5, 0, 0, 1], [0, 0.7, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]]
TURNED = np.array([[0.5, 0, 0, 1], [0, -0.7, 0, 2], [0, 0, 2, 3], [0, 0, 0, 1]])


@pytest.mark.parametrize(
    ("image", "affine", "units"),
    [
        (Itk(), [[0, 0.7, 0, 1], [0.5, 0, 0, 2], [0, 0, -2, 3], [0, 0, 0, 1]], ("mm", "LPS", "")),
        (Itk(direction=np.eye(3)), PLACED, ("mm", "LPS", "")),
        (data_array("zyx", **STEPS), TURNED, ("mm", "", "K")),
        (data_array("tzyx", VALUES[None], **STEPS), TURNED, ("mm", "", "K")),
        (data_array("xzy", VALUES.transpose(2, 0, 1), **STEPS), TURNED[:, [1, 2, 0, 3]], ("mm", "", "K")),
        (data_array("zyx"), np.eye(4), ("", "", "K")),
        (napari_layer(), PLACED, ("", "", "")),
        (napari_layer(data=VALUES[None], scale=(9, 2.0, 0.7, 0.5), translate=(9, 3, 2, 1)), PLACED, ("", "", "")),
        (napari_layer(data=[VALUES, VALUES[:, ::2, ::2]], multiscale=True, units=("um",) * 3), PLACED, ("µm", "", "")),
        (
            napari_layer(data_to_world=lambda point: np.array([3, 2, 1]) + np.array([2, 0.7, 0.5]) * point[[1, 0, 2]]),
            [[0.5, 0, 0, 1], [0, 0, 0.7, 2], [0, 2, 0, 3], [0, 0, 0, 1]],
            ("", "", ""),
        ),
    ],
)  # fmt: skip
def test_places_and_units(image: Any, affine: Any, units: tuple[str, str, str]) -> None:
    assert is_image_object(image)
    found = read_object(image, "it")
    np.testing.assert_allclose(found.world_from_index, affine, atol=1e-12)
    assert tuple(found.units) == units
    assert found.has_lengths == (not np.array_equal(affine, np.eye(4)))
    assert set(found.values.shape) == {3, 4, 5} and np.shares_memory(found.values, VALUES)


@pytest.mark.parametrize(("scale", "codes"), [(1.0, (0, 2)), (3.7, (0, 1)), (1.0, (0, 0)), (1.0, (1, 0))])
def test_an_image_of_nibabel_is_read_like_its_file(scale: float, codes: tuple[int, int], tmp_path: Any) -> None:
    image = Nifti1Image(VALUES.T / scale, RAS_FROM_INDEX if any(codes) else None)
    image.set_data_dtype(np.int16)
    image.header.set_xyzt_units("micron")
    for key, code in zip(("qform_code", "sform_code"), codes, strict=True):
        image.header[key] = code
    image.to_filename(tmp_path / "a.nii.gz")
    loaded: Any = nibabel.load(tmp_path / "a.nii.gz")
    found, volume = read_object(loaded, "it"), read_volume(VolumeSpec(FileSource(tmp_path / "a.nii.gz")))
    np.testing.assert_array_equal(found.values, volume.values)
    assert found.values.dtype == volume.values.dtype
    np.testing.assert_array_equal(found.world_from_index, volume.world_from_index)
    assert (found.units.length_unit, found.units.world_axes) == (volume.length_unit, volume.world_axes)


class OnAnotherDevice:
    """A tensor of PyTorch in the memory of a graphics card."""

    device = "cuda:0"

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise TypeError("can't convert cuda:0 device type tensor to numpy")


# A DataArray of xarray that nothing can be computed of.
LAZY = SimpleNamespace(dims=tuple("tzyx"), shape=(9, 3, 4, 5), coords={}, name="heat")


@pytest.mark.parametrize(
    ("image", "told"),
    [
        (VALUES[0], ("not the axes", "shape [4, 5]", "`array[numpy.newaxis]`")),
        (VALUES[None], ("not the axes", "shape [1, 3, 4, 5]", "`list(array)`")),
        (np.zeros((4, 4, 4, 3)), ("not the axes", "shape [4, 4, 4, 3]", "`[array[..., k] for k in range")),
        (VALUES.astype(complex), ("of this type", "complex128", "magnitude")),
        (VALUES.astype(object), ("of this type", "object", "Python objects")),
        (VALUES[:0], ("no voxels", "5 x 4 x 0", "")),
        (OnAnotherDevice(), ("cannot be converted", "can't convert cuda:0", "`.cpu()`")),
        (np.ma.masked_greater(VALUES, 3), ("a masked array", "", "filled(numpy.nan)")),
        (Nifti1Image(np.zeros((2, 2, 2, 2), "f4"), np.eye(4)), ("not the axes", "[2, 2, 2, 2]", "`image.slicer")),
        (Itk(spacing=(1, 1), origin=(0, 0)), ("not the axes", "2 axes with 5 components", "")),
        (data_array("tzyx", np.stack([VALUES] * 2)), ("not the axes", "t (2), z (3)", "`array.isel(t=0)`")),
        (LAZY, ("not the axes", "t (9), z (3)", "`array.isel(t=0)`")),
        (data_array("zyx", x=Coordinates([0, 1, 4, 9, 16])), ("are not even", "x", "numpy.linspace(FIRST, LAST, 5)")),
        ({"scan": VALUES}, ("not the axes", "an object of type dict", "")),
        (SimpleNamespace(dims="z", coords={}, name="x"), ("SimpleNamespace is not read", "no attribute 'shape'", "")),
        (
            SimpleNamespace(dataobj=VALUES, affine=None, header={}),
            ("SimpleNamespace is not read", "cannot reshape", ""),
        ),
        (napari_layer(data=np.zeros((3, 3, 3, 3)), rgb=True), ("not the axes", "[3, 3, 3, 3]", "list")),
    ],
)
def test_what_is_no_volume(image: Any, told: tuple[str, str, str]) -> None:
    with pytest.raises(InputError) as error:
        read_object(image, "the scan")
    found = error.value
    parts = (found.what, found.got or "", found.hint or "")
    assert found.where == "the scan" and all(word in part for word, part in zip(told, parts, strict=True)), str(found)


def test_a_spacing_replaces_coordinates_that_are_not_even() -> None:
    uneven = data_array("zyx", x=Coordinates([0, 1, 4, 9, 16]))
    assert read_object(uneven, "it", has_spacing_override=True).values.shape == (3, 4, 5)
