"""Measure the memory that is left for this process, and the most that it has held.

In a container or a batch job less is left than the machine has.
"""

from __future__ import annotations

import contextlib
import ctypes
import math
import resource
from dataclasses import dataclass
from pathlib import Path

from renderer.system.cores import control_groups

_MEMINFO = Path("/proc/meminfo")
_RESET = Path("/proc/self/clear_refs")
# The files of limits, of what is in use and of its parts, by the version of control groups.
_FILES = {
    2: (("memory.max", "memory.high"), "memory.current", ("inactive_file", "active_file")),
    1: (("memory.limit_in_bytes",), "memory.usage_in_bytes", ("total_inactive_file", "total_active_file")),
}
# Of the memory that is free, the part that drawing may take unless it is told otherwise: the rest is for voxels, films
# and others.
_SHARE_OF_FREE = 0.5
# Bytes that drawing may take where nobody knows what is free.
_BYTES_IF_UNKNOWN = 256 << 20


def free_bytes() -> float:
    """Return the memory that can be had without swapping and without being killed; infinite where nobody knows."""
    return min(_read_meminfo("MemAvailable", math.inf), *map(_group_free_bytes, control_groups("memory")))


@dataclass(frozen=True)
class MemoryShare:
    """A share of the memory of this machine, for the bricks that one of several processes draws.

    total: bytes for all of them together; None for half of what is free. num_processes: how many share them.
    """

    total: int | None = None
    num_processes: int = 1

    def num_bytes(self) -> int:
        """Return the bytes that this process may take now."""
        total: float = _SHARE_OF_FREE * free_bytes() if self.total is None else self.total
        return int((_BYTES_IF_UNKNOWN if math.isinf(total) else total) / self.num_processes)


def free_swap_bytes() -> float:
    """Return the free swap space of the machine; 0 where nobody knows."""
    return _read_meminfo("SwapFree", 0)


def address_space_hint() -> str | None:
    """Return a hint for what failed, if a limit on address space may be the cause."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit == resource.RLIM_INFINITY:
        return None
    return f"address space is limited to {limit / 2**30:.2g} GiB here (ulimit -v); a run takes about 1 GiB"


class PeakMemory:
    """A meter of the peak memory of this process since the last reset, as Linux counts it; unknown on other systems.

    A new one returns freed memory to the system, where the C library can: it would count.
    """

    def __init__(self) -> None:
        with contextlib.suppress(OSError, AttributeError, TypeError):  # no such library, no such function
            ctypes.CDLL(None).malloc_trim(0)
        self.reset()

    def reset(self) -> None:
        """Start again from the memory held now."""
        self._is_known = False
        with contextlib.suppress(OSError):  # no such file, or not allowed to
            _RESET.write_text("5")
            self._is_known = True

    def peak_bytes(self) -> int | None:
        """Return bytes of physical memory; None where the system does not tell."""
        if not self._is_known:
            return None
        return int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0]) * 1024


def _read_meminfo(name: str, otherwise: float) -> float:
    """Return a number of /proc/meminfo in bytes; `otherwise` where it is missing."""
    try:
        text = _MEMINFO.read_text(encoding="ascii")
        return int(text.partition(f"{name}:")[2].split()[0]) * 1024
    except (OSError, ValueError, IndexError):
        return otherwise


def _group_free_bytes(group: Path) -> float:
    """Return what one control group has left. The kernel takes back the pages of files before it kills a process."""
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
    """Return the number in a file; infinite where it is missing, or `max`."""
    try:
        return int(file.read_text())
    except (OSError, ValueError):
        return math.inf
