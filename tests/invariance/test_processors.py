"""Other processors: compiled loops pass their tests there, and give the same pyramids and pictures, byte for byte.

Each processor has a process and a cache of its own. Its code runs on this one, which has all of its instructions.
"""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from brickwork import AFFINES, GLOSSY, batch_of, bricks_of, cut_of_bricks, hills, ordered, placed, transfer_of, view_of
from llvmlite import binding

from renderer.bricks import ScreenSampling
from renderer.compiled import num_lanes
from renderer.draw import CPURasterizer
from renderer.scene import ShadingSpec

# The number of its lanes, and an instruction that this processor needs to run its code.
PROCESSORS = {"x86-64": (4, "sse2"), "haswell": (8, "avx2")}
TESTS_OF_LANES = Path(__file__).resolve().parents[1] / "unit" / "test_lanes.py"
SUPPORT = Path(__file__).resolve().parents[1] / "support"

SHADING = ShadingSpec(light=(1.0, -1.0, 0.5), ambient=0.3, diffuse=0.7)
# More segments than a vector has lanes, steps among them.
LAYERS = tuple((k / 20, (k % 3 / 2, k % 5 / 4, 1 - k / 20), k % 4 * 1.5) for k in range(20))
FOG = ((0.2, (0.9, 0.2, 0.1), 0.0), (1.0, (0.1, 0.5, 1.0), 2.0))
# A brick of level 3, which covers voxels from 128 on, beside bricks of level 0.
LEVELS, CELLS = np.array([3, *[0] * 8], np.uint8), np.array([[1, 0, 0], *([x, 0, 0] for x in range(8))], np.int32)
EVERY_FOURTH_PIXEL = ScreenSampling((4, 1), 0.02, 0.01)


def digest() -> str:
    """Return a digest of pyramids, and of pictures with few and many segments, lit or not, of scalars and of means."""
    total = hashlib.blake2b(digest_size=16)
    volume = placed(hills((12, 16, 150), 9.0), AFFINES["oblique"])
    with CPURasterizer(num_threads=1) as rasterizer:
        for points, shading in ((FOG, SHADING), (LAYERS, SHADING), (LAYERS, None), (LAYERS, GLOSSY)):
            bricks = bricks_of(volume, transfer_of(*points), shading)
            for level in bricks.pyramid.levels:
                for array in level:
                    total.update(array.tobytes())
            cut = cut_of_bricks(bricks, LEVELS, CELLS)
            for camera, sampling in (("perspective", EVERY_FOURTH_PIXEL), ("orthographic", None), ("inside", None)):
                options = {} if sampling is None else {"screen_sampling": sampling}
                batch, view = batch_of(cut, bricks, shading=shading, **options), view_of(volume, camera)
                picture = rasterizer.rasterize(batch, ordered(cut, view), view)
                assert picture[..., 3].max() > 0.5
                total.update(picture.tobytes())
    return total.hexdigest()


def runs_here(instruction: str) -> bool:
    return platform.machine() == "x86_64" and bool(binding.get_host_cpu_features()[instruction])


@pytest.mark.parametrize("processor", [name for name, (_, needed) in PROCESSORS.items() if runs_here(needed)])
def test_another_processor(processor: str, tmp_path: Path) -> None:
    paths = os.pathsep.join([str(SUPPORT), *filter(None, sys.path)])
    chosen = {"NUMBA_CPU_NAME": processor, "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    environment = {**os.environ, "PYTHONPATH": paths, **chosen}
    run = subprocess.run([sys.executable, __file__], env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    num_lanes, _ = PROCESSORS[processor]
    assert run.stdout.splitlines()[-1].split() == [str(num_lanes), digest()]


if __name__ == "__main__":
    # One of these tests chooses processors itself.
    failed = pytest.main(["-q", "-p", "no:cacheprovider", "-k", "not registers", str(TESTS_OF_LANES)])
    print(num_lanes(), digest())
    sys.exit(failed)
