"""Read the metadata of OME-NGFF (OME-Zarr): images with levels, their channels, and labels.

Versions 0.4 (Zarr 2), 0.5 (Zarr 3) and 0.6 (coordinate systems) are read, and 0.1 to 0.3 without lengths.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from renderer.errors import InputError
from renderer.scene import join_some, short_text
from renderer.stores.fields import list_of, mapping_of, mappings_of, number_of, text_of
from renderer.stores.levels import Axis, AxisKind, ImagePlan, LevelPlan, axis_named
from renderer.stores.transformations import matrix_of_all
from renderer.volume import Channel, Float64, Label

# The axes of versions 0.1 and 0.2, which do not name them.
_OLD_AXES = tuple(map(axis_named, "tczyx"))
# The field that is named for a transformation that is not applied.
_OTHER_TYPE = "coordinateTransformations.type"
# The largest number of levels, channels and labels that are read.
_MAX_LEVELS = 32
_MAX_CHANNELS = 1000
_MAX_LABELS = 100_000
# The properties of labels that hold their names, in the order in which they are tried.
_NAMES = ("name", "label-name", "class", "label")
# The largest number of characters of a name.
_MAX_NAME = 60


def ome_attributes(attributes: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return the metadata of OME among the attributes of a group: from version 0.5 on, they have a key of their own."""
    return mapping_of(attributes.get("ome")) or attributes


def is_image(attributes: Mapping[str, Any]) -> bool:
    """Return whether the attributes of a group describe an image of OME."""
    return bool(mappings_of(ome_attributes(attributes).get("multiscales")))


def images_in(attributes: Mapping[str, Any]) -> list[str]:
    """Return the paths of the images in a group that has only other groups: a plate, a well, or a list of labels."""
    ome = ome_attributes(attributes)
    plate, well = mapping_of(ome.get("plate")), mapping_of(ome.get("well"))
    members = (*mappings_of(plate.get("wells")), *mappings_of(well.get("images")))
    found = [text_of(each.get("path")) for each in members]
    return [path for path in (*found, *map(text_of, list_of(ome.get("labels")))) if path]


def plan_of(attributes: Mapping[str, Any], driver: str) -> ImagePlan:
    """Return the image that the attributes of a group describe. driver: the name of the version of Zarr.

    Raises InputError for metadata without axes or levels that can be understood.
    """
    ome = ome_attributes(attributes)
    every = mappings_of(ome.get("multiscales"))
    multiscale = every[0]
    datasets = [each for each in mappings_of(multiscale.get("datasets"))[:_MAX_LEVELS] if text_of(each.get("path"))]
    if not datasets:
        raise InputError("this image of OME has no levels", got="multiscales without datasets")
    axes = _axes(multiscale, datasets[0])
    common, system, unapplied = _common_matrix(multiscale, datasets[0], len(axes))
    levels, missing = [], False
    for each in datasets:
        own = _matrix_of_level(each, len(axes))
        missing |= own is None
        levels.append(LevelPlan(text_of(each["path"]), None if own is None else (common @ own)[: len(axes)]))
    if missing:  # the lengths of a level without its own follow from the other levels, so that none is believed
        levels = [each._replace(world_from_index=None) for each in levels]
        stated = any(list_of(each.get("coordinateTransformations")) for each in datasets)
        unapplied += [_OTHER_TYPE] * stated
    notes = [f"{len(every)} images in one group; the first is read"] * (len(every) > 1)
    notes += [f"placed in its coordinate system {short_text(system)}"] * bool(system)
    channels, more = _channels(mapping_of(ome.get("omero")))
    hidden = [each.name or f"number {number}" for number, each in enumerate(channels) if each.is_hidden]
    if 0 < len(hidden) < len(channels):
        notes.append(f"hidden by the file, and not part of `component: all`: {join_some(hidden)}")
    return ImagePlan(
        driver,
        axes,
        tuple(levels),
        channels,
        _labels(mapping_of(ome.get("image-label"))),
        notes=tuple(notes),
        unapplied=(*unapplied, *more),
    )


def _axes(multiscale: Mapping[str, Any], dataset: Mapping[str, Any]) -> tuple[Axis, ...]:
    """Return the axes of an image: of the coordinate system of its levels, of the image itself, or of old versions."""
    systems = {text_of(each.get("name")): each for each in mappings_of(multiscale.get("coordinateSystems"))}
    if systems:
        name = _end(dataset, "output")
        system = systems.get(name) or list(systems.values())[-1]
        return tuple(map(_axis, list_of(system.get("axes"))))
    axes = list_of(multiscale.get("axes"))
    return tuple(map(_axis, axes)) if axes else _OLD_AXES


def _axis(value: object) -> Axis:
    if isinstance(value, str):  # version 0.3
        return axis_named(value)
    fields = mapping_of(value)
    name, kind = text_of(fields.get("name")), text_of(fields.get("type"))
    known = cast(AxisKind, kind) if kind in ("space", "time", "channel") else axis_named(name).kind if not kind else ""
    orientation = text_of(mapping_of(fields.get("orientation")).get("value"))
    return Axis(name, known, text_of(fields.get("unit")), orientation)


def _end(dataset: Mapping[str, Any], which: str) -> str:
    """Return the name of the coordinate system in which the transformations of a level begin or end."""
    every = mappings_of(dataset.get("coordinateTransformations"))
    return _system(every[-1 if which == "output" else 0].get(which)) if every else ""


def _system(value: object) -> str:
    return text_of(value) or text_of(mapping_of(value).get("name"))


def _common_matrix(
    multiscale: Mapping[str, Any], dataset: Mapping[str, Any], count: int
) -> tuple[Float64, str, list[str]]:
    """Return the matrix of all levels, the name of the coordinate system in which it ends, and unapplied fields.

    Up to version 0.5, it is the product of all transformations of the image. In 0.6, these lead from the coordinate
    system of the levels to others: the only one that begins there is applied.
    """
    every = mappings_of(multiscale.get("coordinateTransformations"))
    if not every:
        return np.eye(count + 1), "", []
    system = ""
    if mappings_of(multiscale.get("coordinateSystems")):
        own = _end(dataset, "output")
        chosen = [each for each in every if _system(each.get("input")) == own]
        every, system = chosen, _system(chosen[0].get("output")) if chosen else ""
        if len(every) != 1:
            return np.eye(count + 1), "", [_OTHER_TYPE]
    matrix = matrix_of_all(every, count)
    return (np.eye(count + 1), "", [_OTHER_TYPE]) if matrix is None else (matrix, system, [])


def _matrix_of_level(dataset: Mapping[str, Any], count: int) -> Float64 | None:
    every = mappings_of(dataset.get("coordinateTransformations"))
    return matrix_of_all(every, count) if every else None


def _channels(omero: Mapping[str, Any]) -> tuple[tuple[Channel, ...], list[str]]:
    """Return the channels that OMERO's settings describe, and the settings that are not applied."""
    every, found, unapplied = mappings_of(omero.get("channels"))[:_MAX_CHANNELS], [], []
    for each in every:
        window = mapping_of(each.get("window"))
        low, high = number_of(window.get("start")), number_of(window.get("end"))
        name = " ".join(text_of(each.get("label")).split())[:_MAX_NAME]
        own = (low, high) if low < high else None
        is_hidden = each.get("active", True) is False
        found.append(Channel(short_text(name), _color(each.get("color")), own, is_hidden=is_hidden))
        unapplied += ["omero.channels.inverted"] * (each.get("inverted") is True)
    return tuple(found), list(dict.fromkeys(unapplied))


def _color(value: object) -> tuple[float, float, float] | None:
    """Return a colour in OMERO's hexadecimal digits, `RRGGBB`; None for any other text."""
    text = text_of(value).removeprefix("#")
    try:
        red, green, blue = bytes.fromhex(text)
    except ValueError:
        return None
    return red / 255, green / 255, blue / 255


def _labels(image_label: Mapping[str, Any]) -> tuple[Label, ...]:
    """Return the labels that the metadata of an image of labels describe, ascending by value; 0 is no label."""
    found: dict[int, Label] = {}
    for each in mappings_of(image_label.get("colors"))[:_MAX_LABELS]:
        value, parts = number_of(each.get("label-value")), list_of(each.get("rgba"))
        shade = [number_of(part) / 255 for part in parts]
        if value.is_integer() and len(shade) in (3, 4) and all(0 <= part <= 1 for part in shade):
            opacity = shade[3] if len(shade) == 4 else None
            found[int(value)] = Label(int(value), "", (shade[0], shade[1], shade[2]), opacity)
    for each in mappings_of(image_label.get("properties"))[:_MAX_LABELS]:
        value, names = number_of(each.get("label-value")), (text_of(each.get(key)) for key in _NAMES)
        name = next(filter(None, names), "")
        if value.is_integer() and name:
            found[int(value)] = replace(found.get(int(value), Label(int(value))), name=name[:_MAX_NAME])
    return tuple(found[value] for value in sorted(found) if value > 0)
