"""Bricks that compiled loops draw are the same bytes on a processor that has fewer instructions: none with vectors of
256 bits, none that fuses a product with a sum."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
from brickwork import AFFINES, LIT, batch_of, bricks_of, hills, ordered, placed, random_cut, transfer_of, view_of

from renderer.draw import CPURasterizer

ROOT = Path(__file__).resolve().parents[2]

# Draws what it reads: only the loops that draw are compiled for the other processor.
CHILD = """
import pickle, sys
from renderer.draw import CPURasterizer

batch, order, view = pickle.load(sys.stdin.buffer)
with CPURasterizer(num_threads=1) as rasterizer:
    sys.stdout.buffer.write(rasterizer.rasterize(batch, order, view).tobytes())
"""


def test_the_same_bytes_with_fewer_instructions(tmp_path: Path) -> None:
    volume = placed(hills((30, 40, 50), 9.0), AFFINES["oblique"])
    transfer = transfer_of((0, (0.9, 0.2, 0.1), 0.0), (0.4, (0.1, 0.5, 1.0), 0.3), (0.4, (1.0, 1.0, 1.0), 2.0))
    bricks = bricks_of(volume, transfer, LIT)
    batch = batch_of(random_cut(bricks, 3), bricks, step=0.3, shading=LIT)
    view = view_of(volume, "perspective", (60, 50))
    order = ordered(batch.cut, view)
    with CPURasterizer(num_threads=1) as rasterizer:
        here = rasterizer.rasterize(batch, order, view)
    assert here[..., 3].max() > 0.9
    generic = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", CHILD],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)} | generic,
        input=pickle.dumps((batch, order, view)),
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    np.testing.assert_array_equal(np.frombuffer(done.stdout, np.float32), here.ravel())
