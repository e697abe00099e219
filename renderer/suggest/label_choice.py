"""Write out what a scene leaves to its volumes of labels: which labels there are, and their names and colours."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np

from renderer.errors import InputError, Problem, closest_match
from renderer.looks import find_label_table, read_label_table
from renderer.scene import (
    MAX_LABEL,
    MAX_LABELS,
    Color,
    FileSource,
    FilmScene,
    LabelKey,
    LabelsSpec,
    LayerSpec,
    MaskSpec,
    OverFrames,
    VolumeSpec,
    colormap_points,
    format_value,
    steps_in_time,
)
from renderer.suggest.channels import ReadVolume
from renderer.suggest.palette import distinct_colors, in_8_bits
from renderer.volume import Label, Volume, iter_slabs

_PALETTE: tuple[Color, ...] = (
    (0.90, 0.47, 0.29),
    (0.29, 0.56, 0.85),
    (0.91, 0.77, 0.28),
    (0.37, 0.71, 0.42),
    (0.69, 0.42, 0.78),
    (0.31, 0.77, 0.77),
    (0.85, 0.34, 0.48),
    (0.60, 0.66, 0.29),
    (0.54, 0.48, 0.85),
    (0.79, 0.60, 0.42),
)
# Up to this many labels have colours that are as different as possible; more take those of a colormap in turn.
_MAX_DISTINCT_COLORS, _MANY_LABELS_COLORMAP = 255, "glasbey"

Problems = list[Problem]


@dataclass(frozen=True)
class KnownLabels:
    """A record of what is known of the labels of a volume.

    present: the values of those that it has, ascending. table: what its file, or a table, says of labels, by value.
    """

    present: Collection[int]
    table: dict[int, Label]

    @cached_property
    def names(self) -> dict[int, str]:
        """Return the names of labels that have one."""
        return {value: label.name for value, label in self.table.items() if label.name}

    def find(self, key: LabelKey) -> list[int]:
        """Return the values of a label that is in the volume or in the table; of a name several may be."""
        if isinstance(key, int):
            return [key] * (key in self.present or key in self.table)
        return [value for value, name in self.names.items() if name == key]

    def hint(self, key: LabelKey) -> str | None:
        """Return a hint with the label that is most like one that is not known."""
        if isinstance(key, str):
            close = closest_match(key, self.names.values())
            return f"did you mean {close}?" if close else None if self.names else "its labels have no names"
        return f"the nearest is {min(self.present, key=lambda value: abs(value - key))}"


NO_LABELS = KnownLabels((), {})


def with_labels(layer: LayerSpec, place: str, read: ReadVolume, problems: Problems) -> LayerSpec:
    """Return a layer in which all labels that are shown have their number, colour and name.

    place: of the layer in the scene. read: reads the voxels of volumes whose labels are not known yet. problems: to
    which labels that are not there are added. Raises InputError for volumes that are no labels, and tables that cannot
    be read.
    """
    look, labels = layer.transfer_function, layer.transfer_function.labels
    if labels is not None and not labels.has_colors:
        known = known_labels(OverFrames(layer.volume), read, labels)
        look = replace(look, mapping=choose_labels(labels, known, f"{place}labels", problems))
    return replace(layer, transfer_function=look, mask=with_numbers(layer.mask, f"{place}mask", read, problems))


def with_numbers(mask: MaskSpec | None, place: str, read: ReadVolume, problems: Problems) -> MaskSpec | None:
    """Return a mask in which all labels that are shown have their number; as `with_labels`."""
    if mask is None or mask.labels.has_numbers or not isinstance(mask.volume, VolumeSpec):
        return mask
    known = known_labels(OverFrames(mask.volume), read, mask.labels)
    return replace(mask, labels=LabelsSpec(show=choose_labels(mask.labels, known, place, problems).show))


def label_problems(scene: FilmScene, read: ReadVolume) -> Problems:
    """Return the labels that a scene names and no step of their volume, nor its table, has.

    Only volumes of which some are named are read. Raises InputError as `known_labels`.
    """
    problems, choices = Problems(), dict[str, tuple[OverFrames[VolumeSpec], LabelsSpec]]()
    first = scene.at(0)
    for number, layer in enumerate(first.layers):
        place = f"volumes.{number}." if scene.has_list else ""
        over_frames = scene.film_layers[number]
        if (labels := layer.transfer_function.labels) is not None:
            choices[f"{place}labels"] = over_frames.map(lambda each: each.volume), labels
        if (mask := layer.mask) is not None and isinstance(mask.volume, VolumeSpec):
            place = "mask" if mask == first.mask else f"{place}mask"
            choices[place] = over_frames.map(_mask_volume), mask.labels
    for place, (volume, labels) in choices.items():
        if labels.show or labels.hide or isinstance(labels.colors, tuple) or isinstance(labels.opacity, tuple):
            choose_labels(labels, known_labels(volume, read, labels), place, problems)
    return problems


def _mask_volume(layer: LayerSpec) -> VolumeSpec:
    assert layer.mask is not None and isinstance(layer.mask.volume, VolumeSpec)
    return layer.mask.volume


def known_labels(volume: OverFrames[VolumeSpec], read: ReadVolume, labels: LabelsSpec) -> KnownLabels:
    """Return what is known of the labels of a volume, which are the values of any of its steps in time.

    labels: whose names go before those of a table. Raises InputError for a volume that is no labels.
    """
    known = labels_of(steps_in_time(volume), read)
    table = known.table
    if isinstance(labels.names, Path):
        table = {label.value: label for label in read_label_table(labels.names)}
    elif isinstance(labels.names, tuple):
        table = table | {value: replace(table.get(value, Label(value)), name=name) for value, name in labels.names}
    return replace(known, table=table)


def labels_of(steps: Sequence[VolumeSpec], read: ReadVolume) -> KnownLabels:
    """Return the labels of the steps of a volume; of two steps that describe a label, the first one counts.

    Raises InputError for volumes that are no labels, and tables that cannot be read.
    """
    present, table = set[int](), dict[int, Label]()
    for step in steps:
        volume = read(step)
        present.update(count_labels(volume))
        for label in table_of(step, volume):
            table.setdefault(label.value, label)
    return KnownLabels(sorted(present), table)


def table_of(spec: VolumeSpec, volume: Volume) -> Sequence[Label]:
    """Return what the file of a volume, or a table beside it, says of its labels."""
    source = spec.source
    if volume.labels or not isinstance(source, FileSource):
        return volume.labels
    file = source.steps[spec.time] if source.steps and isinstance(spec.time, int) else source.file
    beside = find_label_table(file)
    return () if beside is None else read_label_table(beside)


def count_labels(volume: Volume) -> dict[int, int]:
    """Return the number of voxels of each label, ascending by value.

    Raises InputError for values that are no whole numbers, larger ones than MAX_LABEL, and more than MAX_LABELS.
    """
    found: dict[int, int] = {}
    start = 0
    for slab in iter_slabs(volume.values, volume.source):
        values, counts = np.unique(slab[~np.isnan(slab)] if volume.num_absent else slab, return_counts=True)
        is_whole = values == np.trunc(values)
        if not is_whole.all():
            value = values[~is_whole][0]
            z, y, x = np.argwhere(slab == value)[0].tolist()
            raise InputError(
                "this volume is no map of labels", where=volume.name,
                got=f"{float(value):.6g} in the voxel {[x, y, z + start]}", expected="whole numbers",
                hint="a transfer_function shows values that are measured",
            )  # fmt: skip
        if (large := max(values.tolist(), key=abs, default=0)) and abs(large) > MAX_LABEL:
            expected = "whole numbers from -2^63 + 1 to 2^63 - 1"
            raise InputError("a label is too large", where=volume.name, got=f"{large:.6g}", expected=expected)
        for label, count in zip(values.tolist(), counts.tolist(), strict=True):
            found[int(label)] = found.get(int(label), 0) + count
        if len(found) > MAX_LABELS:
            raise InputError("too many labels", where=volume.name, expected=f"at most {MAX_LABELS}")
        start += len(slab)
    return dict(sorted(found.items()))


def choose_labels(spec: LabelsSpec, known: KnownLabels, place: str, problems: Problems) -> LabelsSpec:
    """Return the labels that are shown with their numbers, colours, opacities and names.

    place: of the labels in the scene. problems: to which those of labels that are not there are added.
    """

    def values_of(key: LabelKey, path: str) -> Iterator[int]:
        values = known.find(key)
        if not values:
            what, expected = "no such label in the volume", "the number or the name of one of its labels"
            problems.append(Problem(f"{place}.{path}", what, format_value(key), expected, known.hint(key)))
        yield from values

    def by_value(pairs: Any, path: str) -> dict[int, Any]:
        given = pairs if isinstance(pairs, tuple) else ()
        return {value: item for key, item in given for value in values_of(key, f"{path}.{key}")}

    def in_list(keys: Sequence[LabelKey], path: str) -> list[int]:
        return [value for number, key in enumerate(keys) for value in values_of(key, f"{path}.{number}")]

    rest = [value for value in known.present if value]
    hidden = {*in_list(spec.hide, "hide")}
    asked = {*(rest if spec.show is None else in_list(spec.show, "show"))} - hidden
    opacities = by_value(spec.opacity, "opacity")
    colors: dict[int, Color] = dict(zip(rest, label_colors(len(rest)), strict=True)) | {0: (1.0, 1.0, 1.0)}
    if spec.colors != "auto":
        colors |= {value: label.color for value, label in known.table.items() if label.color is not None}
    if isinstance(spec.opacity, float):
        opacities = dict.fromkeys(known.present, spec.opacity)
    elif spec.opacity is None:
        opacities = {value: label.opacity for value, label in known.table.items() if label.opacity is not None}
    colors |= by_value(spec.colors, "colors")
    shown = [value for value in known.present if value in asked and opacities.get(value, 1.0) > 0]
    if not shown and not problems:
        what = "no label is shown" if rest else "no voxel has a label: all are 0"
        expected = f"some of {format_value(rest)}, with opacities above 0" if rest else "labels other than 0"
        problems.append(Problem(place, what, expected=expected))
    if spec.colors == "table" and (missing := [value for value in shown if value not in known.table]):
        what, expected = "the table has no such label", "a table with all labels that are shown"
        problems.append(Problem(f"{place}.colors", what, format_value(missing), expected))
    found = {value: opacities.get(value, 1.0) for value in shown}
    names = tuple((value, known.names[value]) for value in shown if value in known.names)
    return LabelsSpec(
        colors=tuple((value, colors[value]) for value in shown),
        opacity=next(iter(found.values())) if len(set(found.values())) == 1 else tuple(found.items()),
        show=tuple(shown),
        names=names or None,
    )


@cache
def label_colors(num: int) -> tuple[Color, ...]:
    """Return colours for this many labels, which differ as much as possible."""
    if num <= _MAX_DISTINCT_COLORS:
        return tuple(map(in_8_bits, distinct_colors(_PALETTE, num)))
    colors = colormap_points(_MANY_LABELS_COLORMAP, _MAX_DISTINCT_COLORS + 1)
    return tuple(in_8_bits(colors[number % len(colors)]) for number in range(num))
