"""Bricks that compiled loops draw are the same bytes on a processor that has fewer instructions: none with vectors of
256 bits, none that fuses a product with a sum."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
from brickwork import AFFINES, LIT, batch_of, bricks_of, cut_of_bricks, hills, ordered, placed, transfer_of, view_of

from renderer.bricks import ScreenSampling
from renderer.draw import CPURasterizer

ROOT = Path(__file__).resolve().parents[2]

CHILD = """
import pickle, sys
from renderer.draw import CPURasterizer

with CPURasterizer(num_threads=1) as rasterizer:
    sys.stdout.buffer.write(rasterizer.rasterize(*pickle.load(sys.stdin.buffer)).tobytes())
"""


def test_the_same_bytes_with_fewer_instructions(tmp_path: Path) -> None:
    """Scalars and means are drawn, with light; the bricks come from this process."""
    volume = placed(hills((12, 16, 150), 9.0), AFFINES["oblique"])
    transfer = transfer_of((0, (0.9, 0.2, 0.1), 0.0), (0.4, (0.1, 0.5, 1.0), 0.3), (0.4, (1.0, 1.0, 1.0), 2.0))
    bricks = bricks_of(volume, transfer, LIT)
    # A brick of level 3 covers voxels from 128 on.
    cells = np.array([[1, 0, 0], *([x, 0, 0] for x in range(8))], np.int32)
    cut = cut_of_bricks(bricks, np.array([3, *[0] * 8], np.uint8), cells)
    batch = batch_of(cut, bricks, step=0.3, shading=LIT, screen_sampling=ScreenSampling((4, 1), 0.02, 0.01))
    view = view_of(volume, "perspective", (60, 50))
    drawing = batch, ordered(cut, view), view
    with CPURasterizer(num_threads=1) as rasterizer:
        image = rasterizer.rasterize(*drawing)
    assert len(cut) == 9 and image[..., 3].max() > 0.9
    environment = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", CHILD],
        cwd=ROOT,
        env=os.environ | {"PYTHONPATH": str(ROOT)} | environment,
        input=pickle.dumps(drawing),
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()
    assert done.stdout == image.tobytes()
