"""Call kernels through ctypes.

    kernels().bin_bricks(tile_windows=windows, num_columns=3, ...)
    draw = kernels().draw_tiles.partial(bins=bins, stride=1, ...)   # checked and converted once
    draw(tiles=tiles)                                               # on any thread

Every array is checked: its dtype, its number of dimensions, that it is contiguous, and writeable where the kernel
writes. ctypes releases the interpreter's lock.
"""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Callable
from functools import cache
from typing import Any

from renderer.kernels.build import SOURCES
from renderer.kernels.header import Header, Struct
from renderer.kernels.library import load_library

_STATUS = {1: MemoryError, 2: IndexError}


class Kernel:
    """A kernel, as a function of keyword arguments: the members of its struct in kernels.h."""

    def __init__(self, name: str, function: Any, arguments: Struct) -> None:
        function.argtypes, function.restype = [ctypes.c_char_p], ctypes.c_int32
        self._name, self._function, self._arguments = name, function, arguments
        self._layouts = {key: struct.Struct("=" + one.format) for key, (_, one) in arguments.members.items()}

    def __call__(self, **values: Any) -> None:
        """Run the kernel. Raise MemoryError, or IndexError for shapes that do not fit together.

        Raises TypeError or ValueError where an argument is not what the kernel takes.
        """
        self.partial(**values)()

    def partial(self, **values: Any) -> Callable[..., None]:
        """Return a function of the other arguments; these are checked and converted once. Threads may share it."""
        given = bytearray(self._arguments.size)
        kept: list[Any] = []
        self._fill(given, values, kept)

        def call(**others: Any) -> None:
            block, also_kept = bytearray(given), [kept]
            self._fill(block, others, also_kept)
            if missing := self._layouts.keys() - values.keys() - others.keys():
                raise TypeError(f"{self._name}: no {', '.join(missing)}")
            if status := self._function(bytes(block)):
                raise _STATUS[status](self._name)

        return call

    def _fill(self, block: bytearray, values: dict[str, Any], kept: list[Any]) -> None:
        members, layouts = self._arguments.members, self._layouts
        for key, value in values.items():
            if key not in layouts:
                raise TypeError(f"{self._name}: no argument {key}")
            offset, kind = members[key]
            numbers: list[Any] = []
            try:
                kind.add(value, numbers, kept)
                layouts[key].pack_into(block, offset, *numbers)
            except (TypeError, ValueError, struct.error) as error:
                kind_of_error = TypeError if isinstance(error, struct.error) else type(error)
                raise kind_of_error(f"{self._name}: {key}: {error}") from None


class Kernels:
    """A library's kernels, as attributes."""

    def __init__(self, library: ctypes.CDLL, header: Header) -> None:
        self._library, self._header = library, header

    def __getattr__(self, name: str) -> Kernel:
        if name not in self._header.arguments:
            raise AttributeError(name)
        arguments = self._header.struct_of(name)
        size = ctypes.c_int64.in_dll(self._library, f"{name}_bytes").value
        assert size == arguments.size, f"{name} takes {size} bytes, and kernels.h is read as {arguments.size}"
        kernel = Kernel(name, getattr(self._library, name), arguments)
        setattr(self, name, kernel)
        return kernel


@cache
def kernels() -> Kernels:
    """Return the kernels for this processor. Raise RenderError where they cannot be loaded."""
    return Kernels(load_library(), Header((SOURCES / "kernels.h").read_text("ascii")))
