"""Find the images of NeXus files: groups NXdata, whose attributes name the signal and the coordinates of its axes."""

from __future__ import annotations

import re
from functools import partial

from renderer.readers.affines import even_steps
from renderer.readers.hdf5_cf import describe as describe_plain, values_with_labels
from renderer.readers.hdf5_image import Axis, Candidate, PlainImage
from renderer.readers.hdf5_objects import (
    Dataset,
    Group,
    dataset_at,
    groups_and_datasets,
    line_at,
    numbers,
    open_inside,
    text,
    texts,
)
from renderer.readers.hdf5_values import Values, scaled
from renderer.readers.statements import FormatTable, Statement

STATEMENTS = FormatTable(
    "NeXus",
    (
        Statement("signal", "values", "the dataset with the data of a group"),
        Statement("default", "values", "the one of several groups that is to be shown"),
        Statement("axes", "place", "the datasets with the coordinates along each axis"),
        Statement("AXISNAME_indices", "place", "the axis along which coordinates lie"),
        Statement("scaling_factor", "values", "a factor on stored numbers"),
        Statement("offset", "values", "an offset of stored numbers, added before scaling"),
        Statement("units", "meaning", "the unit of the values, and of coordinates"),
        Statement("auxiliary_signals", "meaning", "other datasets to be shown with the data", is_applied=False),
        Statement("rotation_angle", "meaning", "the angles of frames, which are not slices", is_applied=False),
        Statement("image_key", "meaning", "the kind of each frame: projection, bright or dark field", is_applied=False),
    ),
)

# The largest number of attributes `default` that are followed from group to group. Usually the file names an entry, and
# the entry names its data.
_MAX_DEFAULTS = 4
# The name that stands for an axis without coordinates.
_NO_AXIS = "."


def find_images(file: Group) -> list[Candidate]:
    """Return the signals of all NXdata groups that have three axes or more.

    If the file names a default group, the signals of all other groups are read only if the scene names them.
    """
    groups = [each for _, each in groups_and_datasets(file) if text(each, "NX_class") == "NXdata"]
    shown, found = _default(file), []
    for group in groups:
        signal = _signal(group)
        if signal is not None and signal.ndim >= 3:
            describe = partial(_describe, group, signal)
            found.append((group, Candidate(signal.name.strip("/"), signal.shape, describe)))
    has_default = any(group == shown for group, _ in found)
    return [each._replace(is_part=has_default and group != shown) for group, each in found]


def _default(file: Group) -> Group:
    """Return the default group: the attribute `default` of the file and of each group names the next one."""
    here = file
    for _ in range(_MAX_DEFAULTS):
        following = open_inside(here, text(here, "default")) if text(here, "default") else None
        if following is None:
            break
        here = following
    return here


def _signal(group: Group) -> Dataset | None:
    """Return the dataset with the data of a group; None if there is none.

    The attribute `signal` of the group names the dataset; or the dataset has an attribute `signal` of 1, or the name
    `data`.
    """
    named = text(group, "signal")
    if named and "/" not in named:
        return dataset_at(group, named)
    children = [(name, dataset_at(group, name)) for name in group]
    for _, each in children:
        if each is not None and (1 in numbers(each, "signal") or text(each, "signal") == "1"):
            return each
    return dict(children).get("data")


def _describe(group: Group, signal: Dataset) -> PlainImage:
    plain = describe_plain(signal)
    names = _axis_names(group, signal)
    axes = tuple(_axis(group, name, k, own) for k, (name, own) in enumerate(zip(names, plain.axes, strict=True)))
    found = {"auxiliary_signals"} & {*group.attrs}
    entry = group.parent
    for field in ("rotation_angle", "image_key"):
        found |= {field for owner in (group, entry) if _is_for_frames(owner, field, signal)}
    values = partial(_values, group, signal.name.rpartition("/")[2])
    notes = (*plain.notes, STATEMENTS.note(found))
    return PlainImage(axes, signal, values, sizes=plain.sizes, notes=notes, lengths_note=plain.lengths_note)


def _is_for_frames(owner: Group, field: str, signal: Dataset) -> bool:
    """Return whether a group, or its sample or detector, has a field with a number for each frame of a signal."""
    paths = (field, f"sample/{field}", f"instrument/detector/{field}")
    return any(line_at(owner, path, signal.shape[0]) is not None for path in paths)


def _axis_names(group: Group, signal: Dataset) -> list[str]:
    """Return the name of the coordinates along each axis; an empty name for an axis without coordinates."""
    names = texts(group, "axes") or texts(signal, "axes")
    if len(names) == 1:  # an older form: one text with colons or commas between the names
        names = [name for name in re.split("[][:,]", names[0].strip()) if name.strip()]
    placed = [""] * signal.ndim
    for number, name in enumerate(names):
        at = numbers(group, f"{name}_indices")
        place = float(at[0]) if len(at) == 1 else number
        if len(at) < 2 and place in range(signal.ndim) and name != _NO_AXIS:
            placed[int(place)] = name.strip()
    return placed if names else _names_of_space(group, signal)


def _names_of_space(group: Group, signal: Dataset) -> list[str]:
    """Return x, y and z in the order of the axes, if the group has such coordinates with the lengths of the axes.

    Otherwise, all names are empty.
    """
    for names in (["x", "y", "z"], ["z", "y", "x"]):
        lines = (line_at(group, name, n) for name, n in zip(names, signal.shape, strict=False))
        if signal.ndim == len(names) and all(each is not None for each in lines):
            return names
    return [""] * signal.ndim


def _axis(group: Group, name: str, number: int, plain: Axis) -> Axis:
    """Return an axis with its coordinates, which are centres or edges of voxels; if there are none, the plain axis.

    name: the name of the dataset of coordinates. There is one edge more than voxels.
    """
    if not name or "/" in name:
        return plain
    along = line_at(group, name, plain.length)
    if along is not None:
        return plain._replace(name=name, unit=text(along, "units"), way=name.lower(), coordinates=along)
    edges = line_at(group, name, plain.length + 1)
    even = None if edges is None else _even_edges(edges)
    if edges is None or even is None:
        return plain._replace(name=name, way=name.lower())
    return plain._replace(name=name, unit=text(edges, "units"), way=name.lower(), steps=even)


def _even_edges(edges: Dataset) -> tuple[float, float] | None:
    """Return the centre of the first voxel and the step, by the edges of the voxels; None if these are not even."""
    even = even_steps(edges[...])
    return None if even is None else (even[0] + even[1] / 2, even[1])


def _values(group: Group, name: str, dataset: Dataset) -> Values:
    """Return the meaning of a dataset's numbers: `(stored + offset) * scaling_factor`, by fields of the group."""
    values = values_with_labels(dataset)
    factor, offset = (
        next((n for prefix in (f"{name}_", "") if (n := _number(group, prefix + field)) is not None), neutral)
        for field, neutral in (("scaling_factor", 1.0), ("offset", 0.0))
    )
    if (values.scale, values.offset) != (1.0, 0.0):
        return values
    made = scaled(values, factor, factor * offset)
    nodata = tuple((low * factor + made.offset, high * factor + made.offset) for low, high in values.nodata)
    return made._replace(nodata=tuple((min(pair), max(pair)) for pair in nodata))


def _number(group: Group, name: str) -> float | None:
    """Return the number in a dataset of a group; None unless the dataset has exactly one number."""
    found = dataset_at(group, name)
    return float(found[...].ravel()[0]) if found is not None and found.size == 1 else None
