"""Reports describe the machine and count peak memory."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hsplat_cli.terminal import machine

MEGABYTE = 1 << 20


def test_the_machine_is_described() -> None:
    facts = machine.describe_machine("a device")
    assert facts["device"] == "a device"
    assert facts["processor"] and facts["system"] and facts["cores"] >= 1
    assert {"python", "numpy", "moderngl", "flip-evaluator", "scikit-image", "vtk"} <= set(facts["versions"])
    json.dumps(facts)


def test_the_peak_is_that_since_the_reset() -> None:
    memory = machine.PeakMemory()
    memory.reset()
    before = memory.peak_bytes()
    assert before is not None
    large = np.ones(128 * MEGABYTE, np.uint8)
    with_it = memory.peak_bytes()
    assert with_it is not None and with_it - before > 120 * MEGABYTE
    del large
    memory.trim()
    assert memory.peak_bytes() == pytest.approx(with_it, abs=MEGABYTE)  # a peak stays
    memory.reset()
    after = memory.peak_bytes()
    assert after is not None and after < with_it - 100 * MEGABYTE


def test_the_peak_is_unknown_on_other_systems(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(machine.PeakMemory, "_RESET", tmp_path / "missing" / "file")
    memory = machine.PeakMemory()
    memory.reset()
    assert memory.peak_bytes() is None
