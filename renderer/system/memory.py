"""Measure the memory that is free for this process, and the peak of the memory that it has held.

In a container or a batch job, less memory is free than the machine has.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import resource
from dataclasses import dataclass
from pathlib import Path

from renderer.system.cores import control_groups

# The file in which Linux states how much memory the machine has, and how much is free.
_MEMINFO = Path("/proc/meminfo")
# The file by which Linux resets the peak memory of this process.
_RESET = Path("/proc/self/clear_refs")
# For each version of Linux's control groups: the names of the files that state limits of memory, the name of the file
# that states the memory in use, and the names in memory.stat of the memory that caches files.
_FILES = {
    2: (("memory.max", "memory.high"), "memory.current", ("inactive_file", "active_file")),
    1: (("memory.limit_in_bytes",), "memory.usage_in_bytes", ("total_inactive_file", "total_active_file")),
}
# Drawing may take this share of the free memory by default. The remainder is for voxels, films and other programs.
_SHARE_OF_FREE = 0.5
# Drawing may take this many bytes if the free memory is unknown.
_BYTES_IF_UNKNOWN = 256 << 20


def free_bytes() -> float:
    """Return the bytes that this process can take without swapping or being killed; infinite if unknown."""
    return min(_read_meminfo("MemAvailable", math.inf), *map(_group_free_bytes, control_groups("memory")))


@dataclass(frozen=True)
class MemoryShare:
    """The memory that one of several drawing processes on this machine may take for its bricks.

    total: the bytes for all processes together; None for half of the free memory. num_processes: the number of
        processes.
    """

    total: int | None = None
    num_processes: int = 1

    def num_bytes(self) -> int:
        """Return the number of bytes that this process may take for its bricks now."""
        total: float = _SHARE_OF_FREE * free_bytes() if self.total is None else self.total
        return int((_BYTES_IF_UNKNOWN if math.isinf(total) else total) / self.num_processes)


def free_swap_bytes() -> float:
    """Return the bytes of free swap space of the machine; 0 if unknown."""
    return _read_meminfo("SwapFree", 0)


def address_space_hint() -> str | None:
    """Return a hint for the message of a failure: that the address space is limited; None if it is not limited."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return None
    return f"address space is limited to {limit / 2**30:.2g} GiB here (ulimit -v); a run takes about 1 GiB"


class PeakMemory:
    """A meter of the peak memory of this process since the last reset, as Linux counts it; unknown on other systems.

    A new meter first returns freed memory to the system, if the C library can, because Linux would count it.
    """

    def __init__(self) -> None:
        with contextlib.suppress(OSError, AttributeError, TypeError):  # the library or the function may be missing
            ctypes.CDLL(None).malloc_trim(0)
        self.reset()

    def reset(self) -> None:
        """Start the measurement again: the peak becomes the memory that this process holds now."""
        self._is_known = False
        with contextlib.suppress(OSError):  # the file may be missing or not writable
            _RESET.write_text("5")
            self._is_known = True

    def peak_bytes(self) -> int | None:
        """Return the peak of physical memory, in bytes; None if it is unknown."""
        if not self._is_known:
            return None
        return int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0]) * 1024


def _read_meminfo(name: str, otherwise: float) -> float:
    """Return an amount of memory that /proc/meminfo states under a name, in bytes; `otherwise` if it is missing."""
    try:
        text = _MEMINFO.read_text(encoding="ascii")
        return int(text.partition(f"{name}:")[2].split()[0]) * 1024
    except (OSError, ValueError, IndexError):
        return otherwise


def _group_free_bytes(group: Path) -> float:
    """Return the free bytes of a control group; infinite without a limit.

    Memory that caches files counts as free, because Linux takes it back when it is needed.
    """
    limits, usage, caches = _FILES[2 if (group / "memory.current").exists() else 1]
    limit = min(_read_number(group / name) for name in limits)
    if math.isinf(limit):
        return limit
    try:
        used = int((group / usage).read_text())
        parts = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
        return max(0, limit - used + sum(int(parts[name]) for name in caches))
    except (OSError, ValueError, KeyError):
        return limit


def _read_number(file: Path) -> float:
    """Return the number in a file; infinite if the file is missing, or has `max`."""
    try:
        return int(file.read_text())
    except (OSError, ValueError):
        return math.inf
