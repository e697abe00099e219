"""Read DICOM: a folder with one series, or one file of one or more frames, placed by the positions of the frames.

pydicom parses, in a child process (`isolation.py`); it decodes plain and run-length pixels itself, and other
compressions with GDCM. The third axis of the volume is the step from frame to frame, not the normal of the frames: a
tilted gantry gives a sheared volume. Each frame's scale is applied to its values; whether high values are shown light
or dark is ignored. Frames at one place are times or components, of which one is read. All segments of a segmentation
become labels of one volume.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.readers.affines import affine
from renderer.readers.components import Chosen, choose
from renderer.readers.dicom_dimensions import Sorted, sort_frames, times_of
from renderer.readers.dicom_folder import describe_left_out, find_series, one_of_a_series
from renderer.readers.dicom_frames import Frame, frames_of
from renderer.readers.dicom_mosaic import slices_of
from renderer.readers.dicom_pixels import stored_frames
from renderer.readers.dicom_places import check_alike, even_step, placed, turned, without_strays
from renderer.readers.dicom_segments import (
    Segments,
    are_whole,
    channels_of,
    fit_together,
    join_volumes,
    segments_of,
)
from renderer.readers.dicom_statements import note_on
from renderer.readers.image import Image
from renderer.readers.isolation import Host, allocate_voxels
from renderer.volume import Array, Label

Ranges = tuple[tuple[float, float], ...]


class _Voxels(NamedTuple):
    """A stack of frames, and its voxels.

    frames: the slices, from the first to the last. values: the voxels, [z, y, x]. nodata: ranges of values that stand
    for no data. labels: the names and colours of segments. note: a remark on how the voxels were made, or None.
    """

    frames: list[Frame]
    values: Array
    nodata: Ranges = ()
    labels: tuple[Label, ...] = ()
    note: str | None = None


def read_dicom(path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host) -> Image:
    """Read the only series in a folder, or one file, with its frames in ascending order along their normal.

    has_spacing_override: the scene gives the spacing, so that lengths in the files are not checked. Raises InputError
        for no series or several, and for frames that differ in size or orientation, are missing or unevenly spaced,
        have no position, or share a place without a field in which they differ.
    """
    files, left_out = find_series(path) if path.is_dir() else ([path], {})
    stored = [frame for file in files for frame in frames_of(file, has_spacing_override=has_spacing_override)]
    frames = [each for frame in stored for each in slices_of(frame)]
    if path.is_dir():
        frames, strays = without_strays(frames)
        left_out["image of another size or orientation"] = list(dict.fromkeys(frame.file for frame in strays))
    frames, axes_note = turned(frames)
    frames, place_note = placed(frames)
    try:
        found = sort_frames(frames)
    except InputError:
        check_alike(frames)  # if frames are of different stacks, its message says so
        raise
    segments = segments_of(frames[0].file)
    chosen, voxels = _read_chosen(found, segments, time, component, host)
    first = voxels.frames[0]
    step = first.normal * first.thickness if len(voxels.frames) == 1 else even_step(voxels.frames)
    is_alone = not path.is_dir() and len(frames) == 1
    told = describe_left_out(left_out)
    notes = (
        f"left out of this series: {told}" if told else None,
        found.note,
        axes_note,
        place_note,
        one_of_a_series(path) if is_alone else None,
        *dict.fromkeys(note for frame in voxels.frames for note in frame.notes),
        *chosen.notes,
        voxels.note,
        note_on((frame.stated for frame in voxels.frames), (frame.space for frame in voxels.frames)),
    )
    world_from_index = affine(np.ones(3), first.position, np.column_stack([first.across, first.down, step]))
    return Image(
        voxels.values,
        world_from_index,
        notes,
        voxels.nodata,
        chosen.channels,
        voxels.labels,
        times_of(found.volumes),
        first.units,
    )


def _read_chosen(
    found: Sorted, segments: Segments | None, time: int | None, component: int | None, host: Host
) -> tuple[Chosen, _Voxels]:
    """Return the chosen time and component, and their voxels.

    All segments of a segmentation are read together, unless the scene chooses one.
    """
    volumes, first = found.volumes, found.volumes[0][0][0]
    num_samples = first.num_samples
    every = [frame for volume in volumes[0] for frame in volume]
    are_labels = segments is not None and are_whole(every, segments)
    is_joined = are_labels and component is None and len(volumes) == 1 and fit_together(volumes[0])
    shape = (len(volumes), len(volumes[0]) * num_samples)
    chosen = choose("tc", shape, time, 0 if is_joined else component, "RGB" * first.has_colors, found.by_axis)
    frames = volumes[chosen.step][chosen.component // num_samples]
    check_alike(frames)
    if segments is None:
        return chosen, _read_values(frames, chosen.component % num_samples, host)
    note = segments.note
    if not are_labels or (len(volumes[0]) > 1 and not is_joined):
        chosen = chosen._replace(channels=channels_of(volumes[0], segments.labels, are_light=not are_labels))
    if not are_labels:
        return chosen, _read_values(frames, 0, host)
    if segments.kind != "LABELMAP":
        values, overlap = join_volumes(volumes[0] if is_joined else [frames], host)
        chosen = chosen._replace(channels=()) if is_joined else chosen
        return chosen, _Voxels(frames, values, (), segments.labels, "; ".join(filter(None, (note, overlap))) or None)
    voxels = _read_values(frames, 0, host)
    if segments.background:
        voxels.values[voxels.values == segments.background] = 0
    return chosen, voxels._replace(labels=segments.labels, note=note)


def _read_values(frames: list[Frame], channel: int, host: Host) -> _Voxels:
    """Return the values of frames, and the ranges of values that stand for no data.

    Where frames have different ranges, or a table maps a range to other values, absent voxels are NaN instead.
    """
    filled = [frame for frame in frames if frame.number is not None]
    ranges = dict.fromkeys(frame.scale.nodata for frame in filled)
    is_mixed = len(ranges) > 1 or any(each.scale.padding and each.scale.table is not None for each in filled)
    dtype = np.result_type(*(frame.scale.dtype for frame in frames))  # frames with other slopes may have other types
    dtype = np.result_type(dtype, np.float32) if is_mixed else dtype
    values = allocate_voxels(host, (len(frames), *frames[0].size[::-1]), dtype)
    by_file: dict[Path, dict[int, list[tuple[Array, Frame]]]] = {}
    for target, frame in zip(values, frames, strict=True):
        if frame.number is not None:  # several slices of a mosaic are parts of one stored frame
            by_file.setdefault(frame.file, {}).setdefault(frame.number, []).append((target, frame))
    for file in sorted(by_file):
        host.begin_file(file)
        for number, pixels in stored_frames(file, sorted(by_file[file])):
            for target, frame in by_file[file][number]:
                stored, padding = frame.part_of(pixels, channel), frame.scale.padding
                target[...] = frame.scale.values_of(stored, file)
                if is_mixed and padding is not None:
                    target[(stored >= padding[0]) & (stored <= padding[1])] = np.nan
    return _Voxels(frames, values, () if is_mixed else tuple(each for each in ranges if each is not None))
