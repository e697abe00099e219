"""The same pictures, byte for byte, from loops that are compiled for another processor."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from brickwork import AFFINES, batch_of, bricks_of, hills, level_cut, ordered, placed, transfer_of, view_of

from renderer.draw import CPURasterizer
from renderer.lanes import NUM_LANES
from renderer.scene import ShadingSpec

SHADING = ShadingSpec(light=(1.0, -1.0, 0.5), ambient=0.3, diffuse=0.7)
# More segments than a vector has lanes, steps among them.
LAYERS = tuple((k / 20, (k % 3 / 2, k % 5 / 4, 1 - k / 20), k % 4 * 1.5) for k in range(20))
FOG = ((0.2, (0.9, 0.2, 0.1), 0.0), (1.0, (0.1, 0.5, 1.0), 2.0))


def digest() -> str:
    """Return a digest of pictures with few and many segments, lit and not, of scalars and of means."""
    total = hashlib.blake2b(digest_size=16)
    volume = placed(hills((40, 36, 44), 14.0), AFFINES["oblique"])
    with CPURasterizer(num_threads=1) as rasterizer:
        for points, shading in ((FOG, SHADING), (LAYERS, SHADING), (LAYERS, None)):
            bricks = bricks_of(volume, transfer_of(*points), shading)
            for level, camera in ((0, "perspective"), (1, "orthographic"), (0, "inside")):
                batch, view = batch_of(level_cut(bricks, level), bricks, shading=shading), view_of(volume, camera)
                total.update(rasterizer.rasterize(batch, ordered(batch.cut, view), view).tobytes())
    return total.hexdigest()


@pytest.mark.skipif(platform.machine() != "x86_64", reason="its compiler knows no x86-64")
def test_pictures_do_not_depend_on_the_processor() -> None:
    """Against the oldest one, without `fma`, whose registers hold four lanes."""
    paths = os.pathsep.join([str(Path(__file__).resolve().parents[1] / "support"), *filter(None, sys.path)])
    environment = {**os.environ, "PYTHONPATH": paths, "NUMBA_CPU_NAME": "x86-64", "NUMBA_CPU_FEATURES": ""}
    run = subprocess.run([sys.executable, __file__], env=environment, capture_output=True, text=True, check=False)
    assert run.stdout.split() == ["4", digest()], run.stderr


if __name__ == "__main__":
    sys.stdout.write(f"{NUM_LANES} {digest()}\n")
