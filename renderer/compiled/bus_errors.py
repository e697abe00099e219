"""A handler of SIGBUS, which a read beyond the end of a mapped file raises, also in the middle of a compiled loop.

Where the file of a guarded region has become shorter, it maps zeros in place of what is gone, and the loop goes on.
Other causes of SIGBUS, such as a broken disk, go to the former handler: they still kill. The handler is compiled,
because handlers in Python run between two bytecodes, and a loop has none. It calls only lseek, mmap, sigaction and
raise. It exists on 64-bit Linux alone, whose structures it knows.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import platform
import signal
import sys
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.compiled.lanes import intrinsic
from renderer.compiled.numba_inside import import_functions, numba, types

# Regions that can be guarded at once.
_MOST = 64
# Constants of sigaction(2) and mmap(2) that Python lacks; the last one reserves no memory for what is not written.
_SA_SIGINFO, _MAP_FIXED, _MAP_NORESERVE = 4, 0x10, 0x4000
# siginfo_t.si_code is the lower half of a word: positive and small for a fault, but not for a signal that was sent.
_LOW_BITS, _MAX_FAULT_CODE = 0xFFFFFFFF, 0xFFFF


def guarded_regions() -> npt.NDArray[np.int64]:
    """Return the regions that are guarded, for the caller to fill; none on systems without the handler.

    They are int64 [n, 4]: the addresses of the first byte and beyond the last, whole pages, 0 for a free region; the
    descriptor and the length of the file. Set the second number last.
    """
    if not (sys.platform == "linux" and platform.machine() in ("x86_64", "aarch64") and sys.maxsize > 1 << 32):
        return np.zeros((0, 4), np.int64)
    regions, *_ = _install_handler()
    return regions


@cache
def _install_handler() -> tuple[npt.NDArray[np.int64], Any, Any]:
    """Compile and install the handler, once; return what it needs while the process lives.

    That is its regions, the former action, as sigaction(2) has it, and the compiled function.
    """
    regions = np.zeros((_MOST, 4), np.int64)
    # The structure on both processors: the function, a mask of 128 bytes, flags, and a function of libc.
    before, action = np.zeros(19, np.int64), np.zeros(19, np.int64)
    handler = _compile_handler(regions.ctypes.data, before.ctypes.data)
    action[0] = handler.address
    action[17:18].view(np.int32)[0] = _SA_SIGINFO
    sigaction = _libc_function("sigaction", 3, ctypes.c_int)
    if sigaction(signal.SIGBUS, 0, before.ctypes.data) == 0:  # first: a fault may come at once
        sigaction(signal.SIGBUS, action.ctypes.data, 0)
    return regions, before, handler


def _libc_function(name: str, num_arguments: int, result: Any = ctypes.c_int64) -> Any:
    """Return a function of libc that takes 64-bit integers, which these processors allow for shorter ones."""
    function = getattr(ctypes.CDLL(None), name)
    function.argtypes, function.restype = (ctypes.c_int64,) * num_arguments, result
    return function


_WORDS = types.CPointer(types.int64)


@intrinsic
def _words_at(_: Any, address: Any) -> Any:
    """Return a pointer to the 64-bit words at an address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

    return _WORDS(types.int64), generate


def _compile_handler(regions_address: int, before_address: int) -> Any:
    import_functions()
    lseek, map_memory = _libc_function("lseek", 3), _libc_function("mmap", 6)
    sigaction, send = _libc_function("sigaction", 3, ctypes.c_int), _libc_function("raise", 1, ctypes.c_int)
    page, to_end, readable = mmap.PAGESIZE, os.SEEK_END, mmap.PROT_READ
    zeros = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | _MAP_FIXED | _MAP_NORESERVE

    def handle(number: Any, information: Any, _: Any) -> None:
        fault = information[2]  # siginfo_t.si_addr
        regions = _words_at(regions_address)
        for index in range(0, 4 * _MOST, 4):
            if regions[index] <= fault < regions[index + 1]:
                length = lseek(regions[index + 2], 0, to_end)
                if 0 <= length < regions[index + 3]:
                    # To the end, which is gone, too: single pages could exceed the number of maps.
                    first = fault & -page
                    if map_memory(first, regions[index + 1] - first, readable, zeros, -1, 0) == first:
                        return
        sigaction(number, before_address, 0)  # the same instruction faults again
        if not 0 < (information[1] & _LOW_BITS) <= _MAX_FAULT_CODE:  # it was sent, and comes when this returns
            send(number)

    return numba.cfunc(types.void(types.int32, _WORDS, types.voidptr))(handle)
