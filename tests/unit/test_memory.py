"""The memory that this process may take is that of its control group, where the machine has more; its peak is known."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from renderer.system import MemoryShare, PeakMemory, control_groups, free_bytes, free_swap_bytes

GIB = 2**30
FREE = {"memory.limit_in_bytes": 2**63 - 4096, "memory.usage_in_bytes": GIB}  # as the kernel writes it


def version_2(most: object, used: int, *, high: object = "max", cache: int = 0) -> dict[str, object]:
    parts = f"anon {used - cache}\nfile {cache}\ninactive_file {cache // 4}\nactive_file {cache - cache // 4}\nshmem 0"
    return {"memory.max": most, "memory.high": high, "memory.current": used, "memory.stat": parts}


def version_1(most: int, used: int, *, cache: int = 0) -> dict[str, object]:
    parts = f"cache {cache}\ninactive_file 0\ntotal_inactive_file {cache // 4}\ntotal_active_file {cache - cache // 4}"
    return {"memory.limit_in_bytes": most, "memory.usage_in_bytes": used, "memory.stat": parts}


@pytest.mark.parametrize(
    ("own", "groups", "free"),
    [
        ("0::/", {}, 8),
        ("0::/job", {"job": version_2(3 * GIB, GIB)}, 2),
        ("0::/job", {"job": version_2("max", GIB)}, 8),
        ("0::/job", {"job": version_2("max", GIB, high=3 * GIB)}, 2),
        ("0::/job", {"job": version_2(100 * GIB, GIB)}, 8),
        ("0::/job", {"job": version_2(3 * GIB, 3 * GIB, cache=GIB)}, 1),
        ("0::/job/step", {"job": version_2(3 * GIB, GIB), "job/step": version_2(9 * GIB, GIB)}, 2),
        ("0::/job/step", {"job": version_2("max", GIB), "job/step": version_2(4 * GIB, GIB)}, 3),
        ("0::/not/here", {"": version_2(2 * GIB, GIB)}, 1),  # as in a container
        ("0::/job", {"job": version_2(2 * GIB, 3 * GIB)}, 0),
        ("0::/job", {"job": {"memory.current": GIB, "memory.max": 2 * GIB}}, 2),
        ("5:memory:/job\n4:cpu:/other", {"memory/job": version_1(3 * GIB, GIB)}, 2),
        ("5:a,memory:/job/step", {"memory/job": version_1(3 * GIB, 2 * GIB, cache=GIB), "memory/job/step": FREE}, 2),
        ("5:memory:/not/here\n0::/", {"memory": version_1(2 * GIB, GIB)}, 1),
        (None, {"memory": version_1(2 * GIB, GIB)}, 1),
    ],
)  # fmt: skip
def test_control_groups_limit_the_memory(
    own: str | None, groups: dict[str, dict[str, object]], free: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a group and those that it is in, the one with the least left counts; pages of files can be had again."""
    for group, files in groups.items():
        (tmp_path / group).mkdir(parents=True, exist_ok=True)
        for name, content in files.items():
            (tmp_path / group / name).write_text(f"{content}\n")
    (tmp_path / "meminfo").write_text(f"MemTotal: {9 * 2**20} kB\nMemAvailable: {8 * 2**20} kB\nSwapFree: 7 kB\n")
    monkeypatch.setattr("renderer.system.memory._MEMINFO", tmp_path / "meminfo")
    if own is not None:
        (tmp_path / "own").write_text(own)
    monkeypatch.setattr(
        "renderer.system.memory.control_groups", lambda name: control_groups(name, tmp_path, tmp_path / "own")
    )
    assert free_bytes() == free * GIB
    assert free_swap_bytes() == 7 * 1024


@pytest.mark.parametrize(
    ("total", "num_processes", "free", "num_bytes"),
    [(None, 1, 8 * GIB, 4 * GIB), (None, 4, 8 * GIB, GIB), (GIB, 2, 0, GIB // 2), (None, 2, math.inf, 2**27)],
)
def test_drawing_has_a_share(
    total: int | None, num_processes: int, free: float, num_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("renderer.system.memory.free_bytes", lambda: free)
    assert MemoryShare(total, num_processes).num_bytes() == num_bytes


def test_a_system_without_either_has_no_known_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.system.memory._MEMINFO", tmp_path / "absent")
    monkeypatch.setattr(
        "renderer.system.memory.control_groups", lambda name: control_groups(name, tmp_path, tmp_path / "absent")
    )
    assert free_bytes() == math.inf
    assert free_swap_bytes() == 0


def test_the_peak_is_that_since_the_reset() -> None:
    meter = PeakMemory()
    before = meter.peak_bytes()
    assert before is not None
    large = np.ones(GIB // 8, np.uint8)
    with_it = meter.peak_bytes()
    assert with_it is not None and with_it - before > 0.12 * GIB
    del large
    assert meter.peak_bytes() == pytest.approx(with_it, abs=GIB / 1024)  # a peak stays
    after = PeakMemory().peak_bytes()
    assert after is not None and after < with_it - 0.1 * GIB


def test_the_peak_is_unknown_on_other_systems(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.system.memory._RESET", tmp_path / "missing" / "file")
    assert PeakMemory().peak_bytes() is None
