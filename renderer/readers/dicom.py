"""Read DICOM: a folder with one series, or one file of one frame or several, placed by the positions of its frames.

pydicom parses, in a child process (`isolation.py`); it decodes plain and run-length pixels, and others with GDCM. The
third axis of the volume is the step from frame to frame, not their normal: a tilted gantry gives a sheared volume.
Values are those after each frame's rescale slope and intercept, whatever is light and what is dark.
"""

from __future__ import annotations

import contextlib
import itertools
import re
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from renderer.errors import InputError
from renderer.readers.common import Image, affine, choice_notes, select_index
from renderer.readers.dicom_frames import Frame, frames_of, open_dicom, pixels_of, text_of, unreadable_slice
from renderer.readers.isolation import Host, allocate_voxels
from renderer.readers.sniff import is_dicom
from renderer.scene import join_some, short_text
from renderer.volume import Float64

# Frames may be off by this part of the spacing: positions have few digits, and gantries are not perfect. A missing
# one is off by a whole step.
_UNEVEN = 0.05

# Beside a file that is read alone, other slices of its series are searched among this many files.
_MAX_NEIGHBOURS = 1000

_SERIES, _DESCRIPTION, _COLOURS = 0x0020000E, 0x0008103E, 0x00280004


def read_dicom(path: Path, time: int | None, component: int | None, *, has_spacing_override: bool, host: Host) -> Image:
    """Read the only series in a folder, or one file; frames in ascending order along their normal.

    has_spacing_override: the scene gives the spacing, so that lengths in the files are not checked. Raises InputError
        for no series or several, and for frames that differ in size or orientation, are missing, double or unevenly
        spaced.
    """
    files = _series_files(path) if path.is_dir() else [path]
    select_index("time", time, 1)
    frames = [frame for file in files for frame in frames_of(file, has_spacing_override=has_spacing_override)]
    if len(files) > 1 and len(frames) > len(files):
        several = next(frame for frame in frames if frame.number > 0)
        raise InputError(
            "several files of this series hold several slices each",
            where=str(several.file),
            got=f"{sum(frame.file == several.file for frame in frames)} slices",
            expected="one slice per file, or all of them in one file",
        )
    frames.sort(key=lambda frame: float(frame.position @ frame.normal))
    _check_alike(frames)
    first = frames[0]
    step = first.normal * first.thickness if len(frames) == 1 else _even_step(frames)
    channel = select_index("component", component, first.num_samples)
    dtype = np.result_type(*(frame.dtype for frame in frames))  # the rescale slope may differ from frame to frame
    values = allocate_voxels(host, (len(frames), *first.size[::-1]), dtype)
    for file, targets in itertools.groupby(zip(values, frames, strict=True), lambda pair: pair[1].file):
        host.begin_file(file)
        pixels = pixels_of(file)
        for target, frame in targets:
            target[...] = frame.rescaled(pixels[frame.number, :, :, channel])
    axes = np.column_stack([first.across, first.down, step])
    note = None if path.is_dir() or len(frames) > 1 else _one_of_a_series(path)
    colours = "RGB" * (text_of(open_dicom(first.file), _COLOURS) == "RGB")
    notes = (note, *choice_notes("c", (first.num_samples,), time, component, colours))
    return Image(values, affine(np.ones(3), first.position, axes), notes)


def _series_files(folder: Path) -> list[Path]:
    """Return the files of the only series of images in a folder."""
    series: dict[str, list[Path]] = defaultdict(list)
    descriptions: dict[str, str] = {}
    without_image: dict[str, list[Path]] = defaultdict(list)
    others: list[Path] = []
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.is_dir():
            continue
        dataset = open_dicom(path) if is_dicom(path) else {}
        uid = text_of(dataset, _SERIES) or ""
        if "Rows" in dataset:
            series[uid].append(path)
            descriptions.setdefault(uid, text_of(dataset, _DESCRIPTION) or uid)
        else:  # perhaps a report, a plan, an index of files, each with a series of its own
            (without_image[uid] if uid else others).append(path)
    if not series:
        raise InputError(
            "this folder holds no volume",
            got=None if others else "an empty folder",
            expected="the files of one DICOM series, or .tif files, directly in the folder",
        )
    if len(series) > 1:
        names = [
            f'"{short_text(descriptions[uid])}", {len(files)} file{"s" * (len(files) > 1)} from {files[0].name}'
            for uid, files in sorted(series.items())
        ]
        raise InputError(
            f"this folder holds {len(series)} DICOM series, and one is rendered",
            got=join_some(names, "; "),
            hint="put each series into its own folder",
        )
    uid, files = next(iter(series.items()))
    if without_image[uid]:
        raise unreadable_slice(without_image[uid][0])
    _check_none_lost(others, files)
    return files


def _check_none_lost(others: list[Path], files: list[Path]) -> None:
    """Raise InputError for a file that is not DICOM but is named like the slices: at an end of the stack nothing else
    would show that it was one."""
    shapes = {_shape(path.name) for path in files}
    for path in others:
        if _shape(path.name) in shapes:
            is_empty = path.is_file() and path.stat().st_size == 0
            kind = "a DICOM file without a series" if is_dicom(path) else "a file that is not DICOM"
            raise unreadable_slice(
                path,
                "the file is truncated or damaged: copy it again, or remove it if it is no slice",
                "an empty file" if is_empty else kind,
            )


def _shape(name: str) -> str:
    """Return a name with each number replaced by one sign."""
    return re.sub("[0-9]+", "#", name)


def _one_of_a_series(path: Path) -> str | None:
    """Return a note for a file with one of several slices of a series, of which another is in its folder; else None."""
    uid = text_of(open_dicom(path), _SERIES)
    for other in itertools.islice(path.parent.iterdir(), _MAX_NEIGHBOURS if uid is not None else 0):
        with contextlib.suppress(InputError, OSError):  # of another file
            if other.name != path.name and is_dicom(other) and text_of(open_dicom(other), _SERIES) == uid:
                return f"one of several slices of a DICOM series; its folder, {path.parent}, stands for all of them"
    return None


def _check_alike(frames: list[Frame]) -> None:
    first = frames[0]
    for frame in frames[1:]:
        for what, got, expected, tolerance in (
            ("size", frame.size, first.size, 0),
            ("pixel spacing", frame.spacing, first.spacing, 1e-3 * min(first.spacing)),
            ("orientation", frame.orientation, first.orientation, 1e-3),
            ("number of components", [frame.num_samples], [first.num_samples], 0),
        ):
            if not np.allclose(got, expected, rtol=0, atol=tolerance):
                raise InputError(
                    f"the slices of this series differ in their {what}",
                    got=f"{_describe(got)} in {frame.label}",
                    expected=f"{_describe(expected)} as in {first.label}",
                    hint="a localiser or a second scan among them? put it into its own folder",
                )


def _describe(numbers: Sequence[float]) -> str:
    return (" x " if len(numbers) == 2 else " ").join(f"{number:.6g}" for number in numbers)


def _even_step(frames: list[Frame]) -> Float64:
    """Return the step from slice to slice, float64 [3]; raises InputError if it is not the same everywhere."""
    positions = np.array([part.position for part in frames])
    gaps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    usual = float(np.median(gaps))
    doubled = np.flatnonzero(gaps <= _UNEVEN * usual)
    if doubled.size:
        i = int(doubled[0])
        raise InputError(
            "two slices of this series are at the same position",
            got=f"{frames[i].label} and {frames[i + 1].label}",
            expected="one slice at each position",
            hint="a time series or several echoes? put each volume into its own folder",
        )
    wide = np.flatnonzero(gaps >= (2 - _UNEVEN) * usual)
    if wide.size:
        i = int(wide[0])
        num_missing = int(np.sum(np.rint(gaps[wide] / usual) - 1))
        raise InputError(
            "slices of this series are missing",
            got=f"about {num_missing} missing; the first gap, {gaps[i]:.4g}, is between {frames[i].label} and "
            f"{frames[i + 1].label}",
            expected=f"a slice every {usual:.4g}",
        )
    step = (positions[-1] - positions[0]) / (len(frames) - 1)
    off = np.linalg.norm(positions - (positions[0] + np.arange(len(frames))[:, np.newaxis] * step), axis=1)
    worst = int(np.argmax(off))
    if off[worst] > _UNEVEN * np.linalg.norm(step):
        raise InputError(
            "the slices of this series are not evenly spaced",
            got=f"gaps from {gaps.min():.4g} to {gaps.max():.4g}; {frames[worst].label} is off by {off[worst]:.4g}",
            expected=f"a slice every {np.linalg.norm(step):.4g}, within {_UNEVEN:.0%} of that",
            hint="resample the series to even spacing first",
        )
    return np.asarray(step, np.float64)
