"""Choose what a scene leaves open of its labels: which are shown, and their numbers, names, colours and opacities."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

from renderer.errors import Problem
from renderer.readers import ReadVolume
from renderer.scene import FilmScene, LabelKey, LabelsSpec, LayerSpec, MaskSpec, OverFrames, VolumeSpec, format_value
from renderer.statistics import KnownLabels, read_labels
from renderer.suggest import colors_by_label, labels_with_looks

T = TypeVar("T")
Problems = list[Problem]


def with_labels(layer: LayerSpec, place: str, read: ReadVolume, problems: Problems) -> LayerSpec:
    """Return a layer in which each label that is shown has a number, a colour and a name.

    place: the position of the layer's labels in the scene. read: reads the voxels of a volume whose labels are not
    known yet. problems: a list to which this adds a problem for each label that no voxel has. Raises InputError for
    volumes that are no labels, and tables that cannot be read.
    """
    look, labels = layer.transfer_function, layer.transfer_function.labels
    if labels is None or labels.has_colors:
        return layer
    known = read_labels(OverFrames(layer.volume), read, labels)
    return replace(layer, transfer_function=replace(look, mapping=choose_labels(labels, known, place, problems)))


def with_numbers(mask: MaskSpec | None, place: str, read: ReadVolume, problems: Problems) -> MaskSpec | None:
    """Return a mask in which each label that is shown has a number.

    place: the position of the mask in the scene. problems: a list to which this adds a problem for each label that no
    voxel has. Raises InputError for volumes that are no labels, and tables that cannot be read.
    """
    if mask is None or mask.labels.has_numbers or not isinstance(mask.volume, VolumeSpec):
        return mask
    known = read_labels(OverFrames(mask.volume), read, mask.labels)
    return replace(mask, labels=LabelsSpec(show=choose_labels(mask.labels, known, place, problems).show))


def label_problems(scene: FilmScene, read: ReadVolume) -> Problems:
    """Return a problem for each label that a scene names, but that neither its volume nor the volume's table has.

    All steps in time of a volume are read, but only if the scene names labels of the volume. Raises InputError for
    volumes that are no labels, and tables that cannot be read.
    """
    problems, choices = Problems(), dict[str, tuple[OverFrames[VolumeSpec], LabelsSpec]]()
    for number, layer in enumerate(scene.at(0).layers):
        over_frames = scene.film_layers[number]
        if (labels := layer.transfer_function.labels) is not None:
            choices[scene.layer_key(number, "labels")] = over_frames.map(lambda each: each.volume), labels
        if (mask := layer.mask) is not None and isinstance(mask.volume, VolumeSpec):
            choices[scene.layer_key(number, "mask")] = over_frames.map(_mask_volume), mask.labels
    for place, (volume, labels) in choices.items():
        if labels.show or labels.hide or isinstance(labels.colors, tuple) or isinstance(labels.opacity, tuple):
            choose_labels(labels, read_labels(volume, read, labels), place, problems)
    return problems


def _mask_volume(layer: LayerSpec) -> VolumeSpec:
    assert layer.mask is not None and isinstance(layer.mask.volume, VolumeSpec)
    return layer.mask.volume


def choose_labels(spec: LabelsSpec, known: KnownLabels, place: str, problems: Problems) -> LabelsSpec:
    """Return the labels that are shown, with their numbers, colours, opacities and names.

    spec: the labels as the scene states them. known: the labels of the volume. place: the position of the labels in the
    scene. problems: a list to which this adds a problem for each label that no voxel has.
    """

    def values_of(key: LabelKey, path: str) -> Iterator[int]:
        values = known.find(key)
        if not values:
            what, expected = "no such label in the volume", "the number or the name of one of its labels"
            problems.append(Problem(f"{place}.{path}", what, format_value(key), expected, known.hint(key)))
        yield from values

    def by_value(pairs: Iterable[tuple[LabelKey, T]], path: str) -> dict[int, T]:
        return {value: item for key, item in pairs for value in values_of(key, f"{path}.{key}")}

    def in_list(keys: Sequence[LabelKey], path: str) -> list[int]:
        return [value for number, key in enumerate(keys) for value in values_of(key, f"{path}.{number}")]

    rest = [value for value in known.present if value]
    hidden = {*in_list(spec.hide, "hide")}
    asked = {*(rest if spec.show is None else in_list(spec.show, "show"))} - hidden
    if isinstance(spec.opacity, tuple):
        opacities = by_value(spec.opacity, "opacity")
    elif spec.opacity is None:
        opacities = {value: label.opacity for value, label in known.table.items() if label.opacity is not None}
    else:
        opacities = dict.fromkeys(known.present, spec.opacity)
    colors = colors_by_label(rest)
    if spec.colors != "auto":
        colors |= {value: label.color for value, label in known.table.items() if label.color is not None}
    if isinstance(spec.colors, tuple):
        colors |= by_value(spec.colors, "colors")
    shown = [value for value in known.present if value in asked and opacities.get(value, 1.0) > 0]
    if not shown and not problems:
        what = "no label is shown" if rest else "no voxel has a label: all are 0"
        expected = f"some of {format_value(rest)}, with opacities above 0" if rest else "labels other than 0"
        problems.append(Problem(place, what, expected=expected))
    if spec.colors == "table" and (missing := [value for value in shown if value not in known.table]):
        what, expected = "the table has no such label", "a table with all labels that are shown"
        problems.append(Problem(f"{place}.colors", what, format_value(missing), expected))
    return labels_with_looks({value: opacities.get(value, 1.0) for value in shown}, colors, known.names)
