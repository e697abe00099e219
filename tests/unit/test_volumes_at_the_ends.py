"""Volumes at the ends of what is legal, from their file on: what is said, refused and replaced."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest
from click.testing import CliRunner
from number_types import RANGES, TYPES, random_ranges
from volume_files import read, refused

from hsplat_cli.commands.info import info
from renderer.scene import parse_scene
from renderer.transfer import make_transfer_function

Array = npt.NDArray[Any]


def of_info(path: Path, values: Array) -> dict[str, Any]:
    """Return the facts of `hsplat info` about a volume; JSON without NaN and infinities."""
    np.save(path, values)
    result = CliRunner().invoke(info, [str(path), "--json"], catch_exceptions=False)
    assert result.exit_code == 0
    assert CliRunner().invoke(info, [str(path)], catch_exceptions=False).exit_code == 0

    def refuse(constant: str) -> None:
        raise AssertionError(constant)

    facts: dict[str, Any] = json.loads(result.output, parse_constant=refuse)
    return facts


@pytest.mark.parametrize("case", range(len(RANGES) + len(TYPES)))
def test_info_of_extreme_values(tmp_path: Path, case: int) -> None:
    """The numbers lie within the volume's, and the suggested transfer function shows something."""
    values = list(random_ranges(11))[2 * case if case < len(RANGES) else 2 * (case - len(RANGES)) + 1]
    facts = of_info(tmp_path / "a.npy", values.reshape(-1, 2, 2))
    low, high = values.min().item(), values.max().item()
    assert (facts["minimum"], facts["maximum"]) == (low, high)
    assert low <= facts["mean"] <= high
    assert all(low <= value <= high for value in facts["percentiles"].values())
    assert sum(facts["histogram"]["counts"]) == values.size
    scene = {
        "version": 1,
        "volume": {"file": "a.npy"},
        **{key: facts[key] for key in ("transfer_function", "labels") if key in facts},
        "camera": {"path": {"type": "turntable", "frames": 1}},
        "output": {"file": "a.mp4"},
    }
    transfer = parse_scene(scene, base=tmp_path).layers[0].transfer_function
    if transfer.labels is not None:
        assert {*transfer.labels.values} <= {*values.ravel().tolist()}
    else:
        assert make_transfer_function(transfer, 1.0).classify(values)[1].max() > 0


@pytest.mark.parametrize(("low", "high"), [(2**60, 2**60 + 255), (-(2**62), -(2**62) + 1), (2**53, 2**53 + 2**15)])
def test_integers_too_large_for_their_differences_are_refused(tmp_path: Path, low: int, high: int) -> None:
    np.save(tmp_path / "a.npy", np.array([low, high], np.int64).reshape(1, 1, 2))
    refused(tmp_path / "a.npy", match="these integers are too large for their differences to be drawn")


@pytest.mark.parametrize(("low", "high"), [(2**62, 2**62), (2**53 - 255, 2**53), (0, 2**63 - 1), (-(2**63), 0)])
def test_integers_that_float64_tells_apart_are_read(tmp_path: Path, low: int, high: int) -> None:
    np.save(tmp_path / "a.npy", np.array([low, high], np.int64).reshape(1, 1, 2))
    assert read(tmp_path / "a.npy").values.tolist() == [[[low, high]]]
