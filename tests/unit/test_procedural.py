"""Volumes made from a formula: the values that the formulas promise, and the same bytes on every run."""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from kinds_of_data import suggested
from scipy import ndimage

from renderer import render_frame
from renderer.readers import procedural_values, read_volume, vessel_tree
from renderer.scene import PROCEDURAL_NAMES, ProceduralSource, VolumeSpec, load_scene


@pytest.mark.parametrize("name", PROCEDURAL_NAMES)
@pytest.mark.parametrize("shape", [(1, 1, 1), (7, 5, 3), (2, 16, 9)])
def test_any_shape(name, shape):
    volume = read_volume(VolumeSpec(ProceduralSource(name, shape, spacing=(0.5, 1.0, 2.0))))
    assert volume.shape_xyz == shape
    assert volume.values.dtype == np.uint8
    np.testing.assert_array_equal(volume.world_from_index, np.diag([0.5, 1.0, 2.0, 1.0]))


def test_constant_and_single_voxel():
    assert (procedural_values(ProceduralSource("constant", (4, 5, 6))) == 200).all()
    values = procedural_values(ProceduralSource("single_voxel", (4, 5, 7)))
    assert values[3, 2, 2] == 255
    assert values.sum(dtype=int) == 255


def test_marschner_lobb_is_its_formula():
    """Against a scalar loop of the published equation."""
    n = 9
    values = procedural_values(ProceduralSource("marschner_lobb", (n, n, n)))
    for z, y, x in np.ndindex(n, n, n):
        px, py, pz = (2 * k / (n - 1) - 1 for k in (x, y, z))
        rho_r = math.cos(2 * math.pi * 6 * math.cos(math.pi * math.hypot(px, py) / 2))
        rho = (1 - math.sin(math.pi * pz / 2) + 0.25 * (1 + rho_r)) / (2 * 1.25)
        assert abs(int(values[z, y, x]) - 255 * rho) <= 0.5 + 1e-9


# Digests of the values, with slabs of at most this many voxels.
DIGESTS = [
    ("engine_block", (7, 5, 3), 1, 2**20, "55a543a462f9acce"),
    ("engine_block", (2051, 777, 1), 4, 2**20, "4b7797523257964f"),
    ("engine_block", (101, 203, 3), 7, 1000, "dd834b79b01bf6dc"),
    ("engine_block", (7, 5, 3), 1, 37, "ecd7e1867559df74"),
    ("engine_block", (1, 300, 7), 5, 37, "3fe2f3f1de63d186"),
    ("marschner_lobb", (101, 203, 3), 7, 2**20, "f85e3df5f8476717"),
    ("marschner_lobb", (101, 203, 3), 7, 1000, "f85e3df5f8476717"),
    ("atlas", (40, 30, 20), 7, 2**20, "5ea34f1e47c8f068"),
    ("atlas", (40, 30, 20), 7, 37, "5ea34f1e47c8f068"),
    ("vessels", (48, 40, 56), 3, 2**20, "81a41b27fe9afc41"),
    ("cell_plasma_membrane", (48, 40, 56), 3, 2**20, "a6eccdc1b38ca9c3"),
    ("cell_nucleus", (48, 40, 56), 3, 2**20, "880a280b633ccec8"),
    ("cell_reticulum", (48, 40, 56), 3, 2**20, "4fcc07630b5defbd"),
    ("cell_mitochondria", (48, 40, 56), 3, 2**20, "ffca66ad0229aa74"),
    ("cell_vesicles", (48, 40, 56), 3, 2**20, "2389bece6e630d15"),
    ("porous_rock", (48, 40, 56), 3, 2**20, "3270f9c0bbf4d6f4"),
    ("flower", (48, 40, 56), 3, 2**20, "aedf9cb0b219d8ae"),
    ("storm", (48, 40, 56), 3, 2**20, "169caa51d71e5b3d"),
    ("beating_heart", (48, 40, 56), 3, 2**20, "ebff99db20a9f0f2"),
]


@pytest.mark.parametrize(("name", "shape", "seed", "most", "expected"), DIGESTS)
def test_values_do_not_change(name, shape, seed, most, expected, monkeypatch):
    monkeypatch.setattr("renderer.readers.procedural_grid.SLAB_VOXELS", most)
    monkeypatch.setattr("renderer.readers.procedural_grid.BLOCK_VOXELS", most)
    values = procedural_values(ProceduralSource(name, shape, seed, phase=0.3))
    assert hashlib.blake2b(values.tobytes(), digest_size=8).hexdigest() == expected


# A program that prints how many bytes of memory each procedural volume takes at most beyond its values, while it is
# made, for planes of two sizes. No other thread of its process takes memory.
PEAKS = """
import json, sys, tracemalloc
from renderer.readers import procedural_values
from renderer.scene import PROCEDURAL_NAMES, ProceduralSource

procedural_values(ProceduralSource("constant", (8, 8, 8)))  # imports the readers
grid = sys.modules["renderer.readers.procedural_grid"]
grid.SLAB_VOXELS = grid.BLOCK_VOXELS = int(sys.argv[1])
found = {}
for name in PROCEDURAL_NAMES:
    found[name] = []
    for side in (32, 128):
        tracemalloc.start()
        values = procedural_values(ProceduralSource(name, (side, side, 2)))
        found[name].append(tracemalloc.get_traced_memory()[1] - values.nbytes)
        tracemalloc.stop()
print(json.dumps(found))
"""


@pytest.mark.slow
def test_working_memory_does_not_grow_with_a_plane(tmp_path):
    most = 2**9
    program = [sys.executable, "-c", PEAKS, str(most)]
    told = subprocess.run(program, cwd=tmp_path, capture_output=True, check=True, timeout=120)
    peaks = json.loads(told.stdout)
    assert peaks.keys() == set(PROCEDURAL_NAMES)
    growth = {name: large - small for name, (small, large) in peaks.items()}
    assert max(growth.values()) < 8 * most * np.dtype(np.float64).itemsize, growth
    assert max(large for _, large in peaks.values()) < 2**21, peaks


def _made(name: str, *, seed: int = 1, phase: float = 0.0, shape: tuple[int, int, int] = (24, 24, 24)) -> np.ndarray:
    return procedural_values(ProceduralSource(name, shape, seed, phase=phase))


@pytest.mark.parametrize("name", ["vessels", "cell_vesicles", "porous_rock", "flower", "storm", "beating_heart"])
def test_blocks_do_not_change_values(name, monkeypatch):
    whole = _made(name, phase=0.3)
    monkeypatch.setattr("renderer.readers.procedural_grid.BLOCK_VOXELS", 300)
    np.testing.assert_array_equal(_made(name, phase=0.3), whole)


@pytest.mark.parametrize("name", ["vessels", "cell_mitochondria", "cell_vesicles", "porous_rock", "storm", "flower"])
def test_a_seed_makes_another_volume(name):
    assert not np.array_equal(_made(name), _made(name, seed=2))


@pytest.mark.parametrize("name", ["beating_heart", "storm"])
def test_a_whole_phase_is_the_same_volume_again(name):
    """Quarters are exact in binary."""
    np.testing.assert_array_equal(_made(name, phase=0.25), _made(name, phase=-2.75))
    assert not np.array_equal(_made(name), _made(name, phase=0.25))


def test_the_heart_has_least_blood_when_it_is_smallest():
    """The left ventricle is filled and emptied, and both kinds of blood are there."""
    full, empty = (_made("beating_heart", phase=phase, shape=(48, 48, 56)) for phase in (0.0, 0.4))
    for low, high in ((155, 175), (215, 230)):
        assert 0 < ((empty >= low) & (empty <= high)).sum() < 0.9 * ((full >= low) & (full <= high)).sum()


def test_vessels_are_two_trees_and_the_vein_is_in_one_piece():
    """Vessels that are thinner than a voxel are not broken. The vein may cut the artery where they cross."""
    values = _made("vessels", shape=(96, 64, 128))
    assert set(np.unique(values)) == {0, 1, 2}
    pieces, num = ndimage.label(values == 2, np.ones((3, 3, 3)))
    assert num == 1
    assert (pieces > 0).sum() > 5000


def test_radii_of_vessels_follow_murrays_law():
    start, end, radius = vessel_tree(3, np.array([0.66, 0.0, 0.0]))
    cubes: dict[tuple[float, ...], float] = {}
    for place, one in zip(map(tuple, start), radius, strict=True):
        cubes[place] = cubes.get(place, 0) + one**3
    parted = [(cubes[place], one**3) for place, one in zip(map(tuple, end), radius, strict=True) if place in cubes]
    assert len(parted) > 1000
    np.testing.assert_allclose(*np.array(parted).T, rtol=1e-4)


def test_organelles_of_a_cell_lie_within_its_membrane_and_outside_of_its_nucleus():
    kinds = ("plasma_membrane", "nucleus", "reticulum", "mitochondria", "vesicles")
    full = {kind: _made(f"cell_{kind}", shape=(80, 72, 44)) > 120 for kind in kinds}
    for kind in ("mitochondria", "vesicles"):
        assert full[kind].any()
        assert not (full[kind] & (full["nucleus"] | full["plasma_membrane"])).any()


def test_rock_has_pores_between_minerals():
    """In the middle of the core, pores take a share that sandstone has."""
    values = _made("porous_rock", shape=(64, 64, 64))[16:48, 16:48, 16:48]
    assert 0.1 < (values < 100).mean() < 0.35
    assert (values > 200).any()


# Scenes of procedural volumes, for which a shape and a spacing are a coarser grid in the same place.
SCENES = ("vessels", "storm", "flower", "porous_rock", "organelles", "heart")


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_shows_its_volume(name):
    file = Path(__file__).resolve().parents[2] / "configs" / f"{name}.yaml"
    tree = yaml.safe_load(file.read_text("utf-8"))
    sources = {f"volumes.{k}": one["procedural"] for k, one in enumerate(tree.get("volumes", []))}
    sources = sources or {"volume": tree["volume"]["procedural"]}
    coarser = [f"{key}.procedural.spacing=[4, 4, 4]" for key in sources]
    coarser += [f"{key}.procedural.shape={[n // 4 for n in one['shape']]}" for key, one in sources.items()]
    scene = load_scene(file, overrides=[*coarser, "output.size=[48, 48]", "error.probes=16"])
    picture = render_frame(scene, size=(48, 48)).astype(int)
    differs = abs(picture - picture[:, :1]).max(axis=2) > 40
    assert 0.1 < differs.mean() < 0.9


def test_engine_block_has_two_materials():
    """Light metal and steel stand out from air."""
    casing, steel = suggested(procedural_values(ProceduralSource("engine_block", (128, 128, 64)))).visible
    assert casing.ranges[0][0] < 96 < casing.ranges[0][1] and 0.1 < casing.voxels < 0.4
    assert steel.ranges[0][0] < 226 < steel.ranges[0][1] and 0.01 < steel.voxels < 0.1


def test_engine_block_is_round_in_the_world():
    """Voxels twice as high give the same phantom in half the slices."""
    fine = procedural_values(ProceduralSource("engine_block", (64, 64, 32))).astype(float)
    flat = procedural_values(ProceduralSource("engine_block", (64, 64, 16), spacing=(1.0, 1.0, 2.0))).astype(float)
    middle = (fine[0::2] + fine[1::2]) / 2
    assert np.corrcoef(middle.ravel(), flat.ravel())[0, 1] > 0.97
