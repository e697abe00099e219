"""A short run of `tests/fuzz/run.py`, from another seed than its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from judge import judge, make_case
from scenes import random_of
from spoiling import places

from renderer.draw import Rasterizer, SplatRasterizer
from renderer.scene import Scene
from renderer.splats import SplatBatch

SEED = 2
# Kernels are compiled for every type of voxel, which takes longer than all scenes here; the whole run has them all.
DTYPES = ("uint8", "int16", "float32")
SCENES = 64
AT_ONCE = 16
CHUNK = 7  # splats
ANGLES = ("azimuth", "elevation", "start", "swing", "field_of_view")


@pytest.mark.parametrize("first", range(0, SCENES, AT_ONCE))
def test_right_pictures_or_clear_errors(rasterizer_for, tmp_path, first: int) -> None:
    verdicts = [
        judge(make_case(SEED, index, DTYPES), tmp_path / str(index), rasterizer_for)
        for index in range(first, first + AT_ONCE)
    ]
    wrong = [f"{v.index} ({v.case}): {v.why}" for v in verdicts if v.outcome == "wrong"]
    assert not wrong, "\n".join(wrong)
    assert any(verdict.outcome == "picture" for verdict in verdicts)
    assert any(verdict.outcome == "refused" for verdict in verdicts)


def test_numbers_of_any_size(rasterizer_for: Callable[[Scene], Rasterizer], tmp_path: Path) -> None:
    """Far beyond those of `scenes.py`, several at once, there is a right picture or an error with its place, too."""
    verdicts = []
    for index in range(24):
        case, rng = make_case(SEED, 2 * index, DTYPES), random_of(SEED, index)
        for tree, key, _ in list(places(case.tree)):
            if isinstance(tree[key], float) and key != "value" and rng.random() < 0.15:  # values stay in their order
                tree[key] *= 10.0 ** rng.uniform(-15, 0 if key in ANGLES or 0 <= tree[key] <= 1 else 15)
        case = replace(case, spoilt="numbers of any size", in_memory=False)
        verdicts.append(judge(case, tmp_path / str(index), rasterizer_for))
    assert [f"{v.index}: {v.why}" for v in verdicts if v.outcome == "wrong"] == []
    assert sum(verdict.outcome == "picture" for verdict in verdicts) > 12


def test_pictures_in_chunks(rasterizer_for, tmp_path, monkeypatch) -> None:
    """Scenes here have too few splats to be drawn in chunks, unless these are small."""
    monkeypatch.setattr("renderer.draw.splats.splat_rasterizer.MIN_CHUNK_SPLATS", CHUNK)
    monkeypatch.setattr("renderer.draw.splats.splat_rasterizer.splats_per_chunk", lambda *_: CHUNK)
    verdicts = [
        judge(make_case(SEED, index, DTYPES), tmp_path / str(index), rasterizer_for) for index in range(0, 24, 2)
    ]
    assert [verdict.why for verdict in verdicts if verdict.outcome == "wrong"] == []


def _changed(batch: SplatBatch, part: slice, factor: float, offset: float) -> SplatBatch:
    vertices = batch.vertices.copy()
    vertices[:, part] = vertices[:, part] * np.float32(factor) + np.float32(offset)
    return replace(batch, vertices=vertices)


@pytest.mark.parametrize(
    "fault",
    [
        lambda batch: _changed(batch, slice(0, 1), 1, 1e-3),  # centres, by a thousandth of the volume's radius
        lambda batch: _changed(batch, slice(3, 4), 1.01, 0),  # red
        lambda batch: replace(batch, axes=batch.axes * 1.01),  # sizes
    ],
    ids=["centres", "red", "sizes"],
)
def test_small_faults_are_seen(
    rasterizer_for: Callable[[Scene], Rasterizer],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    fault: Callable[[SplatBatch], SplatBatch],
) -> None:
    """The bounds are no wider than rounding: a fault of 1 % is seen, unless it is out of the picture."""
    rasterize = SplatRasterizer.rasterize
    monkeypatch.setattr(
        SplatRasterizer,
        "rasterize",
        lambda gl, batches, orders, view: rasterize(gl, [fault(each) for each in batches], orders, view),
    )
    numbers = range(0, 24, 2)
    verdicts = [judge(make_case(SEED, index, DTYPES), tmp_path / str(index), rasterizer_for) for index in numbers]
    assert sum(verdict.outcome == "wrong" for verdict in verdicts) >= len(numbers) // 3
