"""Read what kernels take from each `kernels.h` in the folders of `sources/`, and lay it out in memory as C does."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

# The number of a dtype in an AnyArray is its place here (`with_array` in arrays.h).
DTYPES = tuple(np.dtype(name) for name in ("u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"))

_NUMBERS = {
    "bool": ("?", np.bool_), "uint8_t": ("B", np.uint8), "int8_t": ("b", np.int8), "uint16_t": ("H", np.uint16),
    "int16_t": ("h", np.int16), "uint32_t": ("I", np.uint32), "int32_t": ("i", np.int32), "uint64_t": ("Q", np.uint64),
    "int64_t": ("q", np.int64), "float": ("f", np.float32), "double": ("d", np.float64),
}  # fmt: skip
_STRUCT = re.compile(r"^struct (\w+) \{\n(.*?)^\};", re.DOTALL | re.MULTILINE)
_KERNEL = re.compile(r"^(LONG_)?KERNEL\((\w+), (\w+)\)", re.MULTILINE)
# The type of some members, then their names.
_MEMBERS = re.compile(r"((?:const )?\w+(?:<.*>)?) ([^<>]+);")
_MEMBER = re.compile(r"(\w+)(?:\[(\d+)\])?")
_ARRAY = re.compile(r"(?:Array|Sized)<(const )?(\w+), (\d)((?:, \d+)*)>")
_ANY_ARRAY = re.compile(r"AnyArray<(\d)>")
_MAYBE = re.compile(r"Maybe<(.*)>")


class Type:
    """A type of a member. format: its layout, as one of Python's `struct`, a letter for each number or byte of padding.

    num_numbers: how many numbers it takes. alignment: in bytes.
    """

    def __init__(self, format: str) -> None:
        self.format, self.size = format, struct.calcsize("=" + format)
        self.num_numbers = len(format) - format.count("x")
        self.alignment = max(struct.calcsize("=" + number) for number in format)

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        """Append the numbers of a value, and to `kept` what must live as long as they are used.

        Raises TypeError or ValueError, which say what is wrong.
        """
        numbers.append(value)


class _Several(Type):
    def __init__(self, one: str, dtype: type[Any], count: int) -> None:
        super().__init__(one * count)
        self._dtype = dtype

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        found = value if isinstance(value, tuple) else np.asarray(value, self._dtype).ravel().tolist()
        if len(found) != self.num_numbers:
            raise ValueError(f"{len(found)} numbers, expected {self.num_numbers}")
        numbers += found


class _Array(Type):
    """dtype: None for any of DTYPES, whose number then follows the shape. last: the last sizes of the shape."""

    def __init__(self, dtype: Any, dimensions: int, last: tuple[int, ...], *, is_written: bool) -> None:
        super().__init__("q" * (1 + dimensions + (dtype is None)))
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
        flags = value.flags  # not `aligned`: what came from another process or from a file may lie at any address
        if not flags.c_contiguous or self._is_written > flags.writeable:
            raise ValueError("not contiguous, or read-only where the kernel writes")
        kept.append(value)
        numbers += (value.ctypes.data, *value.shape)
        if self._dtype is None:
            numbers.append(DTYPES.index(value.dtype))


class _Structs(Type):
    """An array of structs, made from a sequence of what each is filled from."""

    def __init__(self, one: Type) -> None:
        super().__init__("qq")
        self._one = one

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        content: list[Any] = []
        for each in value:
            self._one.add(each, content, kept)
        kept.append(np.frombuffer(struct.pack("=" + self._one.format * len(value), *content), np.uint8))
        numbers += (kept[-1].ctypes.data, len(value))


class _Maybe(Type):
    def __init__(self, one: Type) -> None:
        super().__init__("?" + "x" * (one.alignment - 1) + one.format)
        self._one = one

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        numbers.append(value is not None)
        if value is None:
            numbers += [0] * self._one.num_numbers
        else:
            self._one.add(value, numbers, kept)


class Struct(Type):
    """A struct that kernels take. members: by name, the offset and the type of each."""

    def __init__(self, members: list[tuple[str, Type]]) -> None:
        self.members: dict[str, tuple[int, Type]] = {}
        format = ""
        for name, one in members:
            format += "x" * (-struct.calcsize("=" + format) % one.alignment)
            self.members[name] = struct.calcsize("=" + format), one
            format += one.format
        alignment = max(one.alignment for _, one in members)
        super().__init__(format + "x" * (-struct.calcsize("=" + format) % alignment))

    def add(self, value: Any, numbers: list[Any], kept: list[Any]) -> None:
        for name, (_, one) in self.members.items():
            try:
                one.add(value[name] if isinstance(value, dict) else getattr(value, name), numbers, kept)
            except (TypeError, ValueError, KeyError) as error:
                raise type(error)(f"{name}: {error}") from None


class Header:
    """A table of the structs in the texts of headers, each of which is read when it is first needed.

    arguments: by kernel, the name of the struct that it takes. long_kernels: those that stop when they are asked to.
    """

    def __init__(self, text: str) -> None:
        self._bodies = dict(_STRUCT.findall(text))
        found = _KERNEL.findall(text)
        self.arguments: dict[str, str] = {name: arguments for _, name, arguments in found}
        self.long_kernels = frozenset(name for long, name, _ in found if long)

    def struct_of(self, kernel: str) -> Struct:
        """Return the struct that a kernel takes."""
        return self._struct(self.arguments[kernel])

    def _struct(self, name: str) -> Struct:
        lines = (line for line in self._bodies[name].splitlines() if ";" in line)
        return Struct([member for line in lines for member in self._read_members(line)])

    def _type(self, name: str) -> Type:
        if name in _NUMBERS:
            return Type(_NUMBERS[name][0])
        if found := _ARRAY.fullmatch(name):
            const, kind, dimensions, last = found.groups()
            if kind not in _NUMBERS:
                return _Structs(self._struct(kind))
            sizes = tuple(int(size) for size in re.findall(r"\d+", last))
            return _Array(np.dtype(_NUMBERS[kind][1]), int(dimensions), sizes, is_written=not const)
        if found := _ANY_ARRAY.fullmatch(name):
            return _Array(None, int(found[1]), (), is_written=False)
        if found := _MAYBE.fullmatch(name):
            return _Maybe(self._type(found[1]))
        return self._struct(name)

    def _read_members(self, line: str) -> Iterator[tuple[str, Type]]:
        found = _MEMBERS.fullmatch(line.partition("//")[0].strip())
        assert found is not None, f"cannot read {line!r}"
        kind, names = found.groups()
        for name, count in _MEMBER.findall(names):
            yield name, _Several(*_NUMBERS[kind], int(count)) if count else self._type(kind)


def read_headers(sources: Path) -> Header:
    """Read the headers of all folders of the sources."""
    return Header("\n".join(path.read_text("ascii") for path in sorted(sources.glob("*/kernels.h"))))
