"""Find the images of electron microscopy datasets (EMD, of NCEM and py4DSTEM): groups with `data`, `dim1` and so on."""

from __future__ import annotations

import re
from functools import partial

import numpy as np

from renderer.readers.hdf5_cf import describe as describe_plain
from renderer.readers.hdf5_image import Axis, Candidate, PlainImage
from renderer.readers.hdf5_objects import Dataset, Group, dataset_at, groups_and_datasets, is_in_file, text
from renderer.readers.hdf5_values import Values
from renderer.readers.statements import FormatTable, Statement

STATEMENTS = FormatTable(
    "EMD",
    (
        Statement("emd_group_type", "place", "whether a group has data with coordinates"),
        Statement("dim1", "place", "the coordinates along an axis; also dim2 and so on"),
        Statement("name", "place", "the name of an axis"),
        Statement("units", "meaning", "the unit of coordinates, and of the values"),
    ),
)


def find_images(file: Group) -> list[Candidate]:
    """Return the data of all EMD groups that have three axes or more."""
    found = []
    for path, each in groups_and_datasets(file):
        data = dataset_at(each, "data") if "emd_group_type" in each.attrs else None
        if data is not None and data.ndim >= 3:
            found.append(Candidate(f"{path}/data", data.shape, partial(_describe, each, data)))
    return found


def _describe(group: Group, data: Dataset) -> PlainImage:
    plain = describe_plain(data)
    first = 0 if dataset_at(group, "dim0") is not None else 1
    axes = tuple(_axis(group, f"dim{first + k}", own) for k, own in enumerate(plain.axes))
    return PlainImage(axes, data, partial(_values, plain), notes=plain.notes, lengths_note=plain.lengths_note)


def _values(plain: PlainImage, dataset: Dataset) -> Values:
    values = plain.values(dataset)
    return values._replace(unit=_plain_unit(values.unit))


def _axis(group: Group, name: str, plain: Axis) -> Axis:
    """Return an axis with its coordinates, of which a file may store just the first two if steps are even."""
    line = dataset_at(group, name)
    if line is None or line.ndim != 1 or not is_in_file(line):
        return plain
    own, unit = text(line, "name"), _plain_unit(text(line, "units"))
    axis = plain._replace(name=own, unit=unit, way=own.lower())
    if len(line) == plain.length:
        return axis._replace(coordinates=line)
    if len(line) != 2:
        return axis
    first, second = np.asarray(line[...], np.float64).tolist()
    return axis._replace(steps=(first, second - first)) if second != first else axis


def _plain_unit(unit: str) -> str:
    """Return the usual spelling of a unit with a prefix: `nm` for `[n_m]`."""
    inside = unit.strip().removeprefix("[").removesuffix("]")
    return re.sub("^([a-zA-Zµμ])_", r"\1", inside)
