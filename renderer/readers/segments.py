"""Join the segments of a segmentation, which may overlap, into one volume of labels; and read 3D Slicer's segments.

Where segments overlap, a voxel belongs to the segment with the fewest voxels. So a segment inside of another one stays
visible, and so does the outer one around it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from renderer.looks import LookFile, make_labels
from renderer.readers.voxel_limits import check_memory
from renderer.scene import counted, join_some, short_text
from renderer.volume import Array, Int64, Label

# The largest value that a segment may have in its layer. It limits the memory of the table from values to segments.
_MAX_VALUE = 2**16 - 1


class Segment(NamedTuple):
    """A segment: the number of its layer, its value in the layer, and its label in the joined volume.

    value: None for a segment that has all voxels of its layer that are not 0.
    """

    layer: int
    value: int | None
    label: Label


def segments_of_slicer(path: Path, texts: Mapping[str, str], num_layers: int) -> tuple[Segment, ...]:
    """Return the segments of 3D Slicer, in ascending order of their labels.

    texts: the texts of the header, by keys such as `Segment0_Name`. In older files, a segment has neither a layer nor a
    value, and its own number is the number of its layer. Labels are the values of the file unless two segments share a
    value.
    """
    file = LookFile(path, b"", "segments of 3D Slicer")
    names = sorted({key.partition("_")[0] for key in texts}, key=lambda name: int(name.removeprefix("Segment")))
    places = list[tuple[int, int | None]]()
    for name in names:
        layer = texts.get(f"{name}_Layer", name.removeprefix("Segment") if num_layers > 1 else "0")
        value = texts.get(f"{name}_LabelValue")
        own = None if value is None else int(file.number(value, name, 1, _MAX_VALUE))
        place = int(file.number(layer, name, 0, num_layers - 1)), own
        if place in places:
            raise file.error("a label twice", name, got=own, expected="a value of its own in its layer")
        places.append(place)
    values = [value for _, value in places if value is not None]
    numbers = values if len({*values}) == len(places) else range(1, len(places) + 1)
    rows = [
        (name, number, texts.get(f"{name}_Name", ""), *texts.get(f"{name}_Color", "").split())
        for name, number in zip(names, numbers, strict=True)
    ]
    by_number = dict(zip(numbers, places, strict=True))
    labels = make_labels(file, rows, 1.0) if rows else ()
    return tuple(Segment(*by_number[label.value], label) for label in labels)


def labels_of_layer(segments: Sequence[Segment], layer: int) -> tuple[tuple[Label, ...], str | None]:
    """Return the labels of one layer with their stored values, and a note that names the segments in other layers."""
    own = (replace(each.label, value=each.value or 1) for each in segments if each.layer == layer)
    others = [_name(each) for each in segments if each.layer != layer]
    note = f"segments in other layers are left out: {join_some(others)}" if others else None
    return tuple(sorted(own, key=lambda label: label.value)), note


def join_layers(layers: Array, segments: Sequence[Segment]) -> tuple[Array, str]:
    """Return a volume with the labels of all segments, [z, y, x], and a note on the joining.

    layers: [layer, z, y, x]. segments: at least one, each with its own layer and value. Raises InputError for lack of
    memory.
    """
    labels = [each.label.value for each in segments]
    dtype = type_of_labels(labels)
    check_memory(layers[0].size * (dtype.itemsize + 1))
    tables = [_table(segments, layer) for layer in range(len(layers))]

    def planes() -> Iterator[tuple[int, Int64]]:
        for z in range(layers.shape[1]):
            yield from ((z, _look_up(table, layer)) for table, layer in zip(tables, layers[:, z], strict=True))

    joined = np.zeros(layers.shape[1:], dtype)
    overlap = join_segments(planes, labels, joined)
    num_other = sum(int(np.count_nonzero((plane == 0) & layers[:, z].any(axis=0))) for z, plane in enumerate(joined))
    return joined, _note(segments, len(layers), overlap, num_other)


def type_of_labels(labels: Sequence[int]) -> np.dtype[Any]:
    """Return the smallest integer type that holds these labels, and also their numbers from 1 on."""
    return np.min_scalar_type(max(*labels, len(labels)))


def join_segments(planes: Callable[[], Iterable[tuple[int, Int64]]], labels: Sequence[int], joined: Array) -> str:
    """Fill a volume of zeros with the label of the smallest segment at each voxel, and return a clause on overlaps.

    planes: a function that yields planes in any order, the same ones at each call. A plane is its z and the numbers of
    segments from 1 on, [y, x], with 0 for no segment. labels: the labels of the segments. joined: the volume [z, y, x],
    of the type of `type_of_labels`. The clause, of a note, is empty without overlaps.
    """
    counts = np.zeros(len(labels) + 1, np.int64)
    for _, numbers in planes():
        counts += np.bincount(numbers.ravel(), minlength=len(counts))
    ranks = np.zeros(len(counts), np.int64)  # 0 for no segment; the smallest segment has the largest rank
    ranks[1 + np.argsort(-counts[1:], kind="stable")] = np.arange(1, len(counts))
    are_shared = np.zeros(joined.shape, np.bool_)
    for z, numbers in planes():
        found = ranks[numbers]
        are_shared[z] |= (found > 0) & (joined[z] > 0)
        joined[z] = np.maximum(joined[z], found)
    label_from_rank = np.zeros(len(counts), joined.dtype)
    label_from_rank[ranks[1:]] = labels
    for plane in joined:
        plane[...] = label_from_rank[plane]
    return overlap_clause(are_shared, "segments")


def overlap_clause(are_shared: Array, what: str) -> str:
    """Return the clause of a note on voxels that are in several segments; empty if there are none.

    are_shared: which voxels are, bool [z, y, x]. what: the word for the segments.
    """
    num = int(np.count_nonzero(are_shared))
    return (
        f"{counted(num, 'voxel')} in several {what} {'belongs' if num == 1 else 'belong'} to the smallest of them"
        * (num > 0)
    )


def _table(segments: Sequence[Segment], layer: int) -> Int64:
    """Return the number of the segment, from 1 on, that each value of a layer stands for; 0 for no segment.

    The last entry is for all larger values.
    """
    own = [(number, each.value) for number, each in enumerate(segments, 1) if each.layer == layer]
    table = np.zeros(2 + max((value or 0 for _, value in own), default=0), np.int64)
    for number, value in own:
        if value is None:
            table[1:] = number
        else:
            table[value] = number
    return table


def _look_up(table: Int64, values: Array) -> Int64:
    return np.asarray(table[np.clip(np.nan_to_num(values), 0, len(table) - 1).astype(np.int64)])


def _note(segments: Sequence[Segment], num_layers: int, overlap: str, num_other: int) -> str:
    note = f"{counted(len(segments), 'segment')} in {counted(num_layers, 'layer')} are one volume of labels"
    if any(each.label.value != each.value for each in segments if each.value is not None):
        note += ", numbered anew"
    if overlap:
        note += f"; {overlap}"
    if num_other:
        note += f"; {counted(num_other, 'voxel')} in no segment are left out"
    return f"{note}; `component: k` draws one layer"


def _name(segment: Segment) -> str:
    return short_text(segment.label.name) if segment.label.name else f"label {segment.value or 1}"
