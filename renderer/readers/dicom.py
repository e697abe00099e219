"""Read DICOM: a folder with one series, or one file of one frame or several, placed by the positions of its frames.

pydicom parses, in a child process (`isolation.py`); it decodes plain and run-length pixels, and others with GDCM. The
third axis of the volume is the step from frame to frame, not their normal: a tilted gantry gives a sheared volume.
Values are those after each frame's rescale slope and intercept, whatever is light and what is dark. Of frames at one
place, which times or components tell apart, one is chosen.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import Image, affine, choose
from renderer.readers.dicom_dimensions import UNEVEN, sort_frames, times_of
from renderer.readers.dicom_fields import open_dicom, text_of
from renderer.readers.dicom_folder import FEW, describe_left_out, find_series, one_of_a_series
from renderer.readers.dicom_frames import Frame, frames_of, pixels_of
from renderer.readers.dicom_mosaic import slices_of
from renderer.readers.isolation import Host, allocate_voxels
from renderer.volume import Array, Float64


def read_dicom(path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host) -> Image:
    """Read the only series in a folder, or one file; frames in ascending order along their normal.

    has_spacing_override: the scene gives the spacing, so that lengths in the files are not checked. Raises InputError
        for no series or several, and for frames that differ in size or orientation, are missing or unevenly spaced, or
        are at one place and nothing tells them apart.
    """
    files, left_out = find_series(path) if path.is_dir() else ([path], {})
    stored = [frame for file in files for frame in frames_of(file, has_spacing_override=has_spacing_override)]
    frames = [each for frame in stored for each in slices_of(frame)]
    if path.is_dir():
        frames, strays = _without_strays(frames)
        left_out["image of another size or orientation"] = list(dict.fromkeys(frame.file for frame in strays))
    try:
        volumes, by_axis = sort_frames(frames)
    except InputError:
        _check_alike(frames)  # if they are not, they are at one place by chance
        raise
    num_samples = frames[0].num_samples
    colours = "RGB" * (text_of([open_dicom(frames[0].file)[0]], "PhotometricInterpretation") == "RGB")
    chosen = choose("tc", (len(volumes), len(volumes[0]) * num_samples), time, component, colours, by_axis)
    frames = volumes[chosen.step][chosen.component // num_samples]
    _check_alike(frames)
    first = frames[0]
    step = first.normal * first.thickness if len(frames) == 1 else _even_step(frames)
    values, nodata = _read_values(frames, chosen.component % num_samples, host)
    axes = np.column_stack([first.across, first.down, step])
    note = None if path.is_dir() or len(frames) > 1 or len(volumes) > 1 else one_of_a_series(path)
    told = describe_left_out(left_out)
    notes = (f"left out of this series: {told}" if told else None, note, *first.notes, *chosen.notes)
    world_from_index, steps = affine(np.ones(3), first.position, axes), times_of(volumes)
    return Image(values, world_from_index, notes, nodata, chosen.channels, steps=steps, units=first.units)


def _read_values(frames: list[Frame], channel: int, host: Host) -> tuple[Array, tuple[tuple[float, float], ...]]:
    """Return the values [z, y, x], and the range of those that stand for no data.

    Where frames differ in that range, such values are NaN instead.
    """
    ranges = dict.fromkeys(frame.nodata for frame in frames if frame.number is not None)
    is_mixed = len(ranges) > 1
    dtype = np.result_type(*(frame.dtype for frame in frames))  # the rescale slope may differ from frame to frame
    dtype = np.result_type(dtype, np.float32) if is_mixed else dtype
    values = allocate_voxels(host, (len(frames), *frames[0].size[::-1]), dtype)
    pairs = [pair for pair in zip(values, frames, strict=True) if pair[1].number is not None]
    pairs.sort(key=lambda pair: pair[1].file)
    for file, targets in itertools.groupby(pairs, lambda pair: pair[1].file):
        host.begin_file(file)
        pixels = pixels_of(file)
        for target, frame in targets:
            stored = frame.stored(pixels, channel)
            target[...] = frame.rescaled(stored)
            if is_mixed and frame.padding is not None:
                target[(stored >= frame.padding[0]) & (stored <= frame.padding[1])] = np.nan
    return values, () if is_mixed else tuple(each for each in ranges if each is not None)


def _without_strays(frames: list[Frame]) -> tuple[list[Frame], list[Frame]]:
    """Return the frames that are alike, and few others; all frames and none where the others are many."""
    kinds: list[list[Frame]] = []
    for frame in frames:
        for kind in kinds:
            if _difference(kind[0], frame) is None:
                kind.append(frame)
                break
        else:
            kinds.append([frame])
    most = max(kinds, key=len)
    others = [frame for kind in kinds if kind is not most for frame in kind]
    return (most, others) if FEW * len(others) <= len(most) else (frames, [])


def _check_alike(frames: list[Frame]) -> None:
    for frame in frames[1:]:
        differ = _difference(frames[0], frame)
        if differ is not None:
            what, got, expected = differ
            raise InputError(
                f"the slices of this series differ in their {what}",
                got=f"{got} in {frame.label}",
                expected=f"{expected} as in {frames[0].label}",
                hint="a localiser or a second scan among them? put it into its own folder",
            )


def _difference(first: Frame, frame: Frame) -> tuple[str, str, str] | None:
    """Return in which property a frame differs from another, its own, and that of the other; None if it is alike."""
    for what, got, expected, tolerance in (
        ("size", frame.size, first.size, 0),
        ("pixel spacing", frame.spacing, first.spacing, 1e-3 * min(first.spacing)),
        ("orientation", frame.orientation, first.orientation, 1e-3),
        ("number of components", [frame.num_samples], [first.num_samples], 0),
    ):
        if not np.allclose(got, expected, rtol=0, atol=tolerance):
            return what, _describe(got), _describe(expected)
    return None


def _describe(numbers: Sequence[float]) -> str:
    return (" x " if len(numbers) == 2 else " ").join(f"{number:.6g}" for number in numbers)


def _even_step(frames: list[Frame]) -> Float64:
    """Return the step from slice to slice, float64 [3]; raises InputError if it is not the same everywhere."""
    positions = np.array([part.position for part in frames])
    gaps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    usual = float(np.median(gaps))
    wide = np.flatnonzero(gaps >= (2 - UNEVEN) * usual)
    # What is missing leaves wide gaps here and there, of whole steps, in a folder; the rest is another distance.
    steps = gaps[wide] / usual
    is_one_file = len({frame.file for frame in frames}) == 1
    is_whole = is_one_file or bool(np.any(np.diff(wide) == 1))
    if wide.size and not is_whole and np.allclose(steps, np.rint(steps), rtol=0, atol=2 * UNEVEN):
        i = int(wide[0])
        num_missing = int(np.sum(np.rint(steps) - 1))
        raise InputError(
            "slices of this series are missing",
            got=f"about {num_missing} missing; the first gap, {gaps[i]:.4g}, is between {frames[i].label} and "
            f"{frames[i + 1].label}",
            expected=f"a slice every {usual:.4g}",
            hint="copy the whole series again; if it has no more slices, resample it to even spacing, for example in "
            "3D Slicer, or put the slices on one side of the gap into a folder of their own",
        )
    step = (positions[-1] - positions[0]) / (len(frames) - 1)
    off = np.linalg.norm(positions - (positions[0] + np.arange(len(frames))[:, np.newaxis] * step), axis=1)
    worst = int(np.argmax(off))
    if off[worst] > UNEVEN * np.linalg.norm(step):
        raise InputError(
            "the slices of this series are not evenly spaced",
            got=f"gaps from {gaps.min():.4g} to {gaps.max():.4g}; {frames[worst].label} is off by {off[worst]:.4g}",
            expected=f"a slice every {np.linalg.norm(step):.4g}, within {UNEVEN:.0%} of that",
            hint="resample the series to even spacing, for example in 3D Slicer"
            + ("" if is_one_file else ", or put slices of one distance into a folder of their own"),
        )
    return np.asarray(step, np.float64)
