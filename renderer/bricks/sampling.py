"""Give each brick the length of its steps, and say where a ray takes samples in it.

The ray through a pixel's centre is inside a brick's visible bounds from t0 to t1, world lengths, beyond the near plane.
In cells of the brick, this part of the ray has the length L. It is divided into

    n = max(1, floor(L / step * (1 + DITHER * (jitter - 1/2)) + 1/2 + jitter))

segments of equal world length h, or one more where n is a multiple of four: a brick is 16 cells wide, and 8, 16 or 32
samples along an axis would lie alike in their cells, in brick after brick. The jitter, from 0 to 1, differs from pixel
to pixel: it is the fraction of (column, row) . JITTER_PER_PX. It turns errors into noise of a grey step or less.
Without jitter, rings would show where n changes, and all samples of a brick would err alike: means over 8 x 8 pixels
have 0.35 to 0.7 of the error with it, and 0.7 to 0.95 without DITHER. A pixel has the same jitter on every frame, or
still parts would flicker. Segments are equal, as errors then fall with the square of the step; segments that grow along
a ray leave a pattern. If n were odd throughout, pictures would lose 0.5 to 1.5 dB. (DITHER and JITTER_PER_PX are
constants of the kernels, in `rays.h`.) In the middle of each segment, the field is sampled, with linear interpolation
between the centres of cells:

    level 0     u, a scalar; then the colour c and the extinction tau of u, each piecewise linear; with light, c times
                the factor of the interpolated gradient, and the other effects of ShadingSpec
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

# The length of a step at tolerance 0, in cells, which is also the shortest step at other tolerances. Errors are then
# about 1/256 of the step error estimate. In bricks whose cells have an optical depth above 1, the length is divided by
# the root of this depth, with errors of about 1/256.
ZERO_TOLERANCE_STEP = 1 / 16
# The length of the shortest step, in cells, whatever the optical depth of cells.
MIN_STEP = 1 / 128
# The length of the longest step, in cells, for bricks in which nothing changes.
MAX_STEP = 4.0
# A step is one cell long if the step error estimate of its brick is this share of the tolerance. With 1 in place of
# 0.5, pictures of thin structures (the volume bonsai) lose 1 to 5 dB in the same time; with 0.3, pictures of smooth
# ones (the volume engine) do.
UNIT_STEP_ERROR = 0.5
# The length of a step grows with this power of the tolerance divided by the step error estimate. Errors grow with
# step_error * step^2, numbers of samples with 1 / step. Of all step lengths with the same sum of squared errors, the
# ones with step^5 ~ 1 / step_error^2 have the fewest samples. Thin structures (bonsai) have 53 dB in the time in which
# equal steps give 44 dB, and a pre-integrated transfer function (Engel et al. 2001) with these steps 49 dB: its
# trapezoid rule has twice the error where the field is smooth.
STEP_EXPONENT = 0.4
# The step error estimate of samples near a face that clipping cuts, where light changes within FACE_DEPTH voxels.
FACE_STEP_ERROR = 0.05

# Texels are kept as voxels if a picture takes fewer samples of a voxel than this. On a ball of noise, 128^3 uint8, with
# 0.5, 1, 2 and 4 samples of a voxel, a frame takes 0.87, 0.97, 1.2 and 1.3 of its time with texels of float32 if it is
# lit, and 0.94, 1, 1.05 and 1.1 if not. The first frame, which makes the texels, takes 0.3, 0.7, 0.6 and 1.1 if lit.
_MAX_SAMPLES_OF_VOXEL = 1.0


@dataclass(frozen=True)
class Extremes:
    """A search for the most extreme scalar of each ray, in bricks of level 0.

    A ray looks for the largest number `offset + slope * u`, with u a texel. The number is 0 at the end of the colour
    range that counts as showing nothing, and 1 at the other end.

    offset, slope: the coefficients of the number.
    tops: float64 [n], an upper bound of the number in each brick.
    slack: a brick is passed over if its numbers exceed the largest number of a ray by no more than this.
    by_depth: whether pictures show the depth of the largest number. If several points have it, the nearest one counts.
    """

    offset: float
    slope: float
    tops: Float64
    slack: float
    by_depth: bool


@dataclass(frozen=True)
class BrickBatch:
    """A batch of bricks to draw, in the order of their cut.

    bricks: the bricks of all layers, from which the batch was cut.
    steps: float64 [n], the approximate length of a step in each brick, in cells of the brick.
    screen_sampling: which pixels are drawn, and which are interpolated.
    origin: float64 [3], the world position of the model's origin, the volume's centre.
    model_unit: the world length of a model unit: half of the volume's diagonal.
    extremes: how rays find their extreme scalar; None if samples are composited.
    face_step: the longest step near a face that clipping cuts, in voxels.
    samples_per_voxel: about how many samples a picture takes of a voxel, if no ray ends early.
    """

    cut: BrickCut
    bricks: BrickLayers
    steps: Float64
    screen_sampling: ScreenSampling
    origin: Float64
    model_unit: float
    extremes: Extremes | None = None
    face_step: float = MAX_STEP
    samples_per_voxel: float = 0.0

    def __len__(self) -> int:
        return len(self.cut)

    @property
    def keeps_voxels(self) -> bool:
        """Return whether texels of level 0 are best kept as voxels, which samples turn into scalars and gradients."""
        return self.samples_per_voxel < _MAX_SAMPLES_OF_VOXEL


def make_brick_batch(cut: BrickCut, bricks: BrickLayers, *, tolerance: float, voxel_px: float) -> BrickBatch:
    """Return the bricks of a cut, with the step lengths and the pixels for a tolerance.

    tolerance: in the unit of the error measure. voxel_px: the width of voxels on the image, in pixels.
    """
    volume, pyramid = cut.volume, bricks.layers[0].bricks.pyramid
    # The error that stands for the largest change of a pixel: 1, or the volume's range if errors are of the scalar.
    widest = max(high - low for low, high in (layer.bricks.volume_range for layer in bricks.layers))
    largest_change = widest if pyramid.of == "scalar" and widest > 0 else 1.0
    thinnest = float((volume.spacing / volume.finest_spacing * volume.shape_xyz).min())
    finest = int(cut.levels.min(initial=len(bricks.levels)))
    # About the optical depth of a cell: the step error estimate if the error measure is `optical`; if not, the largest
    # depth of a voxel of the volume.
    densest = sum(layer.weight * layer.bricks.transfer.max_extinction for layer in bricks.layers)
    depths = np.full(len(cut), densest * volume.finest_spacing)
    steps = step_sizes(cut.step_errors, tolerance, cut.step_errors if pyramid.measure == "optical" else depths)
    per_step = 1 / steps[cut.levels == 0]
    return BrickBatch(
        cut,
        bricks,
        steps,
        screen_sampling_at(tolerance / largest_change, voxel_px * 2.0**finest, voxel_px * thinnest),
        volume.centre,
        volume.half_diagonal,
        face_step=float(step_sizes(np.array([FACE_STEP_ERROR]), tolerance / largest_change, np.ones(1))[0]),
        samples_per_voxel=voxel_px**2 * float(per_step.mean()) if len(per_step) else 0.0,
    )


def step_sizes(step_errors: Float64, tolerance: float, depths: Float64) -> Float64:
    """Return the length of a step in each brick, in cells: float64 [n].

    step_errors: [n], the step error estimate of each brick. depths: [n], the optical depth of a cell of each brick.
    """
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        steps = np.where(step_errors > 0, (UNIT_STEP_ERROR * tolerance / step_errors) ** STEP_EXPONENT, np.inf)
    least = np.maximum(ZERO_TOLERANCE_STEP / np.sqrt(np.maximum(depths, 1.0)), MIN_STEP)
    return np.asarray(np.clip(steps, least, MAX_STEP), np.float64)
