"""Tells what measurements depend on: the machine, the system, the commit; and measures the memory of the process."""

from __future__ import annotations

import contextlib
import ctypes
import os
import platform
from pathlib import Path
from typing import Any

from renderer.system import MEASURING_PACKAGES, commit, package_versions


def describe_machine(device: str) -> dict[str, Any]:
    """Return processor, cores, system, what draws, commit and the versions of the packages used."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "device": device,
        "commit": commit(),
        "versions": package_versions(*MEASURING_PACKAGES),
    }


class PeakMemory:
    """The peak memory of this process since the last reset, as Linux counts it; unknown on other systems."""

    _RESET = Path("/proc/self/clear_refs")

    def __init__(self) -> None:
        self._is_known = False

    def trim(self) -> None:
        """Return freed memory to the system, where the C library can: else it would count with the next setting."""
        with contextlib.suppress(OSError, AttributeError, TypeError):  # no such library, no such function
            ctypes.CDLL(None).malloc_trim(0)

    def reset(self) -> None:
        """Start again from the memory held now."""
        self._is_known = False
        with contextlib.suppress(OSError):  # no such file, or not allowed to
            self._RESET.write_text("5")
            self._is_known = True

    def peak_bytes(self) -> int | None:
        """Return bytes of physical memory; None where the system does not tell."""
        if not self._is_known:
            return None
        return int(Path("/proc/self/status").read_text().partition("VmHWM:")[2].split()[0]) * 1024


def _processor() -> str:
    """Return the trade name of the processor where Linux tells it, else what Python knows."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
