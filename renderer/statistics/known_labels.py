"""Find the labels of a volume: the values of its voxels, with names and colours from its files."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from renderer.errors import InputError, closest_match
from renderer.looks import find_label_table, read_label_table
from renderer.readers import ReadVolume
from renderer.scene import (
    MAX_LABEL,
    MAX_LABELS,
    FileSource,
    LabelKey,
    LabelsSpec,
    OverFrames,
    VolumeSpec,
    steps_in_time,
)
from renderer.volume import Label, Volume, iter_slabs, kept_numbers


@dataclass(frozen=True)
class KnownLabels:
    """The known labels of a volume, with their names, colours and opacities.

    present: the labels that voxels of the volume have, ascending.
    table: names, colours and opacities by label, from the volume's file or from a table of labels.
    """

    present: Collection[int]
    table: dict[int, Label]

    @cached_property
    def names(self) -> dict[int, str]:
        """Return the names of all labels that have a name."""
        return {value: label.name for value, label in self.table.items() if label.name}

    def find(self, key: LabelKey) -> list[int]:
        """Return the known labels with this number or name; several labels may share a name."""
        if isinstance(key, int):
            return [key] * (key in self.present or key in self.table)
        return [value for value, name in self.names.items() if name == key]

    def hint(self, key: LabelKey) -> str | None:
        """Return a hint that names the known label most similar to an unknown one."""
        if isinstance(key, str):
            close = closest_match(key, self.names.values())
            return f"did you mean {close}?" if close else None if self.names else "its labels have no names"
        return f"the nearest is {min(self.present, key=lambda value: abs(value - key))}"


# The labels of a volume that has none, or whose labels have not been read.
NO_LABELS = KnownLabels((), {})


def read_labels(volume: OverFrames[VolumeSpec], read: ReadVolume, labels: LabelsSpec) -> KnownLabels:
    """Return the labels of a volume: all values that voxels have at any step in time.

    labels: the labels of the scene, whose names take precedence over the names of a table. Raises InputError for a
    volume whose values are no labels, and for a table that cannot be read.
    """
    known = _labels_of(steps_in_time(volume), read)
    table = known.table
    if isinstance(labels.names, Path):
        table = {label.value: label for label in read_label_table(labels.names)}
    elif isinstance(labels.names, tuple):
        table = table | {value: replace(table.get(value, Label(value)), name=name) for value, name in labels.names}
    return replace(known, table=table)


def _labels_of(steps: Sequence[VolumeSpec], read: ReadVolume) -> KnownLabels:
    """Return the labels of all steps in time of a volume.

    If the tables of two steps describe a label, the first step's description counts. Raises InputError for volumes that
    are no labels, and tables that cannot be read.
    """
    present, table = set[int](), dict[int, Label]()
    for step in steps:
        volume = read(step)
        present.update(count_labels(volume))
        for label in label_table_of(step, volume):
            table.setdefault(label.value, label)
    return KnownLabels(sorted(present), table)


def label_table_of(spec: VolumeSpec, volume: Volume) -> Sequence[Label]:
    """Return the table of labels in the file of a volume, or in a file beside it; empty without such a table."""
    source = spec.source
    if volume.labels or not isinstance(source, FileSource):
        return volume.labels
    file = source.steps[spec.time] if source.steps and isinstance(spec.time, int) else source.file
    beside = find_label_table(file)
    return () if beside is None else read_label_table(beside)


def count_labels(volume: Volume) -> dict[int, int]:
    """Return the number of voxels of each label, ascending by value.

    Raises InputError for values that are no whole numbers, for values whose magnitude exceeds MAX_LABEL, and for more
    than MAX_LABELS labels.
    """
    return dict(kept_numbers("labels", volume.values, volume.source, lambda: [*_count_labels(volume).items()]))


def _count_labels(volume: Volume) -> dict[int, int]:
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
