"""Bricks as a rasteriser takes them, before a view is chosen: bounds, steps, and what a tolerance allows to save.

Both rasterisers draw this. The ray through a pixel's centre meets a brick's visible bounds from t0 to t1, world
lengths, beyond the near plane. In index space, in cells of the brick, that stretch has the length L. It is divided into

    n = max(1, floor(L / step * (1 + DITHER * (jitter - 1/2)) + 1/2 + jitter))

segments of equal world length h, or one more where n is a multiple of four: a brick is 16 cells wide, and 8, 16 or 32
samples along an axis would lie alike in their cells, in brick after brick. The jitter, from 0 to 1, differs from pixel
to pixel: it is the fraction of (column, row) . JITTER_PER_PX. Errors are then noise, of a level or less, and neither
rings where n changes nor whole bricks that are off alike. In the middle of each segment is a sample of the field,
interpolated linearly between the centres of cells:

    level 0     u, a scalar; then c and tau of u, each piecewise linear; with light, c times the factor of the
                interpolated gradient
    above       (tau c, tau)

both with tau times the finest spacing. A segment has the alpha `1 - exp(-tau h)` and the colour `tau c / tau`. Segments
and bricks are composited front to back.

M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences" (2018): jitter that is even over any block of
pixels, from powers of the plastic number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.bricks.brick_cut import BrickCut
from renderer.bricks.bricks import Bricks
from renderer.scene import ShadingSpec

Float64 = npt.NDArray[np.float64]

# Steps, in cells. MAX_STEP is for bricks in which nothing changes. Tolerance 0 has ZERO_TOLERANCE_STEP, with errors of
# about 1/256 of the step error estimate, or of 1 where a cell has an optical depth above 1; no step is below MIN_STEP.
ZERO_TOLERANCE_STEP, MIN_STEP, MAX_STEP = 1 / 16, 1 / 128, 4.0
# A step is one cell where the step error estimate is 1 / UNIT_STEP_ERROR tolerances. With 1, thin structures (bonsai)
# lose 1 to 5 dB in the same time; with 0.3, smooth ones (engine).
UNIT_STEP_ERROR = 0.5
# Errors grow with step_error * step^2, samples with 1 / step. Of all choices with the same sum of squared errors, that
# with the fewest samples has step^5 ~ 1 / step_error^2.
STEP_EXPONENT = 0.4

# Subsampled pixel grids from a tolerance on. Below all of them every pixel is drawn: next to all blocks of a finer grid
# differ there, and thin structures must not fall between its nodes.
STRIDES = ((2.0, (8, 4)), (1.0, (4, 2)), (0.15, (4, 1)))
# Nodes of the first grid are at most MAX_STRIDE_CELLS of the finest cells apart for each STRIDE_TOLERANCE_UNIT of the
# tolerance, four of them at 0.3, and at most this share of the volume's thinnest side. Thinner structures may fall
# between them: a sheet seen edge-on, or what a steep transfer function cuts out of a cell.
MAX_STRIDE_CELLS, STRIDE_TOLERANCE_UNIT, MAX_STRIDE_THICKNESS = 1.35, 0.1, 0.5
# In tolerances: how much nodes may differ that are interpolated, and the transmittance at which a ray ends.
# With a third, pictures are as exact as those of all pixels, within 2 dB at 0.15 to 0.5, where two of three CT scans
# take half to three quarters of the time; with 1 a shaded scan lost 10 dB for nothing. With a transmittance of 0.08
# instead of 0.04 two CT scans lose 1 to 1.5 dB, with 0.15 3 to 5 more, and gain 2 to 4 % of the time.
DIFFERENCE_THRESHOLD, MAX_DIFFERENCE_THRESHOLD = 0.35, 0.35
TERMINATION_TRANSMITTANCE, MAX_TERMINATION_TRANSMITTANCE = 0.04, 0.025

# float32 does not resolve a smaller transmittance.
_MIN_TERMINATION_TRANSMITTANCE = 2.0**-22

# By which share of n the numbers of segments of two pixels differ, besides one. Over five scans, means of 8 x 8 pixels
# are at most 0.35 to 0.7 times as far off as with one number for all, in 3 to 5 % more time, because lanes of a
# processor wait for each other; 0.1 leaves more (0.5 to 0.75), 0.3 no less.
DITHER = 0.15
# In 2^-32: the plastic number's inverse, and its square.
JITTER_PER_PX = 3242174889, 2447445414


@dataclass(frozen=True)
class ScreenSampling:
    """Which pixels of a picture are drawn, and where rays end.

    strides: falling, of the subsampled pixel grids. The first grid draws one of `stride` pixels along both axes. Each
        later grid draws only the blocks between four nodes of the grid before whose nodes differ. The other blocks are
        interpolated (bilinear), as are pixels between the nodes of the last grid. (1,) draws every pixel.
    difference_threshold: four nodes differ where a channel (premultiplied RGBA) differs by more than this among them
        and a channel bends by more than this at one of them, along rows or columns: by `|a - 2 b + c|`, with b the node
        and a and c its neighbours on the grid, at the edge the node itself.
    termination_transmittance: rays end at a smaller transmittance.
    """

    strides: tuple[int, ...]
    difference_threshold: float
    termination_transmittance: float

    @property
    def termination_alpha(self) -> float:
        """Return the alpha at which a ray may end: nothing behind it is drawn, or float32 would lose it."""
        return 1 - max(self.termination_transmittance, _MIN_TERMINATION_TRANSMITTANCE)


@dataclass(frozen=True)
class BrickBatch:
    """Bricks to draw, in the order of their cut.

    steps: float64 [n], the approximate length of a step, in cells of the brick.
    origin: float64 [3], world position of the model's origin, the volume's centre.
    model_unit: world length of a model unit.
    """

    cut: BrickCut
    bricks: Bricks
    steps: Float64
    shading: ShadingSpec | None
    screen_sampling: ScreenSampling
    origin: Float64
    model_unit: float

    def __len__(self) -> int:
        return len(self.cut)

    @property
    def spacings_per_model_unit(self) -> float:
        """Return the factor from tau times the finest spacing to tau per model unit."""
        return self.model_unit / self.cut.volume.finest_spacing


def make_brick_batch(
    cut: BrickCut,
    bricks: Bricks,
    *,
    tolerance: float,
    shading: ShadingSpec | None,
    voxel_px: float,
    pixel_tolerance: float | None = None,
) -> BrickBatch:
    """Return the bricks of a cut with the steps and pixels for a tolerance; voxels are about `voxel_px` pixels wide.

    pixel_tolerance: the change of a pixel's channel that the tolerance stands for; None where it is in that unit.
    """
    volume, measure = cut.volume, bricks.pyramid.measure
    model_unit = 0.5 * float(np.linalg.norm(volume.world_from_index[:3, :3] * np.array(volume.shape_xyz)))
    thinnest = float((volume.spacing / volume.finest_spacing * volume.shape_xyz).min())
    finest = int(cut.levels.min(initial=len(bricks.levels)))
    # About the largest optical depth of a cell; where the measure does not tell, of the whole volume.
    depths = np.full(len(cut), bricks.transfer.max_extinction * volume.finest_spacing)
    return BrickBatch(
        cut,
        bricks,
        step_sizes(cut.step_errors, tolerance, cut.step_errors if measure == "optical" else depths),
        shading,
        screen_sampling_at(
            tolerance if pixel_tolerance is None else pixel_tolerance, voxel_px * 2.0**finest, voxel_px * thinnest
        ),
        volume.centre,
        model_unit,
    )


def step_sizes(step_errors: Float64, tolerance: float, depths: Float64) -> Float64:
    """Return the step, in cells, in bricks with these step error estimates and depths of a cell, float64 [n]."""
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        steps = np.where(step_errors > 0, (UNIT_STEP_ERROR * tolerance / step_errors) ** STEP_EXPONENT, np.inf)
    least = np.maximum(ZERO_TOLERANCE_STEP / np.sqrt(np.maximum(depths, 1.0)), MIN_STEP)
    return np.asarray(np.clip(steps, least, MAX_STEP), np.float64)


def screen_sampling_at(tolerance: float, cell_px: float, thinnest_px: float = math.inf) -> ScreenSampling:
    """Return the screen sampling at a tolerance.

    cell_px, thinnest_px: widths in pixels of the finest cells, and of the volume's thinnest side.
    """
    most = min(MAX_STRIDE_CELLS * cell_px * tolerance / STRIDE_TOLERANCE_UNIT, MAX_STRIDE_THICKNESS * thinnest_px)
    strides = next((wanted for least, wanted in STRIDES if tolerance >= least and wanted[0] <= most), (1,))
    threshold = min(DIFFERENCE_THRESHOLD * tolerance, MAX_DIFFERENCE_THRESHOLD) if len(strides) > 1 else 0.0
    return ScreenSampling(strides, threshold, min(TERMINATION_TRANSMITTANCE * tolerance, MAX_TERMINATION_TRANSMITTANCE))
