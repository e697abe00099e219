"""Volumes made from a formula: the values that the formulas promise, and the same bytes on every run."""

from __future__ import annotations

import hashlib
import json
import math
import subprocess
import sys

import numpy as np
import pytest
from kinds_of_data import suggested

from renderer.readers import procedural_values, read_volume
from renderer.scene import PROCEDURAL_NAMES, ProceduralSource, VolumeSpec


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
]


@pytest.mark.parametrize(("name", "shape", "seed", "most", "expected"), DIGESTS)
def test_values_do_not_change(name, shape, seed, most, expected, monkeypatch):
    monkeypatch.setattr("renderer.readers.procedural_grid.SLAB_VOXELS", most)
    monkeypatch.setattr("renderer.readers.procedural_grid.BLOCK_VOXELS", most)
    values = procedural_values(ProceduralSource(name, shape, seed))
    assert hashlib.blake2b(values.tobytes(), digest_size=8).hexdigest() == expected


# A program that prints by how many bytes memory grows beyond the values of each procedural volume while it is made. No
# other thread of its process takes memory.
PEAKS = """
import json, sys, tracemalloc
from renderer.readers import procedural_values
from renderer.scene import PROCEDURAL_NAMES, ProceduralSource

procedural_values(ProceduralSource("constant", (8, 8, 8)))  # imports the readers
grid = sys.modules["renderer.readers.procedural_grid"]
grid.SLAB_VOXELS = grid.BLOCK_VOXELS = int(sys.argv[1])
found = {}
for name in PROCEDURAL_NAMES:
    procedural_values(ProceduralSource(name, (8, 8, 8)))  # imports what it needs
    tracemalloc.start()
    values = procedural_values(ProceduralSource(name, (256, 256, 2)))
    found[name] = tracemalloc.get_traced_memory()[1] - values.nbytes
    tracemalloc.stop()
print(json.dumps(found))
"""


def test_working_memory_does_not_grow_with_a_plane(tmp_path):
    most = 2**10
    program = [sys.executable, "-c", PEAKS, str(most)]
    told = subprocess.run(program, cwd=tmp_path, capture_output=True, check=True, timeout=120)
    peaks = json.loads(told.stdout)
    assert peaks.keys() == set(PROCEDURAL_NAMES)
    assert max(peaks.values()) < 8 * most * np.dtype(np.float64).itemsize, peaks


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
