"""Fingerprints of volumes are computed when they are asked for, in one pass that also finds the range of values."""

from __future__ import annotations

import pickle
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner

from hsplat_cli.commands.init import init
from renderer.volume import Array, iter_slabs, make_volume


@pytest.fixture
def passes(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the numbers of values of all passes that compute fingerprints."""
    seen = list[int]()

    def counted(values: Array, source: Any, num_bytes: int = 1 << 20) -> Iterator[Array]:
        seen.append(values.size)
        return iter_slabs(values, source, num_bytes)

    monkeypatch.setattr("renderer.volume.fingerprint.iter_slabs", counted)
    return seen


@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint64", "float32"])
@pytest.mark.parametrize("shape", [(1, 1, 1), (3, 4, 5), (90, 80, 70)])
def test_one_pass_for_fingerprint_and_range(passes: list[int], dtype: str, shape: tuple[int, int, int]) -> None:
    values = (100 * np.random.default_rng(1).random(shape)).astype(dtype)
    asked, plain = make_volume(values, np.eye(4), "asked"), make_volume(values.copy(), np.eye(4), "plain")
    assert passes == []
    assert asked.fingerprint == asked.fingerprint == plain.fingerprint
    assert asked.value_range() == (values.min(), values.max()) == make_volume(values, np.eye(4), "").value_range()
    assert passes == [values.size] * 2


def test_a_range_without_absent_voxels() -> None:
    values = np.array([np.nan, -3, 5, np.nan], np.float32).reshape(4, 1, 1)
    volume = make_volume(values, np.eye(4), "", num_absent=2)
    assert volume.fingerprint and volume.value_range() == (-3.0, 5.0)


def test_other_values_have_their_own_range() -> None:
    volume = make_volume(np.arange(8, dtype=np.uint8).reshape(2, 2, 2), np.eye(4), "")
    labels = replace(volume, values=np.ones((2, 2, 2), np.uint8))
    assert volume.fingerprint == labels.fingerprint
    assert (volume.value_range(), labels.value_range()) == ((0.0, 7.0), (1.0, 1.0))


def test_another_process_reads_no_voxels(passes: list[int]) -> None:
    volume = make_volume(np.arange(8, dtype=np.uint8).reshape(2, 2, 2), np.eye(4), "")
    copy = pickle.loads(pickle.dumps(volume.digest))
    assert copy == volume.digest and hash(copy) == hash(volume.digest) and copy.text() == volume.fingerprint
    assert copy != make_volume(volume.values + 1, np.eye(4), "").digest
    assert passes == [8, 8]


def test_init_needs_no_fingerprint_of_all_voxels(tmp_path: Path, passes: list[int]) -> None:
    z, y, x = np.indices((70, 71, 72))
    np.save(tmp_path / "ball.npy", (2 * np.hypot(np.hypot(z - 35, y - 35), x - 35)).astype(np.uint8))
    result = CliRunner().invoke(init, [str(tmp_path / "ball.npy")])
    assert result.exit_code == 0, result.output
    assert passes and max(passes) < 40**3  # the look at the film is of every second voxel
