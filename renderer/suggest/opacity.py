"""How dense a suggested transfer function must be, so that its picture is neither a fog nor a block.

A transfer function is a sum of layers. The shape of a layer says which values are in it; its amount is found like the
exposure of a photograph: rays through the sampled volume along its three axes are covered so and so much in the mean.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from renderer.suggest.features import VoxelSample
from renderer.volume import Float64

# Rays with less than this part of the largest depth do not meet the layer.
_MIN_RAY_DEPTH = 1e-3
# The densest that a layer may be, as the opacity of a length of 1% of the diagonal.
_MAX_LAYER_DEPTH = 6.0


@dataclass(frozen=True)
class Layer:
    """One material, or one range of values.

    name: what it is, in words. knots: (share of the range, weight), ascending; linear between, constant outside.
    coverage: the mean opacity of the rays that meet it.
    solid: the least optical depth, where its weight is 1, of 1% of the diagonal: surfaces are crisp from about 1 on.
    """

    name: str
    knots: tuple[tuple[float, float], ...]
    coverage: float
    min_depth: float = 0.0


def calibrate_layer_depth(sample: VoxelSample, layer: Layer) -> float:
    """The optical depth of 1% of the diagonal where the layer's weight is 1; 0 for a layer that is nowhere."""
    at, weights = np.array(layer.knots, np.float64).T
    amounts = np.interp(sample.normalized, at, weights)
    # In units of 1% of the diagonal.
    depths = [amounts.sum(axis=axis) * (sample.spacing[axis] / sample.diagonal * 100) for axis in range(3)]
    rays = np.concatenate([depth.ravel() for depth in depths])
    rays = rays[rays > _MIN_RAY_DEPTH * rays.max()]
    if rays.size == 0:
        return 0.0
    return min(max(_depth_scale(rays, layer.coverage), layer.min_depth), _MAX_LAYER_DEPTH)


def covered_ray_fraction(sample: VoxelSample, layer: Layer) -> float:
    """The part of the rays that meet the layer, in the mean of the three axes."""
    at, weights = np.array(layer.knots, np.float64).T
    amounts = np.interp(sample.normalized, at, weights)
    return float(np.mean([np.mean(amounts.max(axis=axis) > 0) for axis in range(3)]))


def _depth_scale(rays: Float64, coverage: float) -> float:
    """The factor on depths with which the mean opacity is `coverage`, by halving its logarithm's range."""
    middle = -np.log(rays.mean())
    low, high = middle - 10.0, middle + 10.0
    for _ in range(30):
        tried = (low + high) / 2
        if float(np.mean(-np.expm1(-rays * np.exp(tried)))) < coverage:
            low = tried
        else:
            high = tried
    return float(np.exp((low + high) / 2))


def opacity_unit_length(diagonal: float) -> float:
    """About 1% of the diagonal, as one digit: 1, 2 or 5 times a power of ten."""
    exponent = math.floor(math.log10(diagonal / 100))
    digits = diagonal / 100 / 10.0**exponent
    return float(f"{1 if digits < 1.5 else 2 if digits < 3.5 else 5 if digits < 7.5 else 10}e{exponent}")


def opacity_from_depth(depth: float, unit: float, diagonal: float) -> float:
    """Of a length `unit`, from the optical depth of 1% of the diagonal, to the digits that can be seen."""
    exact = depth * (unit / (diagonal / 100))
    opacity, clear = -math.expm1(-exact), math.exp(-exact)
    return float(f"{opacity:.3g}") if opacity <= 0.9 else round(1 - float(f"{clear:.2g}"), 6)


def format_number(value: float) -> str:
    """A number in words: whole ones without a point."""
    return str(int(value)) if value == int(value) and abs(value) < 2**53 else f"{value:g}"
