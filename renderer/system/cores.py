"""Count the processors that this process may use, which are fewer in a container or a batch job."""

from __future__ import annotations

import math
import os
from pathlib import Path

# The folder of all control groups, by which Linux limits the resources of processes.
_CGROUP_ROOT = Path("/sys/fs/cgroup")
# The file that names the control groups of this process.
_OWN = Path("/proc/self/cgroup")


def num_cores() -> int:
    """Return the number of processors that this process may use, and so of the threads that work.

    LP_NUM_THREADS, as for Mesa's software OpenGL, or else the number that the scheduler and the control group allow.
    """
    wanted = os.environ.get("LP_NUM_THREADS", "")
    if wanted.isascii() and wanted.isdecimal() and len(wanted) < 4:
        return max(1, int(wanted))
    allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return max(1, math.ceil(min(allowed, _quota())))


def control_groups(controller: str, groups: Path = _CGROUP_ROOT, own: Path = _OWN) -> set[Path]:
    """Return the folders of this process' control group and of all groups that contain it (cgroups(7)).

    Some of the folders may not exist. A group has no more resources than the groups that contain it. In a container,
    its own group is usually the root of the visible groups, and the path in the file `own` does not exist.

    controller: the resource that groups limit, `cpu` or `memory`. groups: the folder of all control groups. own: the
    file that names the groups of this process.
    """
    try:
        lines = [line.split(":", 2) for line in own.read_text(encoding="utf-8").splitlines()]
    except (OSError, ValueError):
        lines = []
    folders = {groups, groups / controller}
    for _, controllers, path in (line for line in lines if len(line) == 3):
        if controllers == "" or controller in controllers.split(","):  # lines of version 2 name no controller
            root = groups / controller if controllers else groups
            inner = root / path.lstrip("/")
            folders.update(folder for folder in (inner, *inner.parents) if folder.is_relative_to(root))
    return folders


def _quota() -> float:
    """Return the number of processors whose time control groups allow; infinite without a limit."""
    return min(map(_group_quota, control_groups("cpu")))


def _group_quota(group: Path) -> float:
    """Return the number of processors whose time a control group allows; infinite without a limit.

    group: the folder of the group, with the files of control groups of version 1 or 2.
    """
    try:
        if (group / "cpu.max").exists():
            quota, period = (group / "cpu.max").read_text().split()
        else:
            quota, period = ((group / f"cpu.cfs_{name}_us").read_text() for name in ("quota", "period"))
        return int(quota) / int(period) if int(quota) > 0 else math.inf
    except (OSError, ValueError, ZeroDivisionError):  # without a limit, the file is missing or has `max`
        return math.inf
