"""Interpolation in a brick, against exact fractions and closed forms."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from brickwork import scalar_texels
from extremes import Extreme, Random, Section, worst_of
from number_types import random_ranges

from renderer.bricks import BRICK_LEVELS, BRICK_SIZE, PADDED_BRICK_SIZE, Bricks, make_bricks, mean_texels
from renderer.scene import ErrorSpec, PyramidSpec
from renderer.transfer import MAX_NORMALIZED_SCALAR, TransferFunction
from renderer.volume import Array, make_volume

# Texels beyond a brick, at each of its faces.
HALO = 1

U = 2.0**-24
# Texels compared in each volume: fractions are slow.
NUM_SAMPLES = 20


def bricks_of(values: Array, control: tuple[float, float], extinction: float = 1.0) -> Bricks:
    """Build bricks of an extinction from 0 to the given one between two scalars, in single precision."""
    transfer = TransferFunction(np.array(control), np.full((2, 3), 0.5), np.array([0.0, extinction]), 1.0)
    volume = make_volume(values, np.eye(4), "extreme")
    return make_bricks(volume, transfer, spec=PyramidSpec(precision="single"), error=ErrorSpec())


def scalar_error(num_cases: int) -> float:
    """Return the worst error of texels in the range of a function over a random part of the volume's range."""
    worst = Fraction(0)
    for case, values in enumerate(random_ranges(num_cases)):
        rng = np.random.default_rng(case)
        volume = values.reshape((10, 10, 10) if values.size == 1000 else values.shape)
        first, last = sorted(float(s) for s in rng.choice(values.ravel(), 2))
        bricks = bricks_of(volume, (first, last))
        texels = scalar_texels(bricks, np.zeros((1, 3), np.int32), lit=False)[0]
        first, last = bricks.scalar_range
        for _ in range(NUM_SAMPLES):
            at = rng.integers(0, volume.shape)
            u = (Fraction(float(volume[tuple(at)])) - Fraction(first)) / (Fraction(last) - Fraction(first))
            held = min(max(u, Fraction(-MAX_NORMALIZED_SCALAR)), Fraction(MAX_NORMALIZED_SCALAR))
            worst = max(worst, abs(Fraction(float(texels[tuple(at + HALO)])) - held) / max(abs(held), 1))
    return float(worst)


def gradient_error(num_cases: int) -> float:
    """Return the worst error of a component, over the largest one of the volume, which sets the unit."""
    worst = 0.0
    for case, values in enumerate(random_ranges(num_cases)):
        rng = np.random.default_rng(case)
        volume = values.reshape((10, 10, 10) if values.size == 1000 else values.shape)
        bricks = bricks_of(volume, (float(values.min()), float(values.max())))
        texels = scalar_texels(bricks, np.zeros((1, 3), np.int32), lit=True)[0, PADDED_BRICK_SIZE**3 :]
        gradients = texels.reshape(*(PADDED_BRICK_SIZE,) * 3, 3)
        wants, gots = [], []
        for _ in range(NUM_SAMPLES):
            at = rng.integers(0, volume.shape)
            for axis, channel in zip((2, 1, 0), (0, 1, 2), strict=True):
                low, high = at.copy(), at.copy()
                low[axis], high[axis] = max(at[axis] - 1, 0), min(at[axis] + 1, volume.shape[axis] - 1)
                rise = Fraction(float(volume[tuple(high)])) - Fraction(float(volume[tuple(low)]))
                wants.append(rise / int(high[axis] - low[axis]))
                gots.append(Fraction(float(gradients[(*(at + HALO), channel)])))
        k = max(range(len(wants)), key=lambda n: abs(wants[n]))
        ratio = gots[k] / wants[k]
        worst = max(worst, *(float(abs(g - w * ratio) / abs(gots[k])) for g, w in zip(gots, wants, strict=True)))
    return worst


def noise_growth(rng: Random, _: int) -> float:
    """The largest value of the field at a face of the volume, over the largest mean."""
    num, worst = int(rng.integers(17, 100)), 0.0
    values = rng.choice([0.0, 0.0, 1.0], (num, 1, 1))
    values[0] = 1.0
    bricks = bricks_of(values, (0.0, 1.0))
    for level in range(1, len(bricks.levels)):
        last = (num - 1) >> (level + BRICK_LEVELS)
        texels = mean_texels(bricks, level, np.array([[0, 0, last]], np.int32))[0, :, 1, 1, 3].astype(np.float64)
        at = num / 2**level - BRICK_SIZE * last - 0.5 + HALO  # of the face, in texels
        k = int(at)
        field = (k + 1 - at) * texels[k] + (at - k) * texels[k + 1]
        starts = np.arange(0, num, 1 << level)
        means = np.add.reduceat(values[:, 0, 0], starts) / np.diff(starts, append=num)
        worst = max(worst, float(field / means.max()))
    return worst


SECTION = Section(
    "Bricks",
    (
        Extreme("scalars of all types across all of their range, also -1.8e308 to 1.8e308, and 0 to 1e-310",
            "differences in float64, of halves where the range is large; held to 2^20 ranges",
            "error of u, over 1 or |u|", 1.01 * U, scalar_error),
        Extreme("their gradients", "scalars times a power of two that brings the volume's range to 1",
            "error, share of the largest component", 4 * U, gradient_error),
        Extreme("noise, last cells cut to slivers", "lines are followed half a cell at most",
            "largest value at the face, over the largest mean", 1.5 * (1 + 1e-6), worst_of(noise_growth)),
    ),
)  # fmt: skip


@pytest.mark.parametrize("extreme", SECTION.extremes, ids=str)
def test_error_in_a_brick(extreme: Extreme) -> None:
    extreme.check()
