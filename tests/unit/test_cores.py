"""The number of cores and threads that this process may use."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from renderer.system import control_groups, num_cores


@pytest.mark.parametrize(
    ("wanted", "expected"),
    [
        ("3", 3), ("0", 1), ("1", 1),
        *((text, num_cores()) for text in ("", "-1", "many", "1e9", "99999999999", "\N{SUPERSCRIPT TWO}")),
    ],
)  # fmt: skip
def test_as_many_threads_work_as_mesa_takes(monkeypatch: pytest.MonkeyPatch, wanted: str, expected: int) -> None:
    monkeypatch.setenv("LP_NUM_THREADS", wanted)
    assert num_cores() == expected


@pytest.mark.parametrize(
    ("own", "files", "expected"),
    [
        ("0::/", {}, 16),
        ("0::/", {"cpu.max": "150000 100000"}, 2),
        ("0::/a/b", {"a/cpu.max": "max 100000", "a/b/cpu.max": "300000 100000"}, 3),
        ("0::/a/b", {"a/cpu.max": "200000 100000", "a/b/cpu.max": "300000 100000"}, 2),
        ("0::/a", {"b/cpu.max": "100000 100000", "a/cpu.max": "no numbers"}, 16),
        ("0::/not/here", {"cpu.max": "50000 100000"}, 1),
        (None, {"cpu/cpu.cfs_quota_us": "250000", "cpu/cpu.cfs_period_us": "100000"}, 3),
        (
            "12:memory:/m\n4:cpu,cpuacct:/job\n0::/",
            {"cpu/job/cpu.cfs_quota_us": "400000", "cpu/job/cpu.cfs_period_us": "100000",
             "cpu/cpu.cfs_quota_us": "-1", "cpu/cpu.cfs_period_us": "100000"},
            4,
        ),
        ("no such lines\n\n", {"cpu.max": "100000 0"}, 16),
    ],
)  # fmt: skip
def test_control_groups_limit_the_cores(
    own: str | None, files: dict[str, str], expected: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The least quota of a group and of those around it counts, rounded up: batch systems and services nest them.

    The scheduler gives this process 16 cores.
    """
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(content)
    if own is not None:
        (tmp_path / "own").write_text(own)
    groups = control_groups("cpu", tmp_path, tmp_path / "own")
    monkeypatch.delenv("LP_NUM_THREADS", raising=False)
    monkeypatch.setattr("renderer.system.cores.control_groups", lambda _: groups)
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: range(16))
    assert num_cores() == expected
