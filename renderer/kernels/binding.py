"""Call kernels through ctypes.

    kernels().bin_bricks(tile_windows=windows, starts=starts, ...)
    draw = kernels().draw_tiles.partial(grid=grid, bricks=bricks, ...)   # checked and converted once
    draw(tiles=tiles)                                                    # on any thread

Every array is checked: its dtype, its number of dimensions, that it is contiguous, and writeable where the kernel
writes. ctypes releases the interpreter's lock.

Long kernels stop when the process is asked to end, and then raise KeyboardInterrupt. Python handles signals in the main
thread, and never inside a kernel: so another thread runs the long kernels that the main thread calls.
"""

from __future__ import annotations

import ctypes
import struct
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from renderer.kernels.build import SOURCES
from renderer.kernels.header import Header, Struct, read_headers
from renderer.kernels.library import load_library
from renderer.system import deferrable_interrupts, result_of, start_threads, stop_flag

if TYPE_CHECKING:
    from renderer.kernels import signatures

# The exceptions that are raised for the statuses that kernels return (`Status` in arrays.h).
_STATUS = {1: MemoryError, 2: IndexError}
# The status that a long kernel returns if it stopped because the process was asked to end.
STOPPED = 3


class Kernel:
    """A compiled kernel, called as a function. Its keyword arguments are the members of the kernel's struct.

    is_long: whether the kernel stops when the process is asked to end.
    """

    def __init__(self, name: str, function: Any, arguments: Struct, *, is_long: bool) -> None:
        function.argtypes, function.restype = [ctypes.c_char_p], ctypes.c_int32
        self._name = name
        self._function = function
        self._arguments = arguments
        self._is_long = is_long
        self._layouts = {key: struct.Struct("=" + one.type.format) for key, one in arguments.members.items()}

    def __call__(self, **values: Any) -> None:
        """Run the kernel.

        Raises MemoryError without memory, IndexError for arrays whose shapes do not fit together, TypeError or
        ValueError for an argument that the kernel does not take, and KeyboardInterrupt, with the number of the signal,
        if a long kernel was stopped.
        """
        self.partial(**values)()

    def partial(self, **values: Any) -> Callable[..., None]:
        """Return a function that runs the kernel with the given arguments, and takes the remaining ones.

        The given arguments are checked and converted once. Several threads may call the function at the same time.
        """
        given = bytearray(self._arguments.size)
        kept: list[Any] = []
        self._fill(given, values, kept)

        def call(**others: Any) -> None:
            block, also_kept = bytearray(given), [kept]
            self._fill(block, others, also_kept)
            if missing := self._layouts.keys() - values.keys() - others.keys():
                raise TypeError(f"{self._name}: no {', '.join(missing)}")
            is_main = threading.current_thread() is threading.main_thread()
            run = self._run_beside if self._is_long and is_main else self._run
            status = run(bytes(block), also_kept)
            if status == STOPPED:
                raise KeyboardInterrupt(stop_flag.value)
            if status:
                raise _STATUS[status](self._name)

        return call

    def _run(self, block: bytes, kept: list[Any]) -> int:
        """Run the kernel, and return its status.

        block: the bytes of the kernel's struct. kept: the objects whose memory the struct points to. The caller holds
        them, so that they live as long as the kernel runs.
        """
        return int(self._function(block))

    def _run_beside(self, block: bytes, kept: list[Any]) -> int:
        """Run the kernel on another thread, so that this thread can handle a signal while the kernel runs.

        Signals are held back until `running`, by which this thread waits for the kernel, is set. Otherwise an exception
        in between would leave a running kernel that nobody waits for.
        """
        running: Future[int] | None = None
        try:
            with deferrable_interrupts() as defer:
                defer()
                running = _thread_of_long_kernels().submit(self._run, block, kept)
            return result_of(running)
        except KeyboardInterrupt:
            if running is not None:
                wait([running])
            raise

    def _fill(self, block: bytearray, values: dict[str, Any], kept: list[Any]) -> None:
        members, layouts = self._arguments.members, self._layouts
        for key, value in values.items():
            if key not in layouts:
                raise TypeError(f"{self._name}: no argument {key}")
            member = members[key]
            numbers: list[Any] = []
            try:
                member.type.add(value, numbers, kept)
                layouts[key].pack_into(block, member.offset, *numbers)
            except (TypeError, ValueError, struct.error) as error:
                kind_of_error = TypeError if isinstance(error, struct.error) else type(error)
                raise kind_of_error(f"{self._name}: {key}: {error}") from None


class Kernels:
    """A loaded library, with each of its kernels as an attribute."""

    def __init__(self, library: ctypes.CDLL, header: Header) -> None:
        self._library, self._header = library, header

    def __getattr__(self, name: str) -> Kernel:
        if name not in self._header.arguments:
            raise AttributeError(name)
        arguments = self._header.struct_of(name)
        size = ctypes.c_int64.in_dll(self._library, f"{name}_bytes").value
        assert size == arguments.size, f"{name} takes {size} bytes, and the header is read as {arguments.size}"
        is_long = name in self._header.long_kernels
        kernel = Kernel(name, getattr(self._library, name), arguments, is_long=is_long)
        setattr(self, name, kernel)
        return kernel


@cache
def kernels() -> signatures.Kernels:
    """Return the kernels for this processor. Raise RenderError if they cannot be loaded."""
    found = Kernels(load_library(), read_headers(SOURCES))
    found.heed_flag(flag=np.frombuffer(memoryview(stop_flag), np.int32))
    return cast("signatures.Kernels", found)


@cache
def _thread_of_long_kernels() -> ThreadPoolExecutor:
    """Return the pool of one thread, which runs the long kernels that the main thread calls."""
    return start_threads(1, "hsplat-kernels")
