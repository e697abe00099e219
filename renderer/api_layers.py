"""Define the volumes that the Python API takes, alone or several for one picture, and turn them into a scene's tree."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from renderer.errors import InputError
from renderer.readers import is_image_object, read_object, read_volume
from renderer.scene import (
    MAX_DEPTH,
    ArraySource,
    CameraSpec,
    TransferSpec,
    VolumeSpec,
    file_source,
    format_value,
    is_url,
    short_text,
    spec_to_dict,
)
from renderer.suggest import NO_WISH, Wish

TransferLike: TypeAlias = "str | Sequence[Any] | Mapping[str, Any] | TransferSpec"
"""A transfer function: the name of a colormap; control points; a mapping as in a scene file, or with a preset; or a
TransferSpec, such as `scene.at(0).layers[0].transfer_function`."""


class NibabelImage(Protocol):
    """An image of nibabel."""

    @property
    def dataobj(self) -> Any:
        """Return the voxels [x, y, z]."""

    @property
    def affine(self) -> Any:
        """Return the affine from voxel indices to RAS."""


class ItkImage(Protocol):
    """An image of ITK or SimpleITK."""

    def GetSpacing(self) -> Any:  # noqa: N802
        """Return the lengths of a voxel."""

    def GetOrigin(self) -> Any:  # noqa: N802
        """Return the place of the first voxel, in LPS."""

    def GetDirection(self) -> Any:  # noqa: N802
        """Return the directions of the axes."""


class NapariLayer(Protocol):
    """A layer of images or labels of napari."""

    @property
    def data(self) -> Any:
        """Return the voxels [z, y, x]."""

    @property
    def scale(self) -> Any:
        """Return the lengths of a voxel along (z, y, x)."""


# Type checkers take arrays of xarray as arrays.
ImageLike: TypeAlias = "str | os.PathLike[str] | npt.ArrayLike | NibabelImage | ItkImage | NapariLayer"
"""A volume: an array [z, y, x]; an image of nibabel, ITK, SimpleITK or xarray; a layer of napari; or the name of a
file."""


@dataclass(frozen=True, eq=False)
class Layer:
    """A volume with its place and its look, for a picture of one or several volumes.

    Attributes
    ----------
    values
        An array [z, y, x], an image of nibabel, ITK, SimpleITK, xarray or napari, or the name of a volume's file.
    name
        The name of the volume in messages and legends.
    spacing
        Lengths of a voxel along (x, y, z), in place of the image's own.
    affine
        A 4 x 4 matrix from voxel indices (x, y, z) to the world, in place of the image's own; a body's world has LPS
        axes.
    unit
        The unit of lengths in the world, such as "mm".
    transfer_function
        As in `suggest_scene`.
    labels
        For a volume of labels, a mapping from their numbers to names, which may be empty; or the keys of `labels` in a
        scene file, such as `{"show": [1, 2]}`.
    mask
        A volume inside of whose labels this one is shown: a Layer, or what `values` may be.
    """

    values: ImageLike
    name: str = ""
    spacing: Sequence[float] | None = None
    affine: npt.ArrayLike | None = None
    unit: str | None = None
    transfer_function: TransferLike | None = None
    labels: Mapping[Any, Any] | None = None
    mask: ImageLike | Layer | None = None

    @property
    def wish(self) -> Wish | None:
        """Return the wish that steers the suggestion of a look; None if the layer has a look of its own."""
        match self.transfer_function:
            case None:
                return NO_WISH
            case str(colormap):
                return Wish(colormap)
            case {"preset": str(preset), **others} if not others:
                return Wish(preset=preset)
        return None


VolumesLike: TypeAlias = "ImageLike | Layer | Sequence[ImageLike | Layer] | Mapping[str, ImageLike | Layer]"
"""One volume; or several in a list, or in a mapping from names to volumes. Each is an `ImageLike` or a `Layer`."""

# The keys of `labels` in a scene. A mapping with other keys is a table of names.
_LABELS_KEYS = ("colors", "opacity", "show", "hide", "names", "unit")
_SEVERAL = "one volume, several in a list, or a mapping from names to volumes"


def layers_of(volumes: Any) -> list[Layer]:
    """Return a layer for each volume. Raises InputError for an empty list, and for wrong names, or names in a list."""
    if isinstance(volumes, Mapping):
        for name in volumes:
            if not isinstance(name, str) or not name.strip():
                raise InputError(
                    "not the name of a volume", where="volume", got=short_text(repr(name)), expected="text"
                )
        made = [replace(_as_layer(each), name=name) for name, each in volumes.items()]
    elif isinstance(volumes, (list, tuple)) and any(map(_is_named, volumes)):
        hint = 'a mapping gives volumes their names: `{"CT": ct, "PET": pet}`'
        raise InputError("a list of names and volumes", where="volume", expected=_SEVERAL, hint=hint)
    elif isinstance(volumes, (list, tuple)) and (not len(volumes) or any(map(_is_layer, volumes))):
        made = [_as_layer(each) for each in volumes]
    else:
        return [_as_layer(volumes)]
    if not made:
        raise InputError("no volume", where="volume", got=short_text(repr(volumes)), expected=_SEVERAL)
    return made


def _is_layer(item: object) -> bool:
    """Return whether an item of a list is a volume of its own, and not a slice or a row of numbers."""
    is_whole = isinstance(item, (str, os.PathLike, Layer)) or is_image_object(item)
    return is_whole or (hasattr(item, "__array__") and getattr(item, "ndim", 0) >= 3)


def _is_named(item: object) -> bool:
    """Return whether an item of a list is a mapping from names, or a pair of a name and something else."""
    return isinstance(item, Mapping) or (isinstance(item, (list, tuple)) and isinstance(next(iter(item), None), str))


def _as_layer(value: Any) -> Layer:
    """Return a volume as a layer; a layer of labels of napari shows labels."""
    if isinstance(value, Layer):
        return value
    name = value.name if is_image_object(value) and isinstance(getattr(value, "name", None), str) else ""
    return Layer(value, name, labels={} if hasattr(value, "selected_label") else None)


@dataclass(frozen=True)
class Grid:
    """The grid of a volume, on which arrays without a place of their own lie, such as masks.

    shape: the numbers of voxels along x, y, z. affine: as of an ArraySource. spacing: replaces the lengths of `affine`.
    """

    shape: tuple[int, ...]
    affine: tuple[tuple[float, ...], ...] | None
    spacing: Any = None

    @classmethod
    def of_volume(cls, volume: VolumeSpec) -> Grid:
        """Return the grid of a volume, which is read."""
        found = read_volume(volume)
        return cls(found.shape_xyz, _rows(found.world_from_index))

    @classmethod
    def of_section(cls, section: Mapping[str, Any]) -> Grid:
        """Return the grid of a volume whose keys are in a section of a scene's tree."""
        source, spacing = section["file"], section.get("spacing")
        if isinstance(source, ArraySource):
            return cls(source.shape, source.affine, spacing)
        found = cls.of_volume(VolumeSpec(file_source(source if is_url(source) else Path(source))))
        return replace(found, spacing=spacing)


def _rows(affine: npt.ArrayLike) -> tuple[tuple[float, ...], ...]:
    rows: list[list[float]] = np.asarray(affine, np.float64).tolist()
    return tuple(map(tuple, rows))


def volume_section(layer: Layer, name: str, spacing: Any, grid: Callable[[], Grid] | None = None) -> dict[str, Any]:
    """Return the keys of a layer's volume in the tree of a scene.

    name: the name of the volume in messages. spacing: lengths for a layer that has none. grid: returns the grid on
    which an array without a place of its own lies, if it must lie on one. Raises InputError for arrays that are no
    volumes.
    """
    spacing = plain(layer.spacing) if layer.spacing is not None else spacing
    if isinstance(layer.values, (str, os.PathLike)):
        source: Any = os.fspath(layer.values)
    else:
        source = _array_source(layer, name, has_spacing=spacing is not None)
        if grid is not None and source.affine is None and layer.spacing is None:
            place = grid()
            _require_shape(source, place)
            source, spacing = replace(source, affine=place.affine), place.spacing
    keys = {"file": source, "spacing": spacing, "unit": layer.unit}
    return {key: value for key, value in keys.items() if value is not None}


def _array_source(layer: Layer, name: str, *, has_spacing: bool) -> ArraySource:
    image = read_object(layer.values, name, has_spacing_override=has_spacing)
    place = image.world_from_index if image.has_lengths else None
    if layer.affine is not None:
        place = _matrix(layer.affine, name)
    units = image.units
    return ArraySource(image.values, name, None if place is None else _rows(place), units.length_unit, units.world_axes)


def _matrix(affine: npt.ArrayLike, name: str) -> npt.NDArray[np.float64]:
    """Return an affine as a matrix. Raises InputError for anything else."""
    try:
        matrix = np.asarray(affine, np.float64)
        got = f"shape {format_value(list(matrix.shape))}" if matrix.shape != (4, 4) else format_value(matrix.tolist())
    except (ValueError, TypeError):
        matrix, got = np.empty(0), short_text(repr(affine))
    if matrix.shape != (4, 4) or not np.array_equal(matrix[3], [0, 0, 0, 1]):
        expected = "4 x 4 numbers, whose last row is [0, 0, 0, 1]"
        raise InputError("not an affine", where=f"{name}: affine", got=got, expected=expected)
    return matrix


def _require_shape(source: ArraySource, grid: Grid) -> None:
    """Raise InputError if an array without a place of its own has another shape than the grid on which it lies."""
    if source.shape == grid.shape:
        return
    hint = "`renderer.Layer(values, spacing=..., affine=...)` places an array on a grid of its own"
    if source.shape == grid.shape[::-1]:
        hint = "its axes may be [x, y, z]: `array.transpose()` turns them round; or give the image itself"
    raise InputError(
        "this array does not have the shape of the first volume",
        where=source.name,
        got=f"shape {format_value(list(source.shape[::-1]))}",
        expected=f"shape {format_value(list(grid.shape[::-1]))}, [z, y, x]",
        hint=hint,
    )


def mask_section(mask: Any, grid: Callable[[], Grid]) -> dict[str, Any]:
    """Return the keys of a mask in the tree of a scene. Raises InputError for a mapping, which has no voxels."""
    if isinstance(mask, Mapping):
        hint = '`renderer.Layer(values, labels={"show": [1, 2]})` chooses labels of the volume `values`'
        got = short_text(repr(mask))
        raise InputError("not a volume", where="mask", got=got, expected="a volume of labels", hint=hint)
    (layer,) = layers_of([mask]) if isinstance(mask, Layer) else [Layer(mask)]
    chosen = {} if layer.labels is None else labels_section(layer.labels)
    return volume_section(layer, "the mask", None, grid) | chosen


def labels_section(labels: Mapping[Any, Any]) -> dict[str, Any]:
    """Return the keys of `labels` in the tree of a scene, from these keys or from a table of names.

    A table is a mapping from numbers to names, or from names to numbers.
    """
    if all(key in _LABELS_KEYS for key in labels):
        return dict(plain(labels))
    if all(isinstance(value, (int, np.integer)) for value in labels.values()):
        labels = {number: name for name, number in labels.items()}
    return {"names": {plain(number): plain(name) for number, name in labels.items()}}


def plain(value: Any, num_levels: int = MAX_DEPTH) -> Any:
    """Return an option as the plain data of a scene: numbers, texts, lists and mappings.

    num_levels: the largest number of nested levels. Raises InputError if there are more.
    """
    if num_levels == 0:
        raise InputError(f"an option of more than {MAX_DEPTH} levels", hint="does it contain itself?")
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, CameraSpec):  # None removes the keys of the scene that the camera does not set
        return {"target": None, "distance": None} | spec_to_dict(value)
    if isinstance(value, TransferSpec):
        return {"labels": spec_to_dict(value)} if value.labels is not None else spec_to_dict(value)
    if isinstance(value, Mapping):
        return {plain(key): plain(item, num_levels - 1) for key, item in value.items()}
    return [plain(item, num_levels - 1) for item in value] if isinstance(value, (list, tuple)) else value
