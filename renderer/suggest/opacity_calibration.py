"""Solve the opacities of layers of values, so that each layer has its share of the picture.

Rays of a turntable pass through the sampled volume. The *visibility* of a layer is the sum over all rays of
transmittance times the layer's part of the opacity (C. D. Correa, K.-L. Ma, "Visibility Histograms and
Visibility-Driven Transfer Functions", IEEE TVCG 17(2), 2011). Densities are scaled until visibilities match the layers'
shares, as M. Ruiz et al. minimise a divergence between visibility and target ("Automatic Transfer Functions Based on
Informational Divergence", IEEE TVCG 17(12), 2011), and until the rays that meet anything have the mean opacity asked
for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.scene import TransferSpec
from renderer.statistics import VoxelSample
from renderer.suggest.layer import Layer
from renderer.suggest.turntable_rays import TurntableRays
from renderer.transfer import make_transfer_function
from renderer.volume import Float32, Float64

# A ray meets a layer if the ray's opacity is more than this; other rays do not count for the mean opacity of a picture.
_MIN_RAY_OPACITY = 0.01
# The number of steps of the search for densities. With more steps, opacities change by less than 2 %.
_NUM_STEPS = 24
# To give the first of two layers its share of the picture, the second layer is made thinner by a factor of at most
# 20,000. This is the natural logarithm of the factor.
_MAX_LOG_FACTOR = 10.0
# To give the first of two layers its share of the picture, the second layer is made denser by a factor of at most 8.
# This is the natural logarithm of the factor.
_MAX_LOG_DENSER = math.log(8)
# The smallest optical depth that is solved for a layer, for 1 % of the volume's diagonal.
_MIN_DEPTH = 0.01
# The optical depth of a layer with which the search for densities begins, for 1 % of the volume's diagonal.
_FIRST_DEPTH = 0.3
# The optical depth from which on a surface looks crisp, for 1 % of the volume's diagonal.
CRISP_SURFACE_DEPTH = 0.8


class Visibility(NamedTuple):
    """The shares of layers in a picture, and how much of it they cover.

    shares: the share of each layer, float64 [layers], with the sum 1.
    coverage: the mean opacity of the rays that meet anything.
    """

    shares: Float64
    coverage: float


def measure_visibility(rays: TurntableRays, layers: Sequence[Layer], depths: Float64) -> Visibility:
    """Return each layer's share of the picture, and how much of the picture the layers cover.

    depths: the optical depth of each layer at weight 1, for 1 % of the volume's diagonal, float64 [layers].
    """
    return _measure(_weights(rays, layers), depths)


def solve_depths(rays: TurntableRays, layers: Sequence[Layer], coverage: float, *, by_area: bool = False) -> Float64:
    """Return the optical depth of each layer at weight 1, for 1 % of the volume's diagonal.

    coverage: the mean opacity of the rays that meet any layer. by_area: multiply each layer's share by the part of the
    rays that meet the layer, so that a small layer inside others is not given a share that it cannot reach, and does
    not hide them. A layer that no ray meets gets the depth of a crisp surface.
    """
    weights = _weights(rays, layers)
    areas = weights.any(axis=2).mean(axis=1)
    is_met = areas > 0
    low, high = np.array([(max(layer.min_depth, _MIN_DEPTH), layer.max_depth) for layer in layers]).T
    depths = np.clip(np.where(is_met, _FIRST_DEPTH, CRISP_SURFACE_DEPTH), low, high)
    targets = np.array([layer.share for layer in layers]) * (areas if by_area else is_met)
    targets /= max(targets.sum(), 1e-12)
    for _ in range(_NUM_STEPS):
        found = _measure(weights, depths)
        factors = np.clip(np.sqrt(targets / np.maximum(found.shares, 1e-4)), 0.5, 2.0)
        factors *= min(max(coverage / max(found.coverage, 1e-3), 0.6), 1.6)
        depths = np.where(is_met, np.clip(depths * factors, low, high), depths)
    return depths


def balance(weights: Float32, share: float) -> tuple[float, float]:
    """Return factors on the densities of two layers that give the first layer the share `share` of the picture.

    The second layer becomes thinner, or denser up to a bound; only if this is not enough, the first layer becomes
    thinner. weights: the weights from `step_weights`, [2, rays, steps], on rays that meet both layers.
    """
    weights = _compact(weights)
    low, high = -_MAX_LOG_FACTOR, _MAX_LOG_FACTOR
    for _ in range(_NUM_STEPS):
        middle = (low + high) / 2
        first, second = np.exp(np.minimum([middle + _MAX_LOG_DENSER, -middle], [0.0, _MAX_LOG_DENSER]))
        low, high = (low, middle) if _measure(weights, np.array([first, second])).shares[0] > share else (middle, high)
    return float(first), float(second)


def _weights(rays: TurntableRays, layers: Sequence[Layer]) -> Float32:
    """Return the layers' weights in the steps of rays, [layers, rays, steps], without steps in which all weights are 0.

    The weights are multiplied by the lengths of the steps, as in `step_weights`.
    """
    return _compact(step_weights(rays, layers))


def step_weights(rays: TurntableRays, layers: Sequence[Layer]) -> Float32:
    """Return the layers' weights in the steps between two samples of a ray, times the steps' lengths.

    The unit of length is 1 % of the volume's diagonal. Returns float32 [layers, rays, steps].
    """
    before, after = rays.values[:, :-1], rays.values[:, 1:]
    is_inside = ~(np.isnan(before) | np.isnan(after))
    one, other = before[is_inside].astype(np.float64), after[is_inside].astype(np.float64)
    other = other if rays.is_interpolated else one
    weights = np.zeros((len(layers), *before.shape), np.float32)
    for layer, own in zip(layers, weights, strict=True):
        own[is_inside] = 100 * rays.step * layer.mean_weights(one, other)
    return weights


def depths_along(look: TransferSpec, sample: VoxelSample, rays: TurntableRays, unit: float) -> Float32:
    """Return the optical depth of each step of rays through a volume, float32 [rays, steps].

    look: the transfer function that gives the volume its optical depth. sample: a sample of the volume. unit: the world
    length of which the rays' steps are shares.
    """
    transfer = make_transfer_function(look, min(sample.spacing))
    at, depths = map(sample.normalize, transfer.values.tolist()), (transfer.extinctions * unit / 100).tolist()
    return np.asarray(step_weights(rays, [Layer("", tuple(zip(at, depths, strict=True)))])[0])


def _compact(weights: Float32) -> Float32:
    """Return the weights without the steps in which all weights are 0; the remaining steps of each ray close up.

    weights: [layers, rays, steps]; rays that have fewer steps left end with weights of 0.
    """
    is_seen = weights.any(axis=0)
    order = np.argsort(~is_seen, axis=1, kind="stable")[:, : max(1, int(is_seen.sum(axis=1).max(initial=0)))]
    return np.take_along_axis(weights, order[None], axis=2)


def _measure(weights: Float32, depths: Float64) -> Visibility:
    own = weights * depths.astype(np.float32)[:, None, None]
    taken = own.sum(axis=0)
    behind = np.cumsum(taken, axis=1)
    visible = np.exp(taken - behind) * -np.expm1(-taken)
    part = np.divide(visible, taken, out=np.zeros_like(taken), where=taken > 0)
    shares = np.einsum("krs,rs->k", own, part, dtype=np.float64)
    opacities = -np.expm1(-behind[:, -1])
    is_met = opacities > _MIN_RAY_OPACITY
    coverage = float(opacities[is_met].mean()) if is_met.any() else 0.0
    return Visibility(shares / max(float(shares.sum()), 1e-12), coverage)
