"""Read the segments of a DICOM segmentation, as labels with names and colours, or as fractions of voxels.

Binary segments become one volume of labels; a labelmap is a volume of labels already. Each fractional segment is a
component with values from 0 to 1, unless it has no other values than 0 and 1.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from renderer.looks import LookFile, make_labels, rgb_from_lab
from renderer.readers.dicom_fields import Dataset, numbers_of, open_dicom, text_of
from renderer.readers.dicom_frames import Frame
from renderer.readers.dicom_pixels import stored_frames
from renderer.readers.file_errors import labels_or_note
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.segments import join_segments, type_of_labels
from renderer.volume import Array, Channel, Int64, Label

# The largest number of a CIELAB colour in 16 bits. It stands for a lightness of 100, and for a and b of 127; 0 stands
# for a lightness of 0, and for a and b of -128 (PS3.3, C.10.7.1.1).
_LAB_MAXIMUM = 65535.0


class Segments(NamedTuple):
    """The segments that a DICOM segmentation describes.

    labels: the names and colours of the segments. note: a remark on descriptions that cannot be read, or None. kind:
    BINARY, FRACTIONAL or LABELMAP. background: the stored value of voxels outside of all segments, in a labelmap.
    """

    labels: tuple[Label, ...]
    note: str | None
    kind: str
    background: int


def segments_of(path: Path) -> Segments | None:
    """Return the segments of a file; None if it is not a segmentation."""
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
    """Return the number of a segment, its name, and, if it has a colour, red, green and blue in [0, 1]."""
    number = text_of([item], "SegmentNumber")
    lab = numbers_of([item], "RecommendedDisplayCIELabValue")
    color: tuple[float, ...] = ()
    if len(lab) == 3 and min(lab) >= 0 and max(lab) <= _LAB_MAXIMUM:
        lightness, a, b = (part / _LAB_MAXIMUM for part in lab)
        color = rgb_from_lab((100.0 * lightness, 255.0 * a - 128.0, 255.0 * b - 128.0))
    return [number, text_of([item], "SegmentLabel"), *color]


def are_whole(frames: Sequence[Frame], segments: Segments) -> bool:
    """Return whether each voxel is entirely inside or outside of a segment: stored values are 0 or the maximum."""
    if segments.kind != "FRACTIONAL":
        return True
    path, numbers = frames[0].file, [frame.number for frame in frames if frame.number is not None]
    maximum = numbers_of([open_dicom(path)[0]], "MaximumFractionalValue")
    return bool(maximum) and all(
        bool(np.isin(stored, (0, maximum[0])).all()) for _, stored in stored_frames(path, sorted(numbers))
    )


def fit_together(volumes: Sequence[Sequence[Frame]]) -> bool:
    """Return whether volumes of segments have slices at the same places."""
    first = [frame.position for frame in volumes[0]]
    return all(
        len(volume) == len(first) and np.allclose([frame.position for frame in volume], first, rtol=0, atol=1e-3)
        for volume in volumes
    )


def join_volumes(volumes: Sequence[Sequence[Frame]], host: Host) -> tuple[Array, str | None]:
    """Return the segment number of each voxel [z, y, x], and a note if segments overlap.

    volumes: the frames of each segment, in order.
    """
    path = volumes[0][0].file
    host.begin_file(path)
    places = {
        frame.number: (z, k)
        for k, volume in enumerate(volumes, start=1)
        for z, frame in enumerate(volume)
        if frame.number is not None
    }

    def planes() -> Iterator[tuple[int, Int64]]:
        for number, stored in stored_frames(path, sorted(places)):
            z, k = places[number]
            yield z, np.where(stored[..., 0] > 0, k, 0)

    labels = [volume[0].segment for volume in volumes]
    joined = allocate_voxels(host, (len(volumes[0]), *volumes[0][0].size[::-1]), type_of_labels(labels))
    overlap = join_segments(planes, labels, joined)
    return joined, f"{overlap}; `component: k` draws one segment" if overlap else None


def channels_of(volumes: Sequence[Sequence[Frame]], labels: Sequence[Label], *, are_light: bool) -> tuple[Channel, ...]:
    """Return a channel for each segment, with the name and colour of the segment.

    volumes: the frames of each segment. are_light: whether each segment is drawn as light of its own.
    """
    by_number = {label.value: label for label in labels}
    found = (by_number.get(volume[0].segment, Label(volume[0].segment)) for volume in volumes)
    return tuple(Channel(label.name, label.color, None, are_light) for label in found)
