"""Guess the shape and the type of voxels without a header from the name and the size of their file."""

from __future__ import annotations

import math
import re
from pathlib import Path
from typing import NamedTuple

# Three sizes in a name, such as 256x256x113 and 128_128_64.
_SIZES = re.compile(r"(?<![0-9])(?<![0-9]\.)([1-9][0-9]{0,5})[x_-]([1-9][0-9]{0,5})[x_-]([1-9][0-9]{0,5})(?![0-9])")
# A type in a name, such as uint16 and float_32.
_TYPE = re.compile(r"(?<![a-z])(u|unsigned|uint|int|i|s|float|f)[_-]?(8|16|32|64)(?:bits?|_t)?(?![0-9a-z])")
# The type that a word in a name stands for.
_WORDS = {
    "uchar": "uint8",
    "byte": "uint8",
    "schar": "int8",
    "ushort": "uint16",
    "short": "int16",
    "float": "float32",
    "double": "float64",
}
# The kind of number that the letters before the number of bits stand for, such as u in u16. All other letters stand for
# floats.
_KINDS = {"u": "uint", "unsigned": "uint", "uint": "uint", "int": "int", "i": "int", "s": "int"}
# The words in a name that say that the most significant byte of a number comes first.
_BIG_ENDIAN = ("be", "msb", "bigendian")
# The type that is assumed for voxels of a number of bytes, if the name has no type.
_USUAL = {1: "uint8", 2: "uint16", 4: "float32", 8: "float64"}


class Declaration(NamedTuple):
    """A declaration of the shape and the type of voxels without a header, which fits the size of their file.

    is_guess: whether the type is a guess, as the name of the file has none.
    """

    shape: tuple[int, int, int]
    dtype: str
    is_big_endian: bool
    is_guess: bool

    @property
    def remark(self) -> str:
        """Return a remark on how certain the declaration is."""
        return "its name and size fit" + "; the type is a guess" * self.is_guess


def declaration_in_name(path: Path) -> Declaration | None:
    """Return the declaration in the name of a file; None if it has none, or the size of the file does not fit it."""
    name = path.name.rpartition(".")[0].lower()
    found = _SIZES.search(name)
    if found is None or not path.is_file():
        return None
    shape = int(found[1]), int(found[2]), int(found[3])
    rest = name[: found.start()] + " " + name[found.end() :]
    dtype = _type_in(rest)
    num_bytes, left = divmod(path.stat().st_size, math.prod(shape))
    known = dtype or _USUAL.get(num_bytes)
    if left or known is None or _itemsize(known) != num_bytes:
        return None
    is_big = num_bytes > 1 and any(word in _BIG_ENDIAN for word in re.split("[^a-z]", rest))
    return Declaration(shape, known, is_big, dtype is None)


def _itemsize(dtype: str) -> int:
    """Return how many bytes a number of a type has.

    dtype: the name of the type, which ends with the number of bits, such as uint16. numpy would know the bytes, but
    `hsplat check` does not load numpy.
    """
    return int(re.sub("[a-z]+", "", dtype)) // 8


def _type_in(name: str) -> str | None:
    found = _TYPE.search(name)
    if found:
        dtype = f"{_KINDS.get(found[1], 'float')}{found[2]}"
        return dtype if dtype != "float8" else None
    words = re.split("[^a-z]", name)
    return next((dtype for word, dtype in _WORDS.items() if word in words), None)
