"""Bricks as a rasteriser takes them, before any view is chosen: boxes, steps, and what may be spared at a tolerance.

What both rasterisers draw. The ray through a pixel's centre meets a brick's box from t0 to t1, world lengths, beyond
the near plane. In index space, in cells of the brick, that way is L long, and is cut into

    n = max(1, floor(L / step * (1 + DITHER * (phase - 1/2)) + 1/2 + phase))

equal parts of the world length h; one more where that is a multiple of four: a brick is 16 cells wide, and along an
axis with 8, 16 or 32 parts all their middles would lie alike in their cells, in brick after brick. The phase, from 0 to
1, is the pixel's own, (column, row) . JITTER_PER_PX without its whole part: what parts leave out is noise, of a level
or less, and not rings where n changes, or whole bricks that are off alike. In the middle of each part the field is
looked up, linear between the centres of cells:

    level 0     u, a scalar; then c and tau of u, each linear in the pieces of the transfer function; with light, c
                times the factor of the interpolated gradient
    above       (tau c, tau)

both with tau times the finest spacing; and a part has the alpha `1 - exp(-tau h)` and the colour `tau c / tau`. Parts,
and bricks, are composited front to back.

M. Roberts, "The Unreasonable Effectiveness of Quasirandom Sequences" (2018): phases that are even over any block of
pixels, from powers of the plastic number.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.bricks.bricks import BrickCut, Bricks
from renderer.scene import ShadingSpec
from renderer.transfer import PiecewiseTransfer

Float64 = npt.NDArray[np.float64]

# Steps, in cells: the longest are for bricks in which nothing changes. At the least, which tolerance 0 has, errors are
# about 1/256 of the roughness, or of 1 where a cell is an optical depth above 1, down to the shortest of all.
ZERO_TOLERANCE_STEP, MIN_STEP, MAX_STEP = 1 / 16, 1 / 128, 4.0
# A step is one cell where the roughness is this many tolerances: with 1 thin structures (bonsai) lose 1 to 5 dB of the
# same time, with 0.3 smooth ones (engine).
UNIT_STEP_ERROR = 0.5
# Errors grow with roughness * step^2, samples with 1 / step: of all choices with the same sum of squared errors the one
# with the fewest samples has step^5 ~ 1 / roughness^2.
STEP_EXPONENT = 0.4

# From which tolerance on which lattices of pixels are drawn. Below all of them every pixel is: next to all blocks of a
# finer lattice differ there, and what is thin must not fall between nodes.
STRIDES = ((2.0, (8, 4)), (1.0, (4, 2)), (0.15, (4, 1)))
# Nodes of the first lattice lie no further apart than so many of the finest cells for each STRIDE_TOLERANCE_UNIT of the
# tolerance, four of them at 0.3, and no further than this share of the volume's thinnest side. What is thinner may fall
# between them: a sheet seen edge-on, or what a steep transfer function cuts out of a cell.
MAX_STRIDE_CELLS, STRIDE_TOLERANCE_UNIT, MAX_STRIDE_THICKNESS = 1.35, 0.1, 0.5
# In tolerances: how much nodes may differ that are interpolated, and the transmittance behind which nothing is drawn.
# With a third, pictures are as exact as those of all pixels, within 2 dB at 0.15 to 0.5, where two of three CT scans
# take half to three quarters of their time; with 1 a shaded scan lost 10 dB for nothing. Behind 0.08 instead of 0.04
# two CT scans lose 1 to 1.5 dB, behind 0.15 3 to 5 more, and gain 2 to 4 % of the time.
DIFFERENCE_THRESHOLD, MAX_DIFFERENCE_THRESHOLD, TERMINATION_TRANSMITTANCE, MAX_TERMINATION_TRANSMITTANCE = (
    0.35,
    0.35,
    0.04,
    0.025,
)

# What float32 leaves of a transmittance is less.
_MIN_TERMINATION_TRANSMITTANCE = 2.0**-22

# By which share of n the numbers of parts of two pixels differ, beside one part. Over five scans, means of 8 x 8 pixels
# are 0.35 to 0.7 times as far off, at most, as with one number for all, in 3 to 5 % more time, since lanes of a
# processor wait for each other; 0.1 leaves more (0.5 to 0.75), 0.3 no less.
DITHER = 0.15
# In 2^-32: the plastic number's inverse, and its square.
JITTER_PER_PX = 3242174889, 2447445414


@dataclass(frozen=True)
class ScreenSampling:
    """What a picture need not be exact in.

    strides: falling, from which lattices of pixels the picture is made: on the first, every so manieth pixel along both
        axes is drawn. On each that follows only those blocks between four nodes of the one before are drawn whose nodes
        differ; the others are interpolated (bilinear), as are pixels between the nodes of the last lattice. (1,) draws
        every pixel.
    difference_threshold: four nodes differ where a channel (premultiplied RGBA) differs by more than this among them
    and a channel
        bends by more than this at one of them, along rows or columns: by `|a - 2 b + c|`, b the node and a and c its
        neighbours on the lattice, at the last ones itself.
    termination_transmittance: what lies behind less than this is not drawn.
    """

    strides: tuple[int, ...]
    difference_threshold: float
    termination_transmittance: float

    @property
    def termination_alpha(self) -> float:
        """The alpha behind which a ray may end: nothing is drawn there, or float32 would not keep it."""
        return 1 - max(self.termination_transmittance, _MIN_TERMINATION_TRANSMITTANCE)


@dataclass(frozen=True)
class BrickBatch:
    """Boxes in the order of their cut.

    steps: float64 [n], about how long a step is, in cells of the brick.
    pieces: as in Bricks.
    origin: float64 [3], world position of the model's origin, the volume's centre. model_unit: world length of a model
    unit.
    """

    cut: BrickCut
    bricks: Bricks
    steps: Float64
    pieces: PiecewiseTransfer
    shading: ShadingSpec | None
    screen_sampling: ScreenSampling
    origin: Float64
    model_unit: float

    def __len__(self) -> int:
        return len(self.cut)

    @property
    def spacings_per_model_unit(self) -> float:
        """The finest spacing's worth in model units: what tau times that spacing is multiplied by for tau per unit."""
        return self.model_unit / self.cut.volume.finest_spacing


def toward_light(shading: ShadingSpec) -> Float64:
    """float64 [3], world axes, of unit length."""
    light = np.array(shading.light, np.float64)
    return np.asarray(light / np.linalg.norm(light))


def make_brick_batch(
    cut: BrickCut,
    bricks: Bricks,
    *,
    tolerance: float,
    shading: ShadingSpec | None,
    voxel_px: float,
    pixel_tolerance: float | None = None,
) -> BrickBatch:
    """What a cut at a tolerance looks like, on a film on which a voxel appears about `voxel_px` pixels wide.

    pixel_tolerance: how much of a pixel's channel the tolerance stands for; None where that is the measure's own unit.
    """
    volume = cut.volume
    length = 0.5 * float(np.linalg.norm(volume.world_from_index[:3, :3] * np.array(volume.shape_xyz)))
    thinnest = float((volume.spacing / volume.finest_spacing * volume.shape_xyz).min())
    finest = int(cut.levels.min(initial=len(bricks.levels)))
    return BrickBatch(
        cut,
        bricks,
        step_sizes(cut.step_errors, tolerance, _depths(cut, bricks)),
        bricks.pieces,
        shading,
        screen_sampling_at(
            tolerance if pixel_tolerance is None else pixel_tolerance, voxel_px * 2.0**finest, voxel_px * thinnest
        ),
        volume.centre,
        length,
    )


def _depths(cut: BrickCut, bricks: Bricks) -> Float64:
    """float64 [n]: of cells of bricks, about the largest; without the measure for it, that of the whole volume."""
    if bricks.pyramid.measure == "optical":
        return cut.step_errors
    return np.full(len(cut), bricks.transfer.max_extinction * cut.volume.finest_spacing)


def step_sizes(roughness: Float64, tolerance: float, depths: Float64) -> Float64:
    """float64 [n]: the step, in cells, in bricks of some roughness, whose cells have these optical depths."""
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):
        steps = np.where(roughness > 0, (UNIT_STEP_ERROR * tolerance / roughness) ** STEP_EXPONENT, np.inf)
    least = np.maximum(ZERO_TOLERANCE_STEP / np.sqrt(np.maximum(depths, 1.0)), MIN_STEP)
    return np.asarray(np.clip(steps, least, MAX_STEP), np.float64)


def screen_sampling_at(tolerance: float, cell_px: float, thinnest_px: float = math.inf) -> ScreenSampling:
    """What is spared at a tolerance where the finest cells appear `cell_px` pixels wide, and the volume's thinnest side
    `thinnest_px`."""
    most = min(MAX_STRIDE_CELLS * cell_px * tolerance / STRIDE_TOLERANCE_UNIT, MAX_STRIDE_THICKNESS * thinnest_px)
    strides = next((wanted for least, wanted in STRIDES if tolerance >= least and wanted[0] <= most), (1,))
    spread = min(DIFFERENCE_THRESHOLD * tolerance, MAX_DIFFERENCE_THRESHOLD) if len(strides) > 1 else 0.0
    return ScreenSampling(strides, spread, min(TERMINATION_TRANSMITTANCE * tolerance, MAX_TERMINATION_TRANSMITTANCE))
