"""Find the places of DICOM frames, by their positions or the next best field, and check that they are evenly spaced.

A frame without a position of its own has an offset or an index in its file; or SliceLocation or InstanceNumber places
it among other files, and a note says so. A missing number is never read as 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from renderer.errors import InputError
from renderer.readers.dicom_folder import FEW
from renderer.readers.dicom_frames import PLACE_KEYS, Frame
from renderer.scene import counted
from renderer.volume import Float64

# The largest distance of a frame from its even place, as a share of the spacing. Positions have few digits, and
# gantries are not perfect; where a slice is missing, the distance is a whole step.
UNEVEN = 0.05

# The planes of slices that lie one behind the other along x, along y and along z: the name of the plane, and the usual
# directions of rows and of columns in it, in LPS.
_PLANES = (
    ("sagittal", (0.0, 1.0, 0.0), (0.0, 0.0, -1.0)),
    ("coronal", (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
    ("axial", (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
)


def placed(frames: Sequence[Frame]) -> tuple[list[Frame], str | None]:
    """Return frames that all have a place, and a note on the field that places the frames without a position.

    Raises InputError if no field gives them a place.
    """
    lost = [frame for frame in frames if not frame.has_place]
    if not lost or len(frames) == 1:
        return list(frames), None
    for keyword in PLACE_KEYS:
        at = _places_by(keyword, frames)
        if at is None:
            continue
        moved = [frame if frame.has_place else replace(frame, position=at[k]) for k, frame in enumerate(frames)]
        names = f"{counted(len(lost), 'slice')} without ImagePositionPatient ({lost[0].label})"
        return moved, f"{names}: {keyword} places {'them' if len(lost) > 1 else 'it'}"
    has_number = all("InstanceNumber" in frame.keys for frame in lost)
    needs_distance = has_number and len(lost) == len(frames) and not frames[0].has_thickness
    why = "no SliceLocation or InstanceNumber fits"
    if needs_distance:
        why = "InstanceNumber counts them, and no SpacingBetweenSlices or SliceThickness says how far apart they are"
    hint = "convert the series by dcm2niix, or export it again"
    raise InputError(
        "slices of this series do not say where they are",
        got=f"{len(lost)} of {len(frames)} without ImagePositionPatient, such as {lost[0].label}; {why}",
        expected="ImagePositionPatient, or a number that grows from slice to slice, in each file",
        hint="`spacing: [x, y, z]` says how far apart they are" if needs_distance else hint,
    )


def turned(frames: Sequence[Frame]) -> tuple[list[Frame], str | None]:
    """Return frames that have directions of rows and columns, and a note if these are guessed.

    Directions are guessed from the places of the frames if the files give none. Frames whose places differ most along x
    are taken for sagittal slices, along y for coronal, along z for axial ones.
    """
    extents = np.ptp([frame.position for frame in frames], axis=0)
    if frames[0].has_axes or not extents.any():
        return list(frames), None
    name, row, column = _PLANES[int(np.argmax(extents))]
    seen = [
        replace(frame, across=np.array(row) * frame.spacing[0], down=np.array(column) * frame.spacing[1])
        for frame in frames
    ]
    return seen, f"no ImageOrientationPatient; by their positions these are taken for {name} slices"


def _places_by(keyword: str, frames: Sequence[Frame]) -> Float64 | None:
    """Return the positions of all frames, float64 [n, 3], by a field with a number for each frame.

    Returns None if the field does not suit.

    The positions are a linear function of the number, fitted to the known positions. If no position is known, slices
    follow the normal.
    """
    if not all(keyword in frame.keys for frame in frames):
        return None
    numbers = np.array([frame.keys[keyword] for frame in frames])
    known = np.array([frame.has_place for frame in frames])
    if len(np.unique(numbers)) < 2:
        return None
    if not known.any():
        step = 1.0 if keyword == "SliceLocation" else frames[0].thickness
        if keyword != "SliceLocation" and not frames[0].has_thickness:
            return None
        return frames[0].position + np.outer((numbers - numbers.min()) * step, frames[0].normal)
    if len(np.unique(numbers[known])) < 2:
        return None
    basis = np.column_stack([numbers, np.ones(len(numbers))])
    positions = np.array([frame.position for frame in frames])
    slopes = np.linalg.lstsq(basis[known], positions[known], rcond=None)[0]
    found = np.asarray(basis @ slopes, np.float64)
    off = np.linalg.norm(found[known] - positions[known], axis=1).max()
    step = np.linalg.norm(slopes[0]) * np.diff(np.unique(numbers)).min()
    return found if off <= UNEVEN * step else None


def without_strays(frames: list[Frame]) -> tuple[list[Frame], list[Frame]]:
    """Return the largest group of frames that `difference` finds alike, and all other frames.

    If the other frames are too many to be left out (FEW), returns all frames and an empty list.
    """
    kinds: list[list[Frame]] = []
    for frame in frames:
        for kind in kinds:
            if difference(kind[0], frame) is None:
                kind.append(frame)
                break
        else:
            kinds.append([frame])
    most = max(kinds, key=len)
    others = [frame for kind in kinds if kind is not most for frame in kind]
    return (most, others) if FEW * len(others) <= len(most) else (frames, [])


def check_alike(frames: Sequence[Frame]) -> None:
    """Raise InputError for frames that differ in size, spacing, orientation or components."""
    for frame in frames[1:]:
        differ = difference(frames[0], frame)
        if differ is not None:
            what, got, expected = differ
            raise InputError(
                f"the slices of this series differ in their {what}",
                got=f"{got} in {frame.label}",
                expected=f"{expected} as in {frames[0].label}",
                hint="a localiser or a second scan among them? put it into its own folder",
            )


def difference(first: Frame, frame: Frame) -> tuple[str, str, str] | None:
    """Return the property in which a frame differs from the first, its value in the frame, and its value in the first.

    Returns None if the frames are alike.
    """
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


def distances(frames: Sequence[Frame], first: Frame) -> Float64:
    """Return the distances of frames from the first frame along its normal, float64 [n]."""
    return np.asarray([(frame.position - first.position) @ first.normal for frame in frames], np.float64)


def by_place(frames: Sequence[Frame]) -> list[list[Frame]]:
    """Return frames grouped by their place along the normal, in ascending order."""
    order = np.argsort(places := distances(frames, frames[0]), kind="stable")
    gaps = np.diff(places[order])
    # Tiny gaps come from rounding. A gap is tiny against the largest gap and against a pixel, as the largest gap may be
    # one between two blocks of slices.
    steps = gaps[gaps > min(0.01 * gaps.max(initial=0.0), 0.1 * min(frames[0].spacing))]
    begins = np.flatnonzero(gaps > UNEVEN * np.median(steps)) + 1 if steps.size else np.array([], np.intp)
    return [[frames[k] for k in part.tolist()] for part in np.split(order, begins)]


def are_one_volume(frames: Sequence[Frame]) -> bool:
    """Return whether frames are alike, have evenly spaced places, and are equally many at each place."""
    if any(difference(frames[0], frame) is not None for frame in frames):
        return False
    groups = by_place(frames)
    return len({len(group) for group in groups}) == 1 and _unevenness([group[0] for group in groups])[1] <= UNEVEN


def even_step(frames: Sequence[Frame]) -> Float64:
    """Return the step from slice to slice, float64 [3]; raises InputError for uneven steps."""
    positions = np.array([part.position for part in frames])
    gaps = np.linalg.norm(np.diff(positions, axis=0), axis=1)
    usual = float(np.median(gaps))
    wide = np.flatnonzero(gaps >= (2 - UNEVEN) * usual)
    # Missing files leave single gaps of whole steps. All other uneven gaps are changes of the distance of slices.
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
    worst, unevenness = _unevenness(frames)
    step = (positions[-1] - positions[0]) / (len(frames) - 1)
    length = float(np.linalg.norm(step))
    if unevenness > UNEVEN:
        raise InputError(
            "the slices of this series are not evenly spaced",
            got=f"gaps from {gaps.min():.4g} to {gaps.max():.4g}; {frames[worst].label} is off by "
            f"{unevenness * length:.4g}",
            expected=f"a slice every {length:.4g}, within {UNEVEN:.0%} of that",
            hint="resample the series to even spacing, for example in 3D Slicer"
            + ("" if is_one_file else ", or put slices of one distance into a folder of their own"),
        )
    return np.asarray(step, np.float64)


def _unevenness(frames: Sequence[Frame]) -> tuple[int, float]:
    """Return the index of the frame that is farthest from its place by even steps, and that distance in steps."""
    if len(frames) == 1:
        return 0, 0.0
    positions = np.array([frame.position for frame in frames])
    step = (positions[-1] - positions[0]) / (len(frames) - 1)
    off = np.linalg.norm(positions - (positions[0] + np.arange(len(frames))[:, np.newaxis] * step), axis=1)
    worst = int(np.argmax(off))
    length = float(np.linalg.norm(step))
    return worst, float(off[worst]) / length if length > 0 else float("inf")
