"""Read the structs of kernels from each `kernels.h` in the folders of `sources/`, and lay them out as C does."""

from __future__ import annotations

import re
import struct
from itertools import takewhile
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

# The dtypes that arrays may have where a kernel does not fix the dtype. Kernels get the position of an array's dtype in
# this tuple (`with_array` in arrays.h).
DTYPES = tuple(np.dtype(name) for name in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"))

# For each number type of C++, its letter in Python's `struct`, its dtype, and the type of Python that fills it.
_NUMBERS = {
    "bool": ("?", np.bool_, "bool"),
    "uint8_t": ("B", np.uint8, "int"),
    "int8_t": ("b", np.int8, "int"),
    "uint16_t": ("H", np.uint16, "int"),
    "int16_t": ("h", np.int16, "int"),
    "uint32_t": ("I", np.uint32, "int"),
    "int32_t": ("i", np.int32, "int"),
    "uint64_t": ("Q", np.uint64, "int"),
    "int64_t": ("q", np.int64, "int"),
    "float": ("f", np.float32, "float"),
    "double": ("d", np.float64, "float"),
}
_STRUCT = re.compile(r"struct (\w+) \{")
_KERNEL = re.compile(r"(LONG_)?KERNEL\((\w+), (\w+)\)")
_MEMBER = re.compile(r"(EACH_CALL )?((?:const )?\w+(?:<.*>)?) (\w+)(?:\[(\d+)\])?;")
_ARRAY = re.compile(r"(?:Array|Sized)<(const )?(\w+), (\d)((?:, \d+)*)>")
_ANY_ARRAY = re.compile(r"AnyArray<(\d)>")
_MAYBE = re.compile(r"Maybe<(.*)>")


class Type:
    """The type of a member of a struct.

    format: the member's layout in the language of Python's `struct`, one letter for each number or byte of padding.
    annotation: the Python type of the values that fill the member.
    size: the member's size in bytes.
    num_numbers: how many numbers fill the member.
    alignment: the member's alignment in bytes.
    """

    def __init__(self, format: str, annotation: str) -> None:
        self.format, self.annotation = format, annotation
        self.size = struct.calcsize("=" + format)
        self.num_numbers = len(format) - format.count("x")
        self.alignment = max(struct.calcsize("=" + number) for number in format)

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        """Append the numbers that stand for a value in the struct to `numbers`.

        Objects whose memory the numbers point to are appended to `kept`: they must live as long as the numbers are
        used. Raises TypeError or ValueError, which say what is wrong with the value.
        """
        numbers.append(value)


class _Several(Type):
    """The type of a member with a fixed number of values, such as `double x[3]`.

    Integers are filled from a tuple, floats from an array: a vector or a matrix.
    """

    def __init__(self, kind: str, count: int) -> None:
        one, self._dtype, annotation = _NUMBERS[kind]
        is_whole = annotation == "int"
        super().__init__(one * count, f"tuple[{', '.join(['int'] * count)}]" if is_whole else "NDArray[np.float64]")

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        found = value if isinstance(value, tuple) else np.asarray(value, self._dtype).ravel().tolist()
        if len(found) != self.num_numbers:
            raise ValueError(f"{len(found)} numbers, expected {self.num_numbers}")
        numbers += found


class _Array(Type):
    """The type of a member that is an array of numbers: an address and a shape.

    dtype: the dtype of the numbers; None for an array of any dtype, whose position in DTYPES then follows the shape.
    last: the last sizes of the shape, if they are fixed.
    is_written: whether the kernel writes to the array.
    """

    def __init__(self, dtype: Any, dimensions: int, last: tuple[int, ...], *, is_written: bool) -> None:
        element = "Any" if dtype is None else f"np.{np.dtype(dtype).type.__name__}"
        super().__init__("q" * (1 + dimensions + (dtype is None)), f"NDArray[{element}]")
        self._dtype, self._dimensions, self._last, self._is_written = dtype, dimensions, last, is_written

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        if not isinstance(value, np.ndarray):
            raise TypeError(f"{type(value).__name__}, expected an array")
        is_right = value.dtype in DTYPES if self._dtype is None else value.dtype == self._dtype
        if not is_right or value.ndim != self._dimensions:
            expected = f"{self._dtype or 'a number'} [{self._dimensions}]"
            raise TypeError(f"{value.dtype} [{value.ndim}], expected {expected}")
        if value.shape[value.ndim - len(self._last) :] != self._last:
            raise ValueError(f"shape {value.shape}, expected the last sizes {self._last}")
        flags = value.flags  # alignment is not required: arrays from a file or another process may lie anywhere
        if not flags.c_contiguous or self._is_written > flags.writeable:
            raise ValueError("not contiguous, or read-only where the kernel writes")
        kept.append(value)
        numbers += (value.ctypes.data, *value.shape)
        if self._dtype is None:
            numbers.append(DTYPES.index(value.dtype))


class _Structs(Type):
    """The type of a member that is an array of structs, which is filled from a sequence of records."""

    def __init__(self, one: Type) -> None:
        super().__init__("qq", f"Sequence[{one.annotation}]")
        self._one = one

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        content: list[Any] = []
        for each in value:
            self._one.add(each, content, kept)
        kept.append(np.frombuffer(struct.pack("=" + self._one.format * len(value), *content), np.uint8))
        numbers += (kept[-1].ctypes.data, len(value))


class _Maybe(Type):
    """The type of a member that may be None: a flag, followed by the value."""

    def __init__(self, one: Type) -> None:
        super().__init__("?" + "x" * (one.alignment - 1) + one.format, f"{one.annotation} | None")
        self._one = one

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        numbers.append(value is not None)
        if value is None:
            numbers += [0] * self._one.num_numbers
        else:
            self._one.add(value, numbers, kept)


class Member(NamedTuple):
    """A member of a struct.

    offset: the offset in the struct, in bytes.
    comment: the lines of the comment above the member.
    is_of_call: whether the member is marked EACH_CALL: it is given anew in each call of what `Kernel.partial` returns.
    """

    type: Type
    offset: int
    comment: list[str]
    is_of_call: bool


class Struct(Type):
    """A struct that kernels take. comment: the lines of the comment above it. members: its members, by name."""

    def __init__(self, name: str, comment: list[str], members: dict[str, tuple[Type, list[str], bool]]) -> None:
        self.comment = comment
        self.members: dict[str, Member] = {}
        format = ""
        for key, (one, of_member, is_of_call) in members.items():
            format += "x" * (-struct.calcsize("=" + format) % one.alignment)
            self.members[key] = Member(one, struct.calcsize("=" + format), of_member, is_of_call)
            format += one.format
        alignment = max(one.type.alignment for one in self.members.values())
        super().__init__(format + "x" * (-struct.calcsize("=" + format) % alignment), name)

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        for name, member in self.members.items():
            try:
                member.type.add(getattr(value, name), numbers, kept)
            except (TypeError, ValueError) as error:
                raise type(error)(f"{name}: {error}") from None


class Header:
    """A table of the structs in the text of headers. A struct is laid out when it is asked for.

    names: the names of all structs, in their order.
    arguments: for each kernel, the name of the struct that it takes.
    long_kernels: the names of the kernels that stop when the process is asked to end.
    """

    def __init__(self, text: str) -> None:
        # For each struct, the lines of its comment and of its body.
        self._texts: dict[str, tuple[list[str], list[str]]] = {}
        self.arguments: dict[str, str] = {}
        long_kernels = set()
        comment: list[str] = []
        lines = iter(text.splitlines())
        for line in lines:
            if line.startswith("//"):
                comment.append(_comment_of(line))
                continue
            if found := _STRUCT.fullmatch(line):
                self._texts[found[1]] = comment, list(takewhile(lambda each: each != "};", lines))
            elif found := _KERNEL.fullmatch(line):
                is_long, name, arguments = found.groups()
                self.arguments[name] = arguments
                if is_long:
                    long_kernels.add(name)
            comment = []
        self.names = tuple(self._texts)
        self.long_kernels = frozenset(long_kernels)

    def struct_of(self, kernel: str) -> Struct:
        """Return the struct that a kernel takes."""
        return self.struct_named(self.arguments[kernel])

    def struct_named(self, name: str) -> Struct:
        """Return a struct. An assertion fails if a line of the struct cannot be read."""
        comment_of_struct, lines = self._texts[name]
        members: dict[str, tuple[Type, list[str], bool]] = {}
        comment: list[str] = []
        for line in map(str.strip, lines):
            if line.startswith("//"):
                comment.append(_comment_of(line))
                continue
            found = _MEMBER.fullmatch(line)
            assert found is not None, f"cannot read {line!r}"
            is_of_call, kind, key, count = found.groups()
            members[key] = _Several(kind, int(count)) if count else self._type(kind), comment, bool(is_of_call)
            comment = []
        return Struct(name, comment_of_struct, members)

    def _type(self, name: str) -> Type:
        if name in _NUMBERS:
            letter, _, annotation = _NUMBERS[name]
            return Type(letter, annotation)
        if found := _ARRAY.fullmatch(name):
            const, kind, dimensions, last = found.groups()
            if kind not in _NUMBERS:
                return _Structs(self.struct_named(kind))
            sizes = tuple(int(size) for size in re.findall(r"\d+", last))
            return _Array(np.dtype(_NUMBERS[kind][1]), int(dimensions), sizes, is_written=not const)
        if found := _ANY_ARRAY.fullmatch(name):
            return _Array(None, int(found[1]), (), is_written=False)
        if found := _MAYBE.fullmatch(name):
            return _Maybe(self._type(found[1]))
        return self.struct_named(name)


def _comment_of(line: str) -> str:
    return line.removeprefix("//").removeprefix(" ")


def read_headers(sources: Path) -> Header:
    """Read the headers `kernels.h` in all folders of the sources."""
    return Header("\n".join(path.read_text("ascii") for path in sorted(sources.glob("*/kernels.h"))))
