"""Tells what measurements depend on: the machine, the system, the commit."""

from __future__ import annotations

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


def _processor() -> str:
    """Return the trade name of the processor where Linux tells it, else what Python knows."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
