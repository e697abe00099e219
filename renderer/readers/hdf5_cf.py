"""Describe any dataset of HDF5 or netCDF-4, by the conventions of netCDF (CF), by ilastik, or by its shape alone.

The dimension scale of an axis, a dataset that belongs to it, has the coordinates along the axis. Coordinates of a
vertical axis grow downwards where `positive` says so, and where they are pressures.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

from renderer.readers.affines import no_spacing
from renderer.readers.hdf5_image import Axis, Candidate, PlainImage
from renderer.readers.hdf5_objects import Dataset, Group, dataset_at, groups_and_datasets, line_at, numbers, text, texts
from renderer.readers.hdf5_values import Values, values_of
from renderer.readers.statements import FormatTable, Statement
from renderer.volume import Label

STATEMENTS = FormatTable(
    "HDF5 and netCDF-4 (CF)",
    (
        Statement("scale_factor", "values", "a factor on stored numbers"),
        Statement("add_offset", "values", "an offset of stored numbers"),
        Statement("_Unsigned", "values", "whether stored numbers have no sign"),
        Statement("_FillValue", "validity", "the number of voxels that were not written"),
        Statement("missing_value", "validity", "numbers that stand for no data"),
        Statement("valid_range", "validity", "the first and the last valid number"),
        Statement("valid_min", "validity", "the first valid number"),
        Statement("valid_max", "validity", "the last valid number"),
        Statement("units", "meaning", "the unit of the values, and of coordinates"),
        Statement("flag_values", "meaning", "the numbers of labels, whose names are in flag_meanings"),
        Statement("flag_masks", "meaning", "the bits of labels, whose names are in flag_meanings", is_applied=False),
        Statement("DIMENSION_LIST", "place", "the coordinates along each axis"),
        Statement("axis", "place", "the axis of the world along which coordinates lie"),
        Statement("positive", "place", "whether coordinates count upwards or downwards"),
        Statement("formula_terms", "place", "the heights of levels, by a formula", is_applied=False),
        Statement("grid_mapping", "place", "the map projection of coordinates", is_applied=False),
        Statement("coordinates", "place", "places of voxels in arrays of two axes or more", is_applied=False),
        Statement("calendar", "meaning", "a calendar with other days than ours", is_applied=False),
        Statement("element_size_um", "place", "the size of voxels in µm, slowest axis first"),
        Statement("axistags", "meaning", "the names of axes, and their steps; by ilastik and vigra"),
    ),
)

# Units of pressure. Coordinates in these units grow downwards, unless `positive` says otherwise.
_PRESSURES = (
    "pa",
    "hpa",
    "kpa",
    "pascal",
    "hectopascal",
    "bar",
    "bars",
    "mbar",
    "mb",
    "millibar",
    "millibars",
    "dbar",
    "decibar",
    "decibars",
    "atm",
    "atmosphere",
)
# Standard names of vertical coordinates that grow downwards, unless `positive` says otherwise.
_DOWNWARDS = (
    "depth",
    "air_pressure",
    "sea_water_pressure",
    "sea_water_pressure_due_to_sea_water",
    "atmosphere_sigma_coordinate",
    "atmosphere_hybrid_sigma_pressure_coordinate",
)
# Standard names of vertical coordinates that grow upwards.
_UPWARDS = (
    "height",
    "altitude",
    "ocean_sigma_coordinate",
    "ocean_s_coordinate",
    "ocean_s_coordinate_g1",
    "ocean_s_coordinate_g2",
    "atmosphere_ln_pressure_coordinate",
    "atmosphere_hybrid_height_coordinate",
)
# The units of longitudes and latitudes, by the axis of the world along which such coordinates lie.
_DEGREES = {"x": re.compile("degrees?_?(e|east)", re.IGNORECASE), "y": re.compile("degrees?_?(n|north)", re.IGNORECASE)}
# The axis of the world along which coordinates lie, by the standard name of the coordinates.
_STANDARD_WAYS = {"longitude": "x", "grid_longitude": "x", "projection_x_coordinate": "x"}
_STANDARD_WAYS |= {"latitude": "y", "grid_latitude": "y", "projection_y_coordinate": "y"}
# Calendars whose days are those of everyday life; an empty name stands for the standard calendar.
_USUAL_CALENDARS = ("", "standard", "gregorian", "proleptic_gregorian")
# The largest number of names in the attribute `coordinates` that are looked up.
_MAX_PLACES = 16
# Parts of the names of attributes that may hold lengths or places; a note lists such attributes.
_MAY_BE_LENGTHS = re.compile("spacing|voxel|pixel|resolution|origin|extent|direction|transform|size_|_size|apix")


def find_images(file: Group) -> list[Candidate]:
    """Return all datasets of numbers with two axes or more; those with two are read only if the scene names them."""
    import h5py

    return [
        Candidate(path, each.shape, partial(describe, each), is_part=each.ndim < 3 or min(each.shape) < 1)
        for path, each in groups_and_datasets(file)
        if isinstance(each, h5py.Dataset) and each.dtype.kind in "iufb" and each.ndim >= 2
    ]


def describe(dataset: Dataset) -> PlainImage:
    """Return the description of a dataset as an image."""
    tags = _axistags(dataset)
    axes = tuple(_axis(dataset, k, tags[k] if tags else {}) for k in range(dataset.ndim))
    found = set(_unapplied(dataset, axes))
    owners = (dataset, dataset.parent)
    names = sorted({name for owner in owners for name in owner.attrs if _MAY_BE_LENGTHS.search(name.lower())})
    return PlainImage(
        axes,
        dataset,
        values_with_labels,
        sizes=tuple(numbers(dataset, "element_size_um").tolist()),
        notes=(STATEMENTS.note(found),),
        lengths_note=no_spacing(names),
    )


def values_with_labels(dataset: Dataset) -> Values:
    """Return the meaning of a dataset's numbers; flags with names are labels."""
    values, names = values_of(dataset), " ".join(texts(dataset, "flag_meanings")).split()
    flags = values.of(numbers(dataset, "flag_values")).tolist()
    if "flag_masks" in dataset.attrs or len(flags) != len(names) or not all(flag.is_integer() for flag in flags):
        return values
    return values._replace(labels=tuple(Label(int(k), name) for k, name in zip(flags, names, strict=True)))


def _unapplied(dataset: Dataset, axes: tuple[Axis, ...]) -> Iterator[str]:
    """Yield the names of attributes that change how a dataset is understood, but are not applied."""
    yield from (name for name in ("flag_masks", "grid_mapping") if name in dataset.attrs)
    scales = [axis.coordinates for axis in axes if axis.coordinates is not None]
    if any("formula_terms" in scale.attrs for scale in scales):
        yield "formula_terms"
    if any(text(scale, "calendar").lower() not in _USUAL_CALENDARS for scale in scales):
        yield "calendar"
    for name in text(dataset, "coordinates").split()[:_MAX_PLACES]:
        beside = dataset_at(dataset.parent, name)
        if beside is not None and beside.ndim >= 2:
            yield "coordinates"


def _axistags(dataset: Dataset) -> list[dict[str, Any]]:
    """Return ilastik's description of each axis; an empty list if it is missing, or has another number of axes."""
    try:
        tags = json.loads(text(dataset, "axistags") or "{}")
        axes = [dict(each) for each in dict(tags)["axes"]]
    except (ValueError, TypeError, KeyError, RecursionError):
        return []
    return axes if len(axes) == dataset.ndim else []


def _axis(dataset: Dataset, axis: int, tag: dict[str, Any]) -> Axis:
    """Return an axis with its coordinates.

    Coordinates are in the dimension scale of the axis, or in a dataset of the same group with the name of the axis.

    tag: ilastik's description of the axis.
    """
    import h5py

    attached, length = dataset.dims[axis].values(), dataset.shape[axis]
    label = str(tag.get("key", "")) or dataset.dims[axis].label
    name = str(label or next((each.name.rpartition("/")[2] for each in attached if each.name), ""))
    beside = line_at(dataset.parent, name, length) if name and "/" not in name else None
    for each in (*attached, beside):
        is_line = isinstance(each, h5py.Dataset) and each.shape == (length,) and each.dtype.kind in "iuf"
        if is_line and not (each.is_virtual or each.external or "not a netCDF variable" in text(each, "NAME")):
            return _axis_along(each, name)
    return Axis(length, name, way=name.lower(), steps=_tagged_step(tag))


def _tagged_step(tag: dict[str, Any]) -> tuple[float, float] | None:
    """Return the coordinate of the first voxel of an axis, 0, and the step between its voxels, as ilastik states it.

    Returns None if the step is missing, or 0, which stands for an unknown one.
    """
    step = tag.get("resolution")
    return (0.0, float(step)) if isinstance(step, (int, float)) and 0 < step < math.inf else None


def _axis_along(scale: Dataset, name: str) -> Axis:
    """Return an axis with the coordinates of a dimension scale."""
    return described_axis(len(scale), name, partial(text, scale))._replace(coordinates=scale)


def described_axis(length: int, name: str, attribute: Callable[[str], str]) -> Axis:
    """Return an axis, still without coordinates. attribute: returns the text of an attribute of its coordinates."""
    unit, standard = attribute("units").strip(), attribute("standard_name").strip().lower()
    positive, is_pressure = attribute("positive").strip().lower(), unit.lower() in _PRESSURES
    is_downwards = standard in _DOWNWARDS or (not standard and name.lower() == "depth") or is_pressure
    is_vertical = positive in ("up", "down") or is_downwards or standard in _UPWARDS
    ways = (way for way, pattern in _DEGREES.items() if pattern.fullmatch(unit))
    own = attribute("axis").strip() or ("z" if is_vertical else "") or next(ways, "") or _STANDARD_WAYS.get(standard)
    points_down = positive == "down" or (is_downwards and positive != "up")
    return Axis(length, name, unit, (own or name).lower(), points_down)
