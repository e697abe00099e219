"""Find the data files that NRRD and MetaImage headers name: one file, a list, or a pattern with numbers."""

from __future__ import annotations

import math
import os
import re
from pathlib import Path

from renderer.errors import InputError
from renderer.readers.file_errors import require_exists
from renderer.readers.foreign import refuse_pointer
from renderer.readers.voxel_limits import describe_count, describe_shape
from renderer.scene import short_text

# A pattern of numbered data files with first number, last number and step, such as `slice%03d.raw 1 60 1`. MetaImage
# may leave out some of the numbers. Only the conversion `%d`, with or without a width, is accepted.
_NUMBERED = re.compile(
    r"([^%]*)%(0?[0-9]?)d([^%]*?)"
    r"(?:\s{1,9}([0-9]{1,9})(?:\s{1,9}([0-9]{1,9})(?:\s{1,9}(-?[1-9][0-9]{0,8})(?:\s{1,9}([0-9]{1,2}))?)?)?)?"
)
# A list of data files. Like a pattern, it may end with the number of axes in each file.
_LIST = re.compile(r"LIST(?:\s+([0-9]{1,2})D?)?", re.IGNORECASE)

# The largest number of data files that a header may name: more than any volume has slices. The limit is needed because
# a short pattern can name any number of files.
_MAX_FILES = 2**16


def find_data_files(header: Path, name: str, listed: list[str], shape: tuple[int, ...]) -> tuple[list[Path], int]:
    """Return the data files in order, and along how many of the slowest axes they divide the array: 0 for one file.

    name: one file, `LIST`, or a pattern. listed: the lines below the header. shape: the shape of the whole array, from
        the slowest axis to the fastest. Each file may also be a slab, which has all axes: slabs have equally many steps
        along the slowest axis. Raises InputError for files that are missing, too few or too many,
        and for names of another form.
    """
    name = unquoted(header, name)
    numbered, is_list = _NUMBERED.fullmatch(name), _LIST.fullmatch(name)
    if numbered is None and is_list is None and ("%" not in name or named_file(header, name).is_file()):
        return [_data_file(header, name)], 0
    num_axes, num_files = None, 0
    if numbered is not None:
        before, width, after, *words, num_axes = numbered.groups()
        first, last, step = (None if word is None else int(word) for word in words)
        first, step = 1 if first is None else first, step or 1
        last = first + shape[0] - 1 if last is None else last
        numbers = range(first, last + (1 if step > 0 else -1), step)
        num_files = len(numbers)
    elif is_list is not None:
        num_axes, num_files = is_list[1], len(listed)
    num_split = len(shape) - int(num_axes) if num_axes else 1
    are_slabs = num_split == 0
    if num_files == 0 or not 0 <= num_split < len(shape):
        raise InputError(
            "data files cannot be named in this way",
            got=short_text(name),
            expected="one file, LIST, or a pattern with first number, last and step, such as slice%03d.raw 1 60 1",
            hint="write LIST, and below it the name of the file of each slice on its own line",
        )
    if are_slabs and shape[0] % num_files:
        raise InputError(
            "these data files cannot each have as many slices",
            got=f"{num_files} files for {shape[0]} slices",
            expected=f"a number of files that divides {shape[0]}",
            hint="without the number of axes behind LIST, each file has one slice",
        )
    num_expected = num_files if are_slabs else math.prod(shape[:num_split])
    if num_files != num_expected:
        raise InputError(
            f"this header names too {'few' if num_files < num_expected else 'many'} data files",
            got=str(num_files),
            expected=f"{describe_count(num_expected)}, one for each {describe_shape(shape[num_split:][::-1])} of "
            f"{describe_shape(shape[::-1])} voxels",
        )
    if num_files > _MAX_FILES:
        raise InputError("this header names too many data files", got=str(num_files), expected=f"at most {_MAX_FILES}")
    names = [f"{before}{number:{width}d}{after}" for number in numbers] if numbered is not None else listed
    return [_data_file(header, each) for each in names], max(num_split, 1)


def unquoted(header: Path, name: str) -> str:
    """Return a file name of a header without the quotes around it, unless a file has the name with its quotes."""
    inside, mark = name[1:-1], name[:1]
    is_quoted = mark in ("'", '"') and name.endswith(mark) and inside != "" and mark not in inside
    return inside if is_quoted and not named_file(header, name).is_file() else name


def named_file(header: Path, name: str) -> Path:
    """Return the path of a data file: beside its header, or, where the header is a link, beside the link's target."""
    beside = header.parent / name
    target = Path(os.path.realpath(header)).parent / name
    return target if header.is_symlink() and target.is_file() and not beside.is_file() else beside


def _data_file(header: Path, name: str) -> Path:
    file = named_file(header, unquoted(header, name))
    if not file.is_file():
        raise InputError(
            "the data file that this header names is not there",
            got=short_text(name),
            expected=f"a file {short_text(str(file))}",
            hint="the two belong together: move or copy both",
        )
    refuse_pointer(require_exists(file))
    return file
