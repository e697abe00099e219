"""A frame of bricks against the reference rasteriser, which draws the same batch in float64."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from brick_reference import nudged, rasterize_bricks_reference
from compare import SPREADS, WrongError, require_close

from renderer.bricks import BrickBatch
from renderer.draw import Rasterizer
from renderer.film import quantize
from renderer.frame import Frame, Stage, make_primitive
from renderer.view import View
from renderer.volume import Array

# Of places and parts, where nothing is steep (tests/parity/test_brick_parity.py).
PRECISION = 6e-5
# Where something is: by how much longer and shorter steps are, to which sides places are off, in units of what they are
# rounded to. SPREADS times the spread of such pictures may be off.
NUDGES = ((-1e-3, (1, 1, 1)), (-1e-5, (1, -1, -1)), (1e-5, (-1, 1, -1)), (1e-3, (-1, -1, 1)))
PLACE = 2.0**-12  # of a cell


def compare_bricks(stage: Stage, frame: Frame, view: View, rasterizer: Rasterizer) -> None:
    """Raise WrongError where too many pixels differ from the reference by more than rounding explains."""
    primitive = make_primitive(stage)
    lod = primitive.make_lod(frame.tolerance, lambda stage: None)
    if frame.num_cells != lod.num_cells:
        raise WrongError(f"{frame.num_cells} bricks in the frame, {lod.num_cells} in its cut")
    (batch,), ((_, (order,)),) = lod.batches, lod.orders(view)
    _require_bounds(frame.radiance, stage)
    if not np.array_equal(frame.image, quantize(frame.radiance, stage.scene.output.background)):
        raise WrongError("the 8 bits are not those of the radiance")
    with np.errstate(under="ignore"):
        expected = rasterize_bricks_reference(batch, order, view)
        others = [
            rasterize_bricks_reference(nudged(batch, nudge, nudge), order, _moved(view, batch, sides))
            for nudge, sides in NUDGES
        ]
    spread = np.ptp([expected, *others], axis=0)
    termination = batch.screen_sampling.termination_transmittance
    require_close(frame.radiance, expected, PRECISION + termination + SPREADS * spread)


def _moved(view: View, batch: BrickBatch, sides: tuple[int, int, int]) -> View:
    cell = batch.cut.volume.world_from_index[:3, :3] * 2.0 ** int(batch.cut.levels.max(initial=0))
    return replace(view, target=view.target + PLACE * cell @ np.array(sides))


def _require_bounds(radiance: Array, stage: Stage) -> None:
    shading = stage.scene.layers[0].shading
    brightest = max(1.0, shading.ambient + shading.diffuse) if shading else 1.0
    if radiance.min() < 0 or radiance[..., 3].max() > 1 + 1e-5 or radiance[..., :3].max() > brightest + 1e-5:
        raise WrongError(f"radiance from {radiance.min()} to {radiance.max(axis=(0, 1)).tolist()}")
