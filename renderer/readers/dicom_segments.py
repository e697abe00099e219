"""Read the segments of a DICOM segmentation: as labels with their names and colours, or as parts of voxels.

Binary segments become one volume of labels, as maps of labels are. Where segments overlap, the one with the fewest
voxels is shown: a part inside of a whole stays visible. Fractional segments are a component each, from 0 to 1, unless
all of their voxels are whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from renderer.looks import LookFile, make_labels, rgb_from_lab
from renderer.readers.common import labels_or_note
from renderer.readers.dicom_fields import SEGMENT, Dataset, numbers_of, open_dicom, text_of
from renderer.readers.dicom_frames import Frame
from renderer.readers.dicom_pixels import pixels_of
from renderer.readers.isolation import Host, allocate_voxels
from renderer.scene import counted
from renderer.volume import Array, Channel, Label

# CIELAB in 16 bits (PS3.3, C.10.7.1.1): 0 to 65535 is a lightness from 0 to 100, and a and b from -128 to 127.
_LAB_MAXIMUM = 65535.0


class Segments(NamedTuple):
    """What a file says of its segments.

    labels: by number. note: on labels that are wrong; None if none are. kind: BINARY, FRACTIONAL or LABELMAP.
    background: the stored value of a map of labels that is none.
    """

    labels: tuple[Label, ...]
    note: str | None
    kind: str
    background: int


def segments_of(path: Path) -> Segments | None:
    """Return the segments of a file; None if it is no segmentation."""
    dataset = open_dicom(path)[0]
    items = dataset.get("SegmentSequence")
    if not items:
        return None
    file = LookFile(path, b"", "segments of DICOM")
    rows = [(f"segment {k + 1}", *_row(item, dataset)) for k, item in enumerate(items)]
    labels, note = labels_or_note(lambda: make_labels(file, rows, 1.0))
    background = next(iter(numbers_of([dataset], "PixelPaddingValue")), 0.0)
    return Segments(labels, note, text_of([dataset], "SegmentationType").strip() or "BINARY", int(background))


def _row(item: Dataset, dataset: Dataset) -> list[object]:
    """Return the number of a segment, its name, and its colour, if it has one, in [0, 1]."""
    number = text_of([item], "SegmentNumber")
    lab = numbers_of([item], "RecommendedDisplayCIELabValue")
    color: tuple[float, ...] = ()
    if len(lab) == 3 and min(lab) >= 0 and max(lab) <= _LAB_MAXIMUM:
        lightness, a, b = (part / _LAB_MAXIMUM for part in lab)
        color = rgb_from_lab((100.0 * lightness, 255.0 * a - 128.0, 255.0 * b - 128.0))
    return [number, text_of([item], "SegmentLabel"), *color]


def are_whole(path: Path, segments: Segments) -> bool:
    """Return whether no voxel is a part of a segment: stored values are 0 and the largest one."""
    if segments.kind != "FRACTIONAL":
        return True
    maximum = numbers_of([open_dicom(path)[0]], "MaximumFractionalValue")
    return bool(maximum) and set(np.unique(pixels_of(path)).tolist()) <= {0, int(maximum[0])}


def fit_together(volumes: Sequence[Sequence[Frame]]) -> bool:
    """Return whether volumes of segments have the same places."""
    first = [frame.position for frame in volumes[0]]
    return all(
        len(volume) == len(first) and np.allclose([frame.position for frame in volume], first, rtol=0, atol=1e-3)
        for volume in volumes
    )


def join_segments(volumes: Sequence[Sequence[Frame]], host: Host) -> tuple[Array, str | None]:
    """Return the numbers of the segments [z, y, x], and a note if some overlap. volumes: of one segment each."""
    numbers = [number_of(volume) for volume in volumes]
    path = volumes[0][0].file
    host.begin_file(path)
    pixels = pixels_of(path)
    sizes = [sum(np.count_nonzero(frame.stored(pixels, 0)) for frame in _filled(volume)) for volume in volumes]
    order = sorted(range(len(volumes)), key=lambda k: (-sizes[k], k))
    shape = (len(volumes[0]), *volumes[0][0].size[::-1])
    values = allocate_voxels(host, shape, np.min_scalar_type(max(numbers)))
    num_shared = 0
    for z, plane in enumerate(values):
        nums = np.zeros(plane.shape, np.uint16)
        for k in order:
            frame = volumes[k][z]
            if frame.number is not None:
                inside = frame.stored(pixels, 0) > 0
                plane[inside] = numbers[k]
                nums += inside
        num_shared += np.count_nonzero(nums > 1)
    if not num_shared:
        return values, None
    shared = counted(num_shared, "voxel")
    return values, f"segments overlap: of {shared} the smallest segment is shown; `component: k` shows one alone"


def number_of(volume: Sequence[Frame]) -> int:
    """Return the number of the segment that a volume is of; 1 where it is not said."""
    numbers = volume[0].marks.get(SEGMENT, ([1.0], ""))[0]
    return max(1, int(numbers[0])) if numbers else 1


def channels_of(volumes: Sequence[Sequence[Frame]], labels: Sequence[Label], *, are_light: bool) -> tuple[Channel, ...]:
    """Return a channel for each segment, with its name and colour."""
    by_number = {label.value: label for label in labels}
    found = (by_number.get(number_of(volume), Label(number_of(volume))) for volume in volumes)
    return tuple(Channel(label.name, label.color, None, are_light) for label in found)


def _filled(volume: Sequence[Frame]) -> list[Frame]:
    return [frame for frame in volume if frame.number is not None]
