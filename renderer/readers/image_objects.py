"""Read images in memory: numpy arrays, and images of other libraries, which are known by their attributes.

No library is imported. An image of a library is placed in the world as its file is.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import affine, even_steps, in_lps
from renderer.readers.file_errors import errors_about
from renderer.readers.hdf5_cf import described_axis
from renderer.readers.hdf5_image import place_of_axes
from renderer.readers.image import Image
from renderer.readers.scaled_values import scaled
from renderer.readers.units import Units, units_of
from renderer.readers.voxel_limits import check_dtype, check_size
from renderer.scene import format_value, short_text
from renderer.stores import axis_named
from renderer.volume import Array

# The factors from the axes of the world of NIfTI, RAS, to LPS.
_LPS_FROM_RAS = (-1.0, -1.0, 1.0)
# The words for voxels in messages.
_EXPECTED = "three axes, [z, y, x]"
# The largest number of characters of an object's text in a message; of a longer one, the type is shown.
_MAX_SHOWN = 60


def read_object(image: object, name: str, *, has_spacing_override: bool = False) -> Image:
    """Return an image in memory. Its values are not copied; booleans become 0 and 1.

    image: an array [z, y, x], or an image of nibabel, ITK, SimpleITK, xarray or napari. name: its name in messages.
    has_spacing_override: whether a spacing replaces the image's own, so that coordinates need not be even.
    Raises InputError for anything that is no volume.
    """
    with errors_about(name):
        made = _read(image, has_spacing_override)
        check_dtype(made.values.dtype)
        check_size(made.values.shape[::-1], made.values.dtype)
    return made


def _read(image: object, has_spacing_override: bool) -> Image:
    found = next((read for names, read in _KINDS if all(hasattr(image, name) for name in names)), None)
    if found is not None:
        try:
            return found(image, has_spacing_override)
        except (AttributeError, TypeError, ValueError, LookupError) as error:  # the attributes have another meaning
            what, got = f"this {type(image).__name__} is not read", short_text(" ".join(str(error).split()))
            expected = "an array, or an image of nibabel, ITK, SimpleITK, xarray or napari"
            raise InputError(what, got=got, expected=expected) from error
    return Image(_three_axes(_values_of(image), image), np.eye(4), has_lengths=False)


def is_image_object(image: object) -> bool:
    """Return whether an object is an image of a library whose place in the world can be read."""
    return any(all(hasattr(image, name) for name in names) for names, _ in _KINDS)


def _values_of(values: Any) -> Array:
    """Return the numbers of an object as an array, booleans as 0 and 1. Raises InputError for other objects."""
    if np.ma.is_masked(values):
        raise InputError(
            "a masked array, whose masked voxels would be drawn",
            expected="an array without a mask",
            hint="`array.astype(float).filled(numpy.nan)` hides the masked voxels, as NaN is hidden",
        )
    try:
        array = values if isinstance(values, np.memmap) else np.asarray(values)
    except (ValueError, TypeError, RuntimeError) as error:  # such as ragged lists, or tensors on another device
        raise InputError(
            "this cannot be converted to an array",
            got=short_text(" ".join(str(error).split())),
            expected="numbers in three axes, [z, y, x]",
            hint=_hint_to_copy(values),
        ) from error
    if array.ndim == 0 or (array.ndim < 3 and array.dtype.kind in "OSU"):  # no numbers, but texts or other objects
        is_short = len(repr(values)) <= _MAX_SHOWN
        got = repr(values) if is_short else f"an object of type {type(values).__name__}"
        raise InputError("not the axes of a volume", got=got, expected=_EXPECTED)
    return array.view(np.uint8) if array.dtype == np.bool_ else array


def _hint_to_copy(values: object) -> str | None:
    """Return a hint for an array in the memory of a graphics card."""
    if not hasattr(values, "__cuda_array_interface__") and not str(getattr(values, "device", "cpu")).startswith("cuda"):
        return None
    return "copy it to the computer's memory: `.cpu()` for PyTorch, `.get()` for CuPy"


def _three_axes(values: Array, image: object) -> Array:
    """Return the array if it has three axes. Raises InputError otherwise. image: the image that it comes from."""
    if values.ndim == 3:
        return values
    raise InputError(
        "not the axes of a volume",
        got=f"shape {format_value(list(values.shape))}",
        expected=_EXPECTED,
        hint=_axes_hint(values, image),
    )


def _axes_hint(values: Array, image: object) -> str | None:
    if values.ndim == 2:
        return "`array[numpy.newaxis]` is a volume of one slice"
    if values.ndim < 2:
        return None
    if values.ndim > 4:
        return f"`array[{', '.join(['0'] * (values.ndim - 3))}]` is the first of its volumes"
    if hasattr(image, "slicer"):
        return "`image.slicer[..., 0]` is the first of its volumes"
    if values.shape[-1] < min(values.shape[:-1]):
        return "a list draws channels in one picture: `[array[..., k] for k in range(array.shape[-1])]`"
    return "`array[k]` is one step in time; a list draws channels in one picture: `list(array)`"


def _read_nibabel(image: Any, _: bool) -> Image:
    """Return an image of nibabel, with the numbers in the type that its file has."""
    stored, header = image.dataobj, image.header
    slope, intercept = getattr(stored, "slope", 1.0), getattr(stored, "inter", 0.0)
    values = _values_of(stored.get_unscaled() if hasattr(stored, "get_unscaled") else stored)
    while values.ndim > 3 and values.shape[-1] == 1:
        values = values[..., 0]
    check_dtype(values.dtype)
    values = _three_axes(values.T, image)
    placed, axes = np.array(image.affine, np.float64).reshape(4, 4), "LPS"
    if hasattr(header, "get_sform") and not (header["sform_code"] > 0 or header["qform_code"] > 0):
        from renderer.readers.nifti import ras_from_index

        placed, axes = ras_from_index(header)
    has_units = hasattr(header, "get_xyzt_units")
    unit = header.get_xyzt_units()[0] if has_units else "mm"
    units = units_of("" if unit == "unknown" else unit, axes)
    return Image(scaled(values, float(slope), float(intercept)), in_lps(placed, _LPS_FROM_RAS), units=units)


def _read_itk(image: Any, _: bool) -> Image:
    """Return an image of ITK or SimpleITK, whose world has LPS axes and, by its convention, lengths in mm."""
    spacing, origin = np.array([*image.GetSpacing()], np.float64), np.array([*image.GetOrigin()], np.float64)
    values = _three_axes(_values_of(_itk_values(image)), image)
    if len(spacing) != 3:
        got = f"an image of {len(spacing)} axes with {values.shape[-1]} components"
        raise InputError("not the axes of a volume", got=got, expected="three axes")
    direction = np.array(image.GetDirection(), np.float64).reshape(3, 3)
    return Image(values, affine(spacing, origin, direction), units=Units("mm", "LPS"))


def _itk_values(image: Any) -> Any:
    """Return the voxels of an image of ITK or SimpleITK; the latter's module, which is loaded, has a function."""
    module = sys.modules.get(type(image).__module__.partition(".")[0])
    view = getattr(module, "GetArrayViewFromImage", None)
    return image if view is None else view(image)


def _read_xarray(array: Any, has_spacing_override: bool) -> Image:
    """Return a DataArray of xarray, whose coordinates place the voxels as in a netCDF file."""
    lengths = dict(zip(map(str, array.dims), array.shape, strict=True))
    names = _space_of(lengths)
    if len(names) != 3:
        got = ", ".join(f"{short_text(name)} ({length})" for name, length in lengths.items())
        extra = next((name for name in names if axis_named(name).kind in ("time", "channel")), [*names, "t"][0])
        hint = f"`array.isel({extra}=0)` is the first volume along {short_text(extra)}" if len(names) > 3 else None
        raise InputError("not the axes of a volume", got=got, expected="three axes", hint=hint)
    # Only an array of a volume is computed: a lazy one of many steps may be larger than memory.
    values = _values_of(array)[tuple(slice(None) if name in names else 0 for name in lengths)]
    axes = []
    for name in names:
        line = array.coords.get(name)
        axis = described_axis(lengths[name], name, _attributes(line))
        if line is not None and line.dtype.kind in "iuf" and line.ndim == 1:
            axis = axis._replace(steps=_steps_of(np.asarray(line), name, has_spacing_override))
        axes.append(axis)
    has_lengths = any(axis.has_lengths for axis in axes)
    placed, unit, notes = place_of_axes(axes[::-1], has_spacing_override)
    units = units_of(unit, value=_attributes(array)("units"))
    return Image(values, placed, (*notes,) * has_lengths, units=units, has_lengths=has_lengths)


def _space_of(lengths: Mapping[str, int]) -> list[str]:
    """Return the names of the axes of a volume: without axes of length 1 beyond three, first those of no space."""
    names = [*lengths]
    for name in sorted(names, key=lambda name: axis_named(name).kind not in ("time", "channel")):
        if len(names) > 3 and lengths[name] == 1 and axis_named(name).kind != "space":
            names.remove(name)
    return names


def _attributes(array: Any) -> Callable[[str], str]:
    """Return a function that returns the text of an attribute of a DataArray; empty without the attribute."""
    attributes = getattr(array, "attrs", {})

    def text(name: str) -> str:
        found = attributes.get(name, "")
        return found if isinstance(found, str) else ""

    return text


def _steps_of(coordinates: Array, name: str, has_spacing_override: bool) -> tuple[float, float] | None:
    even = even_steps(coordinates)
    if even is None and not has_spacing_override:
        raise InputError(
            "the coordinates of this array are not even",
            got=short_text(name),
            expected="equal steps, as voxels have",
            hint=f"`array.interp({short_text(name)}=numpy.linspace(FIRST, LAST, {len(coordinates)}))` makes them so",
        )
    return even or (0.0, 1.0)


def _read_napari(layer: Any, _: bool) -> Image:
    """Return a layer of napari, in the world of its viewer; of levels, the finest."""
    values = _values_of(layer.data[0] if getattr(layer, "multiscale", False) else layer.data)
    num_axes, extra = values.ndim, values.ndim - 3
    if extra > 0 and not getattr(layer, "rgb", False) and max(values.shape[:extra]) == 1:
        values = values.reshape(values.shape[extra:])
    values = _three_axes(values, layer)
    if hasattr(layer, "data_to_world"):
        corners = np.vstack([np.zeros(num_axes), np.eye(num_axes)[-3:]])
        origin, *ends = (np.array(layer.data_to_world(corner), np.float64)[-3:] for corner in corners)
        columns = [end - origin for end in ends]
    else:
        origin, columns = np.array(layer.translate, np.float64)[-3:], [*np.diag([*layer.scale][-3:])]
    placed = np.eye(4)
    placed[:3, :3], placed[:3, 3] = np.stack(columns, axis=1)[::-1, ::-1], origin[::-1]
    unit = str(next(iter([*getattr(layer, "units", ())][-1:]), ""))
    units = units_of(unit)
    return Image(values, placed, units=units, has_lengths=bool(units.length_unit) or not np.allclose(layer.scale, 1))


# The attributes by which images of libraries are known, each with the function that reads such an image.
_KINDS: Sequence[tuple[tuple[str, ...], Callable[[Any, bool], Image]]] = (
    (("dataobj", "affine", "header"), _read_nibabel),
    (("GetSpacing", "GetOrigin", "GetDirection"), _read_itk),
    (("dims", "coords", "name"), _read_xarray),
    (("data", "scale", "translate"), _read_napari),
)
