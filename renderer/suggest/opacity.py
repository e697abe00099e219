"""Calibrate the opacities of a transfer function, so that its picture is neither fog nor a solid block.

A transfer function is a sum of layers. The shape of a layer says which values are in it. Its optical depth is found by
casting rays through the sampled volume along its three axes: on average they are covered as much as the layer asks for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from renderer.suggest.features import VoxelSample
from renderer.volume import Float64

# Rays with less than this part of the largest depth miss the layer.
_MIN_RAY_DEPTH = 1e-3
# The largest optical depth of a layer, for 1% of the diagonal.
_MAX_LAYER_DEPTH = 6.0


@dataclass(frozen=True)
class Layer:
    """A material, or a range of values, with its opacity.

    name: what it is, in words. knots: (normalised value, weight), ascending; linear between, constant outside.
    coverage: the mean opacity of the rays that meet it.
    min_depth: the smallest optical depth of 1% of the diagonal at weight 1; surfaces look crisp from about 1 on.
    """

    name: str
    knots: tuple[tuple[float, float], ...]
    coverage: float
    min_depth: float = 0.0

    def weights(self, values: Float64) -> Float64:
        """Return the weights of normalised values, of any shape."""
        at, weights = np.array(self.knots, np.float64).T
        return np.asarray(np.interp(values, at, weights), np.float64)


def calibrate_layer_depth(sample: VoxelSample, layer: Layer) -> float:
    """Return the optical depth of 1% of the diagonal at weight 1; 0 if no sample is in the layer."""
    amounts = layer.weights(sample.normalized)
    # In units of 1% of the diagonal.
    depths = [amounts.sum(axis=axis) * (sample.spacing[axis] / sample.diagonal * 100) for axis in range(3)]
    rays = np.concatenate([depth.ravel() for depth in depths])
    rays = rays[rays > _MIN_RAY_DEPTH * rays.max()]
    if rays.size == 0:
        return 0.0
    return min(max(_depth_scale(rays, layer.coverage), layer.min_depth), _MAX_LAYER_DEPTH)


def covered_ray_fraction(sample: VoxelSample, layer: Layer) -> float:
    """Return the part of the rays that meet the layer, averaged over the three axes."""
    amounts = layer.weights(sample.normalized)
    return float(np.mean([np.mean(amounts.max(axis=axis) > 0) for axis in range(3)]))


def _depth_scale(rays: Float64, coverage: float) -> float:
    """Return the factor on depths that makes the mean opacity `coverage`, by bisection of its logarithm."""
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
    """Return about 1% of the diagonal: 1, 2 or 5 times a power of ten."""
    exponent = math.floor(math.log10(diagonal / 100))
    digits = diagonal / 100 / 10.0**exponent
    return float(f"{1 if digits < 1.5 else 2 if digits < 3.5 else 5 if digits < 7.5 else 10}e{exponent}")


def opacity_from_depth(depth: float, unit: float, diagonal: float) -> float:
    """Return the opacity of a length `unit` from the optical depth of 1% of the diagonal, with no more digits than
    can be seen."""
    exact = depth * (unit / (diagonal / 100))
    opacity, clear = -math.expm1(-exact), math.exp(-exact)
    return float(f"{opacity:.3g}") if opacity <= 0.9 else round(1 - float(f"{clear:.2g}"), 6)


def format_number(value: float) -> str:
    """Return a number as text, whole numbers without a point."""
    return str(int(value)) if value == int(value) and abs(value) < 2**53 else f"{value:g}"
