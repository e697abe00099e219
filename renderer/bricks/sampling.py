"""Give each brick the length of its steps, and say where a ray takes samples in it.

The ray through a pixel's centre meets a brick's visible bounds from t0 to t1, world
lengths, beyond the near plane. In index space, in cells of the brick, that stretch has the length L. It is divided into

    n = max(1, floor(L / step * (1 + DITHER * (jitter - 1/2)) + 1/2 + jitter))

segments of equal world length h, or one more where n is a multiple of four: a brick is 16 cells wide, and 8, 16 or 32
samples along an axis would lie alike in their cells, in brick after brick. The jitter, from 0 to 1, differs from pixel
to pixel: it is the fraction of (column, row) . JITTER_PER_PX (both in `rays.h`). It turns errors into noise of a grey
step or less. Without it, rings would show where n changes, and all of a brick would be off alike. In the middle of each
segment is a sample of the field, interpolated linearly between the centres of cells:

    level 0     u, a scalar; then c and tau of u, each piecewise linear; with light, c times the factor of the
                interpolated gradient, or what else ShadingSpec makes of it
    above       (tau c, tau)

both with tau times the finest spacing. A segment has the alpha `1 - exp(-tau h)` and the colour `tau c / tau`. Segments
and bricks are composited front to back.

M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences" (2018): jitter that is even over any block of
pixels, from powers of the plastic number.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from renderer.bricks.brick_cut import BrickCut
from renderer.bricks.brick_layers import BrickLayers
from renderer.bricks.pixel_grid import ScreenSampling, screen_sampling_at
from renderer.volume import Float64

# Steps, in cells. MAX_STEP is for bricks in which nothing changes. Tolerance 0 has ZERO_TOLERANCE_STEP, with errors of
# about 1/256 of the step error estimate, or of 1 where a cell has an optical depth above 1; no step is below MIN_STEP.
ZERO_TOLERANCE_STEP, MIN_STEP, MAX_STEP = 1 / 16, 1 / 128, 4.0
# A step is one cell where the step error estimate is 1 / UNIT_STEP_ERROR tolerances. With 1, thin structures (bonsai)
# lose 1 to 5 dB in the same time; with 0.3, smooth ones (engine).
UNIT_STEP_ERROR = 0.5
# Errors grow with step_error * step^2, samples with 1 / step. Of all choices with the same sum of squared errors,
# the one with the fewest samples has step^5 ~ 1 / step_error^2.
STEP_EXPONENT = 0.4
# The step error estimate of what is near a face that clipping cuts: its light changes within FACE_DEPTH voxels.
FACE_STEP_ERROR = 0.05


@dataclass(frozen=True)
class Extremes:
    """A search for the most extreme scalar of each ray, in bricks of level 0.

    offset, slope: of `offset + slope * u`, which is 0 where a scalar is as good as none, and 1 at the other end of the
        colours; u is the texel. Its maximum is sought.
    tops: float64 [n], an upper bound of it in each brick.
    slack: by how much it may be missed. by_depth: whether its place counts: the nearest of the largest.
    """

    offset: float
    slope: float
    tops: Float64
    slack: float
    by_depth: bool


@dataclass(frozen=True)
class BrickBatch:
    """A batch of bricks to draw, in the order of their cut.

    bricks: of all layers. steps: float64 [n], the approximate length of a step, in cells of the brick.
    origin: float64 [3], world position of the model's origin, the volume's centre.
    model_unit: world length of a model unit.
    extremes: how rays find their extreme scalar; None where they are composited.
    face_step: the longest step near a face that clipping cuts, in voxels.
    """

    cut: BrickCut
    bricks: BrickLayers
    steps: Float64
    screen_sampling: ScreenSampling
    origin: Float64
    model_unit: float
    extremes: Extremes | None = None
    face_step: float = MAX_STEP

    def __len__(self) -> int:
        return len(self.cut)


def make_brick_batch(cut: BrickCut, bricks: BrickLayers, *, tolerance: float, voxel_px: float) -> BrickBatch:
    """Return the bricks of a cut with the steps and pixels for a tolerance; voxels are about `voxel_px` pixels wide."""
    volume, pyramid = cut.volume, bricks.layers[0].bricks.pyramid
    # The error measure of the largest change of a pixel: 1, but for errors of the scalar the volume's range.
    widest = max(high - low for low, high in (layer.bricks.volume_range for layer in bricks.layers))
    largest_change = widest if pyramid.of == "scalar" and widest > 0 else 1.0
    thinnest = float((volume.spacing / volume.finest_spacing * volume.shape_xyz).min())
    finest = int(cut.levels.min(initial=len(bricks.levels)))
    # About the largest optical depth of a cell; where the measure does not tell, of the whole volume.
    densest = sum(layer.weight * layer.bricks.transfer.max_extinction for layer in bricks.layers)
    depths = np.full(len(cut), densest * volume.finest_spacing)
    return BrickBatch(
        cut,
        bricks,
        step_sizes(cut.step_errors, tolerance, cut.step_errors if pyramid.measure == "optical" else depths),
        screen_sampling_at(tolerance / largest_change, voxel_px * 2.0**finest, voxel_px * thinnest),
        volume.centre,
        volume.half_diagonal,
        face_step=float(step_sizes(np.array([FACE_STEP_ERROR]), tolerance / largest_change, np.ones(1))[0]),
    )


def step_sizes(step_errors: Float64, tolerance: float, depths: Float64) -> Float64:
    """Return the step, in cells, in bricks with these step error estimates and depths of a cell, float64 [n]."""
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        steps = np.where(step_errors > 0, (UNIT_STEP_ERROR * tolerance / step_errors) ** STEP_EXPONENT, np.inf)
    least = np.maximum(ZERO_TOLERANCE_STEP / np.sqrt(np.maximum(depths, 1.0)), MIN_STEP)
    return np.asarray(np.clip(steps, least, MAX_STEP), np.float64)
