"""Bricks that compiled loops draw are the same bytes on a processor that has fewer instructions: none with vectors of
256 bits, none that fuses a product with a sum."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]

CHILD = """
import hashlib
import numpy as np
from brickwork import AFFINES, LIT, batch_of, bricks_of, hills, ordered, placed, random_cut, transfer_of, view_of
from renderer.bricks.sampling import ScreenSampling
from renderer.draw import CPURasterizer

volume = placed(hills((30, 40, 50), 9.0), AFFINES["oblique"])
transfer = transfer_of((0, (0.9, 0.2, 0.1), 0.0), (0.4, (0.1, 0.5, 1.0), 0.3), (0.4, (1.0, 1.0, 1.0), 2.0))
bricks = bricks_of(volume, transfer, LIT)
sampling = ScreenSampling((4, 1), 0.02, 0.01)
batch = batch_of(random_cut(bricks, 3), bricks, step=0.3, shading=LIT, screen_sampling=sampling)
view = view_of(volume, "perspective", (60, 50))
with CPURasterizer(num_threads=1) as rasterizer:
    image = rasterizer.rasterize(batch, ordered(batch.cut, view), view)
assert image[..., 3].max() > 0.9
print(hashlib.sha256(image.tobytes()).hexdigest())
"""


def drawn(**environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", CHILD],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT), str(ROOT / "tests" / "support")])} | environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_same_bytes_with_fewer_instructions(tmp_path: Path) -> None:
    here = drawn()
    assert drawn(NUMBA_CPU_NAME="generic", NUMBA_CPU_FEATURES="", NUMBA_CACHE_DIR=str(tmp_path)) == here
