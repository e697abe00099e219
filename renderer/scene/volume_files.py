"""The scene's `volume.file`: a file or a folder with one volume, or several that are its steps in time.

Steps are given by a list of files, by a pattern whose field `{:04}` stands for their numbers, by a folder of files
whose names differ in a number, or by a collection of ParaView (.pvd). They are found by their names alone: no volume is
opened.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from renderer.errors import InputError, Problem, SceneError
from renderer.scene import schema
from renderer.scene.file_places import found_path
from renderer.scene.input_file import read_bounded
from renderer.scene.message_text import did_you_mean, short_text
from renderer.scene.schema import INVALID, TreeNode
from renderer.scene.urls import is_url

# The largest number of steps in time of a volume.
MAX_STEPS = 10_000
# The suffixes of files that hold a whole volume.
VOLUME_SUFFIXES = (
    *(".nrrd", ".nhdr", ".mha", ".mhd", ".nii", ".nii.gz", ".mgh", ".mgz", ".mgh.gz"),
    *(".npy", ".npz", ".vti", ".pvti", ".vtr", ".vtk", ".cube", ".cub"),
    *(".mrc", ".mrcs", ".ccp4", ".mrc.gz", ".map.gz", ".ccp4.gz", ".nc", ".nc4"),
)
_HEADERLESS = (".raw", ".bin", ".dat")
_SLICES = (".tif", ".tiff", ".dcm", ".ima")
# The field of a pattern of file names, such as `{:04}`, for a number; the group is the smallest number of its digits.
_FIELD = re.compile(r"\{(?::0?([1-9]?))?\}")
# Volumes in a folder whose names differ in one number count as steps in time if they are at least this many. Two of
# them may be, for example, T1 and T2.
_MIN_IN_FOLDER = 3


@dataclass(frozen=True)
class FileSource:
    """A volume in files with headers: one file, a folder (DICOM series or TIFF stack), or a file for each step.

    spacing: replaces the spacing in the file, whose directions and origin are kept.
    steps: the files of the steps in time, of which `file` is the first; empty for a single file, which may contain
        steps.
    collection: the file of ParaView that lists the steps and their `times`, which have no unit.
    """

    file: Path
    spacing: schema.Vector | None = None
    steps: tuple[Path, ...] = ()
    times: tuple[float, ...] = ()
    collection: Path | None = None

    def written(self) -> dict[str, object]:
        """Return the keys of the source in the section of a volume, with their values."""
        return {"file": self.collection or self.steps or self.file, "spacing": self.spacing}


@dataclass(frozen=True)
class UrlSource:
    """A volume in a store at a URL. spacing: as in FileSource."""

    url: str
    spacing: schema.Vector | None = None

    def written(self) -> dict[str, object]:
        """Return the keys of the source in the section of a volume, with their values."""
        return {"file": self.url, "spacing": self.spacing}


def is_pattern(name: str | os.PathLike[str]) -> bool:
    """Return whether a path is no file, but a pattern for the names of several files."""
    return _FIELD.search(os.path.basename(name)) is not None and not os.path.lexists(name)


def file_field(expected: str, *, folder: bool) -> schema.FieldType[Path]:
    """Return the type of an existing file, relative to the node's base. folder: whether a folder is allowed, too."""

    def parse(node: TreeNode) -> Any:
        if not schema.is_file_name(node.value):
            return node.reject("not a file name")
        path = Path(found_path(node.value, node.base))
        got = str(path)
        try:
            is_file, is_folder, is_other = path.is_file(), path.is_dir(), path.exists()
        except OSError as error:  # a folder without permission, a name that is too long
            return node.reject(f"cannot be read: {error.strerror}", got=got)
        if folder and is_file and path.suffix.lower() in _HEADERLESS:
            hint = "give volume.raw: {file: ..., shape: [...], dtype: ...} instead"
            return node.reject("a file without a header", got=got, hint=hint)
        if is_folder and not folder:
            return node.reject("a folder", got=got)
        if is_file or is_folder:
            return path
        if is_other:
            return node.reject("neither a file nor a folder", got=got, hint="write a pipe's content to a file")
        if path.is_symlink():
            return node.reject("a broken link", got=f"{got}, which leads to {os.readlink(path)}")
        return node.reject("no such file", got=got, hint=_missing_file_hint(path))

    return schema.FieldType(expected, parse, plain_schema=schema.of_json_type("string"))


def _missing_file_hint(path: Path) -> str | None:
    """Return the hint for a missing file: a similar name in its folder, or a reason why the folder cannot be read."""
    try:
        others = sorted(entry.name for entry in path.parent.iterdir() if entry.suffix not in (".yaml", ".yml"))
    except (OSError, ValueError):
        return schema.TILDE_HINT if "~" in path.parts else "its folder is not there, either"
    return did_you_mean(path.name, others)


def _parse_url(node: TreeNode, url: str) -> Any:
    """Return the source of a volume at a URL, or INVALID."""
    parts = urlsplit(url)
    if "@" in parts.netloc:
        hint = "credentials come from the variables of AWS and Google, or from their files"
        return node.reject("a URL with a name or a password", got=parts.scheme, expected="a URL without", hint=hint)
    if parts.fragment or not url.isprintable() or " " in url:
        return node.reject("not the URL of a store", expected="no blank, and no part after #")
    return UrlSource(url)


def _parse_source(node: TreeNode) -> Any:
    if is_url(node.value):
        return _parse_url(node, str(node.value))
    if isinstance(node.value, (list, tuple)):
        return _steps(node, [(number, node.child(number, value)) for number, value in enumerate(node.value)])
    if schema.is_file_name(node.value):
        pattern = Path(found_path(node.value, node.base))
        if is_pattern(pattern):
            return _matched(node, pattern)
    path = _ONE_FILE.parse(node)
    if path is INVALID:
        return INVALID
    if path.is_dir():
        numbered = _numbered_volumes(path)
        return _in_order(node, path, numbered) if numbered else FileSource(path)
    return _collected(node, path) if path.suffix.lower() == ".pvd" else FileSource(path)


_EXPECTED = "a file such as NRRD, NIfTI, TIFF, DICOM or .npy, or a folder with one volume"
_ONE_FILE = file_field(_EXPECTED, folder=True)
_FILES = schema.sequence_field(schema.TEXT_FIELD, "a list of files")
SOURCE_FIELD: schema.FieldType[FileSource | UrlSource] = schema.FieldType(
    f"{_EXPECTED}; or the URL of a store; or steps in time: a list of files, or a pattern such as step_{{:04}}.vti",
    _parse_source,
    plain_schema=lambda moves: schema.any_of(_ONE_FILE.plain_schema(moves), _FILES.plain_schema(moves)),
)


def _steps(node: TreeNode, numbered: Sequence[tuple[float, TreeNode]]) -> Any:
    """Return the source of a volume whose steps in time are the files at some nodes, or INVALID.

    numbered: pairs of a number or a time, by which steps are sorted, and the node of a file.
    """
    if not 0 < len(numbered) <= MAX_STEPS:
        return node.reject("wrong number of steps", got=str(len(numbered)), expected=f"1 to {MAX_STEPS} files")
    ordered = sorted(numbered, key=itemgetter(0))
    for (number, each), (following, other) in pairwise(ordered):
        if number == following:
            got = short_text(f"{each.value} and {other.value} at {number:g}")
            return node.reject("two files of one step", got=got, expected="a file for each", hint="join the parts")
    files = []
    for _, each in ordered:
        files.append(_ONE_FILE.read(each))
        if files[-1] is INVALID:  # further files are likely wrong for the same reason
            return INVALID
    return FileSource(files[0], steps=tuple(files))


def _matched(node: TreeNode, pattern: Path) -> Any:
    """Return the source of a volume whose steps in time are the files that match a pattern, or INVALID.

    They match if they lie in the pattern's folder, and their names have a number in place of its field.
    """
    before, width, after, *more = _FIELD.split(pattern.name)
    if more:
        return node.reject("several fields in a pattern", expected="one, such as step_{:04}.vti")
    name = re.compile(f"{re.escape(before)}([0-9]{{{width or 1},18}}){re.escape(after)}")
    matches = [match for each in _names_in(pattern.parent) if (match := name.fullmatch(each))]
    if matches:
        return _in_order(node, pattern.parent, [(int(match[1]), match[0]) for match in matches])
    hint = f"{{{f':0{width}' if width else ''}}} stands for {f'{width} digits' if width else 'a digit'} or more"
    return node.reject("no file matches this pattern", got=str(pattern), expected="", hint=hint)


def _numbered_volumes(folder: Path) -> list[tuple[int, str]]:
    """Return the volumes in a folder with their numbers, if their names differ in one number only; else an empty list.

    The list is also empty if any file in the folder may be a slice.
    """
    names = [name for name in _names_in(folder) if not name.startswith(".")]
    volumes = [name for name in names if name.lower().endswith(VOLUME_SUFFIXES)]
    if len(volumes) < _MIN_IN_FOLDER or any(map(_may_be_slice, {*names}.difference(volumes))):
        return []
    parts = [re.split(r"([0-9]{1,18})", name) for name in volumes]
    if len({len(each) for each in parts}) > 1:
        return []
    different = [k for k, column in enumerate(zip(*parts, strict=True)) if len({*column}) > 1]
    if len(different) != 1 or different[0] % 2 == 0:  # at even k, there is text between numbers
        return []
    return [(int(own[different[0]]), name) for own, name in zip(parts, volumes, strict=True)]


def has_steps_in_time(folder: Path) -> bool:
    """Return whether the volumes in a folder are steps in time, as their names differ in one number only."""
    return bool(_numbered_volumes(folder))


def _may_be_slice(name: str) -> bool:
    """Return whether a file may be a slice, by its name. Many DICOM files have a number in place of a suffix."""
    has_numbers = re.search("[0-9]", name) and all(re.fullmatch("[0-9]+", part) for part in name.split(".")[1:])
    return name.lower().endswith(_SLICES) or bool(has_numbers)


def _names_in(folder: Path) -> list[str]:
    can_be_read = os.path.isdir(folder) and os.access(folder, os.R_OK)
    return os.listdir(folder) if can_be_read else []  # the reader reports a folder that cannot be read


def _in_order(node: TreeNode, folder: Path, numbered: Sequence[tuple[int, str]]) -> Any:
    """Return the source of a volume whose steps in time are files in a folder, or INVALID.

    numbered: pairs of a file's number and its name. The numbers must be evenly spaced.
    """
    numbers = sorted(number for number, _ in numbered)
    every = math.gcd(*(number - before for before, number in pairwise(numbers)))
    num_missing = (numbers[-1] - numbers[0]) // every + 1 - len(numbers) if every else 0
    if num_missing > 0:
        gaps = (range(before + every, number, every) for before, number in pairwise(numbers))
        first = ", ".join(map(str, islice((number for gap in gaps for number in gap), 3)))
        more = f" and {num_missing - 3} more" * (num_missing > 3)
        what = f"no step{'s' * (num_missing > 1)} {first}{more} of {numbers[0]} to {numbers[-1]}"
        return node.reject(what, expected="", hint="a list of files may leave out steps")
    return _steps(node, [(number, replace(node, value=name, base=folder)) for number, name in numbered])


def _collected(node: TreeNode, path: Path) -> Any:
    """Return the source of a volume whose steps in time a collection of ParaView lists, or INVALID."""
    from renderer.looks import MAX_LOOK_BYTES, LookFile

    kind = "a collection of ParaView"
    try:
        file = LookFile(path, read_bounded(path, MAX_LOOK_BYTES, kind), kind)
        entries = islice(file.xml().iter("DataSet"), MAX_STEPS + 1)
        found = [(file.number(each.get("timestep", 0.0), "timestep"), each.get("file", "")) for each in entries]
    except InputError as error:
        where, got, expected = error.where or str(path), error.got or "", error.expected or ""
        return node.reject(f"{where}: {error.what}", got=got, expected=expected, hint=error.hint)
    folder = os.path.realpath(path.parent)
    for _, name in found:
        if not Path(os.path.realpath(path.parent / name)).is_relative_to(folder):
            return node.reject("a step outside of its folder", got=short_text(name), expected=f"a file in {folder}")
    source = _steps(node, [(time, replace(node, value=name, base=path.parent)) for time, name in found])
    if source is INVALID:
        return INVALID
    return replace(source, times=tuple(sorted(time for time, _ in found)), collection=path)


def file_source(volume: Path | str) -> FileSource | UrlSource:
    """Return the source of a file or a folder, or of the steps that a pattern or a collection of ParaView names.

    volume: a path, or a text that is the URL of a store.

    Raises SceneError if the steps are wrong; its problems are located at the given name.
    """
    if isinstance(volume, Path) and volume.suffix.lower() != ".pvd" and not is_pattern(volume):
        return FileSource(volume)
    problems: list[Problem] = []
    source = schema.read_option(SOURCE_FIELD, str(volume), str(volume), problems)
    if problems:
        raise SceneError(problems)
    return source
