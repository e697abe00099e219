"""Other processors: kernels give the same pyramids and pictures, byte for byte, at every level that is built.

Each level has a process of its own, on this processor, which offers all of them. Pictures are near the reference, too.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from brick_reference import rasterize_bricks_reference
from brickwork import AFFINES, GLOSSY, batch_of, bricks_of, cut_of_bricks, hills, ordered, placed, transfer_of, view_of

from renderer.bricks import BrickBatch, ScreenSampling
from renderer.draw import BrickRasterizer
from renderer.kernels import BUILT, LEVELS, processor_level
from renderer.lighting import compute_light_grid
from renderer.scene import ShadingSpec
from renderer.volume import make_volume

SUPPORT = Path(__file__).resolve().parents[1] / "support"

SHADING = ShadingSpec(light=(1.0, -1.0, 0.5), ambient=0.3, diffuse=0.7)
OCCLUSION = replace(SHADING, occlusion=0.7, shadow=0.5)
# More segments than a vector has lanes, steps among them.
LAYERS = tuple((k / 20, (k % 3 / 2, k % 5 / 4, 1 - k / 20), k % 4 * 1.5) for k in range(20))
FOG = ((0.2, (0.9, 0.2, 0.1), 0.0), (1.0, (0.1, 0.5, 1.0), 2.0))
# A brick of level 3, which covers voxels from 128 on, beside bricks of level 0.
LEVELS_OF_BRICKS = np.array([3, *[0] * 8], np.uint8)
CELLS = np.array([[1, 0, 0], *([x, 0, 0] for x in range(8))], np.int32)
EVERY_FOURTH_PIXEL = ScreenSampling((4, 1), 0.02, 0.01)
# What float32 and the volumes' steepness leave (tests/parity/test_brick_parity.py).
PRECISION = 6e-5


def digest() -> str:
    """Return a digest of pyramids, and of pictures with few and many segments, lit or not, of scalars and of means,
    with voxels that have no data, of two volumes that are mixed, and of the light on a grid."""
    total = hashlib.blake2b(digest_size=16)
    values = hills((12, 16, 150), 9.0)
    volume = placed(values, AFFINES["oblique"])
    gaps = np.where(np.random.default_rng(1).random(values.shape) < 0.1, np.float32(np.nan), values)
    patchy = make_volume(gaps, volume.world_from_index, "test", num_absent=int(np.isnan(gaps).sum()))
    for shading in (OCCLUSION, replace(OCCLUSION, light=(-3.0, 1.0, -0.2))):  # to either side
        grid = compute_light_grid(volume, transfer_of(*LAYERS), shading)
        total.update(grid.occlusion.tobytes() + grid.shadow.tobytes())
    before: BrickBatch | None = None
    with BrickRasterizer(num_threads=1) as rasterizer:
        for points, shading, of in (
            (FOG, SHADING, volume),
            (LAYERS, SHADING, volume),
            (LAYERS, None, volume),
            (LAYERS, GLOSSY, volume),
            (FOG, GLOSSY, patchy),
            (LAYERS, None, patchy),
        ):
            bricks = bricks_of(of, transfer_of(*points), shading)
            for level in bricks.pyramid.levels:
                for array in level:
                    total.update(array.tobytes())
            cut = cut_of_bricks(bricks, LEVELS_OF_BRICKS, CELLS)
            for camera, sampling in (("perspective", EVERY_FOURTH_PIXEL), ("orthographic", None), ("inside", None)):
                options = {} if sampling is None else {"screen_sampling": sampling}
                batch, view = batch_of(cut, bricks, shading=shading, **options), view_of(of, camera)
                order = ordered(cut, view)
                picture = rasterizer.rasterize([batch], [order], view)
                assert picture[..., 3].max() > 0.5
                total.update(picture.tobytes())
                before = before or batch
                total.update(rasterizer.rasterize([before, batch], [order, order], view).tobytes())
                if camera == "orthographic" and of is volume and shading is not GLOSSY:
                    expected = rasterize_bricks_reference(batch, ordered(cut, view), view)
                    assert np.abs(picture - expected).max() < PRECISION
    return total.hexdigest()


LOWER_LEVELS = [
    level
    for levels in LEVELS.values()
    for level in levels
    if level < processor_level() and (BUILT / f"kernels-{level}.so").is_file()
]


@pytest.mark.parametrize("level", LOWER_LEVELS)
def test_another_processor(level: int) -> None:
    paths = os.pathsep.join([str(SUPPORT), *filter(None, sys.path)])
    environment = {**os.environ, "PYTHONPATH": paths, "HSPLAT_PROCESSOR_LEVEL": str(level)}
    run = subprocess.run([sys.executable, __file__], env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stdout + run.stderr
    assert run.stdout.split() == [str(level), digest()]


if __name__ == "__main__":
    print(processor_level(), digest())
