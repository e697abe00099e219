"""Describes the machine, the system and the commit, which measurements depend on."""

from __future__ import annotations

import os
import platform
from pathlib import Path
from typing import TypedDict

from renderer.system import MEASURING_PACKAGES, commit, package_versions


class Machine(TypedDict):
    """Describes the machine and the program that measured.

    device: the kernels or the OpenGL renderer that draw. versions: the version of each package.
    """

    processor: str
    cores: int | None
    system: str
    device: str
    commit: str
    versions: dict[str, str]


def describe_machine(device: str) -> Machine:
    """Return the machine, its system, the device that draws, the commit and the versions of packages."""
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "device": device,
        "commit": commit(),
        "versions": package_versions(*MEASURING_PACKAGES),
    }


def _processor() -> str:
    """Return the trade name of the processor from Linux's /proc/cpuinfo, or else the name that Python knows."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
