"""Find the files of the only series of images in a folder, and list the files that are left out."""

from __future__ import annotations

import contextlib
import filecmp
import itertools
import re
from collections import defaultdict
from functools import partial
from pathlib import Path

from renderer.errors import InputError
from renderer.readers.dicom_fields import Dataset, open_dicom, text_of, unreadable_slice
from renderer.readers.dicom_kinds import kind_of, kind_without_pixels
from renderer.readers.sniff import is_dicom
from renderer.scene import join_some, short_text

# The largest number of files of a folder that are opened to find out whether a file that is read alone is a slice of a
# series.
_MAX_NEIGHBOURS = 1000

# If some images of a folder differ from most of its images by series, size or orientation, they are left out if there
# are at least this many times as many others; otherwise reading fails.
FEW = 8

# The name of the kind of image that has several frames in one file.
_OF_FRAMES = "file of several frames"

# The kinds of images other than slices. The first kind that a folder has is read where the folder has no slices.
_OTHERS = (_OF_FRAMES, "localizer", "capture")

# Files that agree in these fields may be copies of each other. The UID alone is not enough: some programs give all
# slices one UID.
_IDENTITY = ("SOPInstanceUID", "InstanceNumber", "ImagePositionPatient")


def find_series(folder: Path) -> tuple[list[Path], dict[str, list[Path]]]:
    """Return the files of the only series of images in a folder, and the files that are left out, by their kind.

    Raises InputError for no series and several, and for files that are damaged slices.
    """
    images: dict[str, dict[str, list[Path]]] = {kind: defaultdict(list) for kind in ("slice", *_OTHERS)}
    descriptions: dict[str, str] = {}
    left_out: dict[str, list[Path]] = defaultdict(list)
    without_image: dict[str, list[Path]] = defaultdict(list)
    known: dict[tuple[str, ...], Path] = {}
    for path in sorted(folder.iterdir()):
        if path.name.startswith(".") or path.is_dir():
            continue
        dataset = open_dicom(path)[0] if is_dicom(path) else {}
        uid = text_of([dataset], "SeriesInstanceUID") or text_of([dataset], "SeriesNumber")
        identity = tuple(text_of([dataset], name) for name in _IDENTITY)
        first = known.setdefault(identity, path) if any(identity) else path
        if first != path and filecmp.cmp(first, path, shallow=False):
            left_out["duplicate"].append(path)
            continue
        if "Rows" in dataset:
            images[_kind_of_image(dataset)][uid].append(path)
            descriptions.setdefault(uid, text_of([dataset], "SeriesDescription") or uid)
        elif kind := kind_without_pixels(dataset) if dataset else "":
            left_out[kind].append(path)
        else:
            without_image[uid].append(path)
    others = without_image.pop("", [])
    series = next(filter(None, images.values()), {})  # slices, or else images of the first other kind
    if _num_files(images[_OF_FRAMES]) > _num_files(images["slice"]):
        series = images[_OF_FRAMES]
    for kind, each in images.items():
        left_out[kind] += [] if each is series else itertools.chain(*each.values())
    if not series:
        raise InputError(
            "this folder holds no volume",
            got=describe_left_out(left_out) or (None if others else "an empty folder"),
            expected="the files of one DICOM series, or .tif files, directly in the folder",
        )
    main = max(series, key=lambda uid: len(series[uid]))
    few = [file for uid, files in series.items() if uid != main for file in files]
    if few and FEW * len(few) > len(series[main]):
        names = [
            f'"{short_text(descriptions[uid])}", {len(files)} file{"s" * (len(files) > 1)} from {files[0].name}'
            for uid, files in sorted(series.items())
        ]
        raise InputError(
            f"this folder holds {len(series)} DICOM series, and one is rendered",
            got=join_some(names, "; "),
            hint="put each series into its own folder",
        )
    left_out["image of another series"] += few
    if without_image[main]:
        hint = "it was cut off, or is no slice: copy it again, or remove it"
        raise unreadable_slice(without_image[main][0], hint, "no Rows and Columns")
    cut_off = [file for uid, files in without_image.items() if uid != main for file in files]
    _check_none_lost([*others, *cut_off], series[main])
    left_out["file without an image"] += cut_off
    return series[main], left_out


def _num_files(series: dict[str, list[Path]]) -> int:
    return sum(map(len, series.values()))


def _kind_of_image(dataset: Dataset) -> str:
    """Return the kind of an image: `slice`, or one of _OTHERS."""
    text = text_of([dataset], "ImageType")
    if "LOCALIZER" in text:
        return "localizer"
    if text_of([dataset], "NumberOfFrames") not in ("", "1"):
        return _OF_FRAMES
    if "ImagePositionPatient" in dataset or "PerFrameFunctionalGroupsSequence" in dataset:
        return "slice"
    is_capture = "Secondary Capture" in kind_of(dataset) or "SECONDARY" in text
    return "capture" if is_capture or "PixelSpacing" not in dataset else "slice"


def describe_left_out(left_out: dict[str, list[Path]]) -> str:
    """Return a text with the number of files of each kind, and the name of one of them."""
    parts = []
    for kind, files in left_out.items():
        if files:
            word, of, which = kind.partition(" of ")
            parts.append(f"{len(files)} {word}{'s' * (len(files) > 1)}{of}{which} ({short_text(files[0].name)})")
    return join_some(parts)


def _check_none_lost(others: list[Path], files: list[Path]) -> None:
    """Raise InputError for a file that is not a DICOM image but is named like the slices.

    Such a file may be a damaged slice: at an end of the stack, nothing else shows that a slice is missing.
    """
    shape_of = partial(re.sub, "[0-9]+", "#")
    shapes = {shape_of(path.name) for path in files}
    for path in others:
        if shape_of(path.name) in shapes:
            is_empty = path.is_file() and path.stat().st_size == 0
            kind = "a DICOM file without an image" if is_dicom(path) else "a file that is not DICOM"
            raise unreadable_slice(
                path,
                "the file is truncated or damaged: copy it again, or remove it if it is no slice",
                "an empty file" if is_empty else kind,
            )


def one_of_a_series(path: Path) -> str | None:
    """Return a note for a file with one slice of a series if another slice is in its folder; else None."""
    uid = text_of([open_dicom(path)[0]], "SeriesInstanceUID")
    for other in itertools.islice(path.parent.iterdir(), _MAX_NEIGHBOURS if uid else 0):
        with contextlib.suppress(InputError, OSError):  # other files may be damaged
            is_other = other.name != path.name and is_dicom(other)
            if is_other and text_of([open_dicom(other)[0]], "SeriesInstanceUID") == uid:
                return f"one of several slices of a DICOM series; its folder, {path.parent}, stands for all of them"
    return None
