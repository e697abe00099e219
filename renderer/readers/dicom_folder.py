"""Find the files of the only series of images in a folder, and say what else is there."""

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

# Beside a file that is read alone, other slices of its series are searched among this many files.
_MAX_NEIGHBOURS = 1000

# Unnamed images that do not fit are left out beside at least this many times as many that do.
FEW = 8

# What images are beside slices, in the order in which they are read where there are none before.
_OF_FRAMES = "file of several frames"
_OTHERS = (_OF_FRAMES, "localizer", "capture")

# Files that agree in these may be copies: some programs give all slices one UID.
_IDENTITY = ("SOPInstanceUID", "InstanceNumber", "ImagePositionPatient")


def find_series(folder: Path) -> tuple[list[Path], dict[str, list[Path]]]:
    """Return the files of the only series of images in a folder, and others by their kind, which are left out.

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
    series = next(filter(None, images.values()), {})  # where there are no slices, the others are the series
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
    _check_none_lost(others, series[main])
    return series[main], left_out


def _num_files(series: dict[str, list[Path]]) -> int:
    return sum(map(len, series.values()))


def _kind_of_image(dataset: Dataset) -> str:
    """Return `slice`, or what an image is beside slices, one of _OTHERS."""
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
    """Return how many files of which kinds there are, with the name of one of each."""
    parts = []
    for kind, files in left_out.items():
        if files:
            word, of, which = kind.partition(" of ")
            parts.append(f"{len(files)} {word}{'s' * (len(files) > 1)}{of}{which} ({short_text(files[0].name)})")
    return join_some(parts)


def _check_none_lost(others: list[Path], files: list[Path]) -> None:
    """Raise InputError for a file that is not DICOM but is named like the slices: at an end of the stack nothing else
    would show that it was one."""
    shape_of = partial(re.sub, "[0-9]+", "#")
    shapes = {shape_of(path.name) for path in files}
    for path in others:
        if shape_of(path.name) in shapes:
            is_empty = path.is_file() and path.stat().st_size == 0
            kind = "a DICOM file without a series" if is_dicom(path) else "a file that is not DICOM"
            raise unreadable_slice(
                path,
                "the file is truncated or damaged: copy it again, or remove it if it is no slice",
                "an empty file" if is_empty else kind,
            )


def one_of_a_series(path: Path) -> str | None:
    """Return a note for a file with one of several slices of a series, of which another is in its folder; else None."""
    uid = text_of([open_dicom(path)[0]], "SeriesInstanceUID")
    for other in itertools.islice(path.parent.iterdir(), _MAX_NEIGHBOURS if uid else 0):
        with contextlib.suppress(InputError, OSError):  # of another file
            is_other = other.name != path.name and is_dicom(other)
            if is_other and text_of([open_dicom(other)[0]], "SeriesInstanceUID") == uid:
                return f"one of several slices of a DICOM series; its folder, {path.parent}, stands for all of them"
    return None
