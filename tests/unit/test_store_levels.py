"""The level of a store that is drawn: the coarsest one that is exact enough, measured by rays that read few chunks."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from store_files import halves, scaled, write_ome

from hsplat_cli.commands.check import check
from hsplat_cli.commands.render import render
from renderer.accuracy import TRUTH_TOLERANCE, compute_truth, psnr
from renderer.frame import FilmStage, prepare_stage
from renderer.readers import Blocks, read_part, read_volume
from renderer.resolve import resolve_scene
from renderer.resolve.level_errors import LevelErrors
from renderer.scene import FileSource, FilmScene, LevelChoice, VolumeSpec, parse_scene, scene_to_dict
from renderer.stores import Store
from renderer.truth import SceneRays, pixel_centres
from renderer.view import View
from renderer.volume import Array, Float64, VolumeLevel

SIDE = 64
POINTS = [
    {"value": 20, "color": "#000040", "opacity": 0},
    {"value": 120, "color": "#ff8000", "opacity": 0.05},
    {"value": 250, "color": "#ffffff", "opacity": 0.2},
]


def _grid() -> Float64:
    """Return the coordinates of voxels along z, y and x, from -1 to 1."""
    return np.array(np.meshgrid(*[np.linspace(-1, 1, SIDE)] * 3, indexing="ij"))


def smooth() -> Array:
    return (250 * np.exp(-3 * (_grid() ** 2).sum(axis=0))).astype(np.uint8)


def rough() -> Array:
    return (smooth() * (np.prod(np.sin(60 * _grid()), axis=0) > 0)).astype(np.uint8)


def write_store(folder: Path, finest: Array, chunk: int = 8, num: int = 4) -> Path:
    """Write a store whose levels are means of 2^3 voxels of the one before."""
    levels, places = [finest], []
    for _ in range(num - 1):
        levels.append(halves(levels[-1], 2, 2, 2))
    for k in range(num):
        places.append(scaled(*[2.0**k] * 3, translation=[0.5 * (2.0**k - 1)] * 3))
    return write_ome(folder, levels, places, chunks=[chunk] * 3)


def scene_of(volume: Path, *, error: Any = {"psnr": 40}, frames: int = 4, **keys: Any) -> FilmScene:
    tree = {
        "version": 1,
        "volume": {"file": str(volume), **keys},
        "transfer_function": {"points": POINTS},
        "camera": {"path": {"type": "turntable", "frames": frames}},
        "error": error,
        "output": {"file": "film-{frame}.png", "size": [48, 48]},
    }
    return parse_scene(tree, base=volume.parent)


def choice_of(scene: FilmScene) -> LevelChoice:
    """Return the level that is chosen for a scene's volume."""
    volume = resolve_scene(scene, read_volume).at(0).layers[0].volume
    assert volume.chosen is not None and volume.level == volume.chosen.number
    return volume.chosen


def stage_of(scene: FilmScene, level: int) -> FilmStage:
    leveled = scene.changed(
        lambda each: each.with_layers(volume=replace(each.layers[0].volume, level=level))
    )
    return prepare_stage(leveled, clock=lambda: 0.0, num_threads=2)


@pytest.mark.usefixtures("one_process")
def test_a_smooth_field_takes_a_coarse_level_and_a_rough_one_the_finest(tmp_path: Path) -> None:
    found = choice_of(scene_of(write_store(tmp_path / "a", smooth())))
    assert found.number in (1, 2) and found.num_levels == 4 and found.psnr and found.psnr > 43
    assert found.num_bytes == (SIDE >> found.number) ** 3
    assert choice_of(scene_of(write_store(tmp_path / "b", rough()))).number == 0
    finest = choice_of(scene_of(tmp_path / "a", error={"tolerance": 0}))
    assert finest.number == 0 and finest.num_measured == 0


@pytest.mark.usefixtures("one_process")
@pytest.mark.parametrize("field", [smooth, rough])
def test_the_error_is_that_of_whole_exact_pictures(tmp_path: Path, field: Any) -> None:
    scene = scene_of(write_store(tmp_path / "a", field()))
    coarse = stage_of(scene, 2)
    errors = LevelErrors(coarse, lambda volume: volume.source == scene.at(0).layers[0].volume.source)
    samples = errors.error_of(lambda spec: read_volume(replace(spec, level=2)))
    # The cameras of both stages are those of the coarse level.
    camera = replace(coarse.scene.at(0).camera, target=coarse.target, distance=coarse.distance)
    framed = scene.changed(lambda each: replace(each, camera=camera))
    true = []
    for frame in (0, 1, 2):
        one, two = (compute_truth(stage_of(framed, level), frame, TRUTH_TOLERANCE) for level in (0, 2))
        noise = one.means.variances.mean() + two.means.variances.mean()
        true.append(((one.picture - two.picture) ** 2).mean() - noise)
    assert abs(psnr(samples.mean) - psnr(float(np.mean(true)))) < 2.5
    low, high = samples.interval
    assert low <= np.mean(true) <= high
