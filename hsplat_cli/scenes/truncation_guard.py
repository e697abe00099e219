"""Files that become shorter while voxels are mapped from them: zeros in place of a signal that kills.

A page beyond the end of a file cannot be read, and the kernel tells by SIGBUS, in the middle of whatever compiled loop
reads it. The handler here gives the rest of the array memory of zeros, so that the loop ends; `renderer` looks at the
file after everything that it reads of it, and raises InputError. All that is not the loss of such a file, as a disk
that cannot be read or shared memory that has run out, is left to what handled the signal before: it kills as ever.

The handler is compiled, for Python's own run between two bytecodes, and none of them comes before the loop goes on. It
calls nothing but lseek, mmap, sigaction and raise. It is there on Linux of 64 bits only, whose structures it knows.
"""

from __future__ import annotations

import ctypes
import mmap
import os
import platform
import signal
import sys
import weakref
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.readers import read_volume
from renderer.scene import VolumeSpec
from renderer.volume import MappedFile, Volume

Array = npt.NDArray[Any]

# Arrays that are guarded at once; more are not.
_MOST = 64
# Not in Python's modules; of sigaction(2), and of mmap(2), the last one without room set aside for what is not written.
_SA_SIGINFO, _MAP_FIXED, _MAP_NORESERVE = 4, 0x10, 0x4000
# Of siginfo_t.si_code, the lower half of a word: of a fault it is positive and small, of what was sent it is not.
_LOW_BITS, _MAX_FAULT_CODE = 0xFFFFFFFF, 0xFFFF


def read_volume_guarded(spec: VolumeSpec) -> Volume:
    """As `read_volume`; where the volume's file becomes shorter, now or later, that is an InputError and no signal."""
    return read_volume(spec, on_mapped=guard_mapping)


def guard_mapping(file: MappedFile, values: Array) -> None:
    """Read zeros where the file that `values`, of any strides, are mapped from has lost them, for as long as they live.

    Where that cannot be had, nothing is done.
    """
    if not (sys.platform == "linux" and platform.machine() in ("x86_64", "aarch64") and sys.maxsize > 1 << 32):
        return
    regions = _install_handler().regions
    free = np.flatnonzero(regions[:, 1] == 0)
    if not free.size:
        return
    try:
        descriptor = os.open(file.path, os.O_RDONLY)
    except OSError:  # gone, which the next look tells
        return
    status = os.fstat(descriptor)
    if (status.st_dev, status.st_ino) != (file.device, file.inode):  # replaced, which it tells, too
        os.close(descriptor)
        return
    begin, end = np.lib.array_utils.byte_bounds(values)
    region = regions[free[0]]
    region[[0, 2, 3]] = begin & -mmap.PAGESIZE, descriptor, file.num_bytes
    region[1] = -(-end // mmap.PAGESIZE) * mmap.PAGESIZE  # last: the handler takes what has an end
    root: Any = values
    while isinstance(root, np.ndarray):
        root = root.base
    weakref.finalize(root, _release_region, region)


def _release_region(region: Array) -> None:
    region[1] = 0
    os.close(int(region[2]))


@dataclass(frozen=True)
class _InstalledHandler:
    """What the handler needs as long as the process lives.

    regions: int64 [_MOST, 4]: addresses of the first byte and beyond the last, whole pages, 0 for none; descriptor and
        length of the file.
    before: the action that was there, as sigaction(2) has it.
    """

    regions: Array
    before: Array
    handler: Any


@cache
def _install_handler() -> _InstalledHandler:
    """Compile the handler and make it that of the process, once."""
    regions = np.zeros((_MOST, 4), np.int64)
    # The structure on both processors: the function, 128 bytes of a mask of signals, flags, and a function of libc's.
    before, action = np.zeros(19, np.int64), np.zeros(19, np.int64)
    handler = _compile_handler(regions.ctypes.data, before.ctypes.data)
    action[0] = handler.address
    action[17:18].view(np.int32)[0] = _SA_SIGINFO
    sigaction = _libc_function("sigaction", 3, ctypes.c_int)
    if sigaction(signal.SIGBUS, 0, before.ctypes.data) == 0:  # first: a fault may come at once
        sigaction(signal.SIGBUS, action.ctypes.data, 0)
    return _InstalledHandler(regions, before, handler)


def _libc_function(name: str, num_arguments: int, result: Any = ctypes.c_int64) -> Any:
    """A function all of whose arguments are given as integers of 64 bits, which these processors allow for shorter."""
    function = getattr(ctypes.CDLL(None), name)
    function.argtypes, function.restype = (ctypes.c_int64,) * num_arguments, result
    return function


def _compile_handler(regions_address: int, before_address: int) -> Any:
    import numba
    from numba.extending import intrinsic

    types: Any = numba.types
    words = types.CPointer(types.int64)

    def pointer(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return words(types.int64), generate

    at: Any = intrinsic(pointer)
    lseek, map_memory, sigaction = (
        _libc_function("lseek", 3),
        _libc_function("mmap", 6),
        _libc_function("sigaction", 3, ctypes.c_int),
    )
    send = _libc_function("raise", 1, ctypes.c_int)
    page, to_end, readable = mmap.PAGESIZE, os.SEEK_END, mmap.PROT_READ
    zeros = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | _MAP_FIXED | _MAP_NORESERVE

    def handle(number: Any, information: Any, _: Any) -> None:
        fault = information[2]  # siginfo_t.si_addr
        regions = at(regions_address)
        for index in range(0, 4 * _MOST, 4):
            if regions[index] <= fault < regions[index + 1]:
                length = lseek(regions[index + 2], 0, to_end)
                if 0 <= length < regions[index + 3]:
                    # To the end: what is behind has gone, too, and a page at a time may be more maps than there can be.
                    first = fault & -page
                    if map_memory(first, regions[index + 1] - first, readable, zeros, -1, 0) == first:
                        return
        sigaction(number, before_address, 0)  # the same instruction faults again
        if not 0 < (information[1] & _LOW_BITS) <= _MAX_FAULT_CODE:  # it was sent, and comes when this returns
            send(number)

    return numba.cfunc(types.void(types.int32, words, types.voidptr))(handle)
