"""Solve opacities for what the picture shows: each layer of values gets a share of it.

Rays of a turntable pass the sampled volume. The *visibility* of a layer is the sum over all rays of transmittance times
the layer's part of the opacity (C. D. Correa, K.-L. Ma, "Visibility Histograms and Visibility-Driven Transfer
Functions", IEEE TVCG 17(2), 2011). Densities are scaled until visibilities are as asked for, as M. Ruiz et al. minimise
a divergence between visibility and target ("Automatic Transfer Functions Based on Informational Divergence", IEEE TVCG
17(12), 2011), and until the rays that meet anything are covered as asked for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from renderer.scene import TransferSpec
from renderer.suggest.features import VoxelSample
from renderer.transfer import make_transfer_function
from renderer.volume import Bools, Float32, Float64

# Parallel rays: views of a turn, rays along each side of a view, and the most samples of one; more where a volume is so
# thin that rays would miss it.
_NUM_VIEWS, _RAYS_PER_SIDE, _MAX_SAMPLES, _MAX_SAMPLES_OF_SLABS = 8, 22, 256, 1024
_ELEVATION = math.radians(20)

# What is thinner than half of a layer is not a part of anything.
_MIN_PART_WEIGHT = 0.5
# Values that differ by less are the same.
_EVEN = 1e-9

# Rays with a smaller opacity miss what is shown.
_MIN_RAY_OPACITY = 0.01
# Steps of the search for densities. More change opacities by less than 2 %.
_NUM_STEPS = 24
# Natural logarithms: of the largest factor by which a layer becomes thinner, 20,000, and denser, 8.
_MAX_LOG_FACTOR, _MAX_LOG_DENSER = 10.0, math.log(8)
# Optical depths of 1 % of the diagonal: the smallest, the one that the search begins with, and one from which on a
# surface looks crisp.
_MIN_DEPTH, _FIRST_DEPTH, CRISP_SURFACE_DEPTH = 0.01, 0.3, 0.8


@dataclass(frozen=True)
class Layer:
    """A material, or a range of values, with its part of the picture.

    name: what it is, in words. knots: (normalised value, weight), ascending; linear between, constant outside.
    share: of the picture, relative to those of the other layers.
    min_depth, max_depth: of 1 % of the diagonal at weight 1; surfaces look crisp from about 1 on.
    """

    name: str
    knots: tuple[tuple[float, float], ...]
    share: float = 1.0
    min_depth: float = 0.0
    max_depth: float = 6.0

    def weights(self, values: Float64) -> Float64:
        """Return the weights of normalised values, of any shape."""
        return np.asarray(np.interp(values, *np.transpose(self.knots)), np.float64)

    def covers(self, values: Float64) -> Bools:
        """Return which normalised values are parts of it: where it is thinner than half, there are edges."""
        return self.weights(values) >= _MIN_PART_WEIGHT

    def mean_weights(self, one: Float64, other: Float64) -> Float64:
        """Return the mean weights over values between two, normalised, of any shape: thin layers are not missed."""
        (begin, first), (end, last) = self.knots[0], self.knots[-1]
        # Beyond the outermost knots, weights are constant.
        at, weights = np.array([(begin - 2, first), *self.knots, (end + 2, last)]).T
        slopes = np.divide(np.diff(weights), np.diff(at), out=np.zeros(len(at) - 1), where=np.diff(at) > 0)
        integrals = np.append(0.0, np.cumsum((weights[1:] + weights[:-1]) / 2 * np.diff(at)))

        def integral(values: Float64) -> Float64:
            k = np.clip(np.searchsorted(at, values, side="right") - 1, 0, len(slopes) - 1)
            beyond = values - at[k]
            return np.asarray(integrals[k] + beyond * (weights[k] + slopes[k] * beyond / 2))

        change = other - one
        is_even = np.abs(change) < _EVEN
        means = np.divide(integral(other) - integral(one), change, out=np.zeros_like(change), where=~is_even)
        return np.where(is_even, self.weights((one + other) / 2), means)

    def ranges(self) -> list[tuple[float, float]]:
        """Return the ranges of normalised values that have weight; infinite where a range does not end."""
        knots = [(-math.inf, self.knots[0][1]), *self.knots, (math.inf, self.knots[-1][1])]
        found: list[tuple[float, float]] = []
        for (low, first), (high, last) in pairwise(knots):
            if first > 0 or last > 0:
                begin = found.pop()[0] if found and found[-1][1] == low and first > 0 else low
                found.append((begin, high))
        return found


class TurntableRays(NamedTuple):
    """Samples of a volume along rays, front to back.

    values: float32 [rays, samples], normalised; NaN outside of the volume, and without data. step: the distance of two
        samples, as a share of the diagonal. is_interpolated: as of VoxelSample.
    """

    values: Float32
    step: float
    is_interpolated: bool


class Visibility(NamedTuple):
    """A summary of what a picture shows.

    shares: of each layer, float64 [layers], with the sum 1. coverage: mean opacity of the rays that meet anything.
    """

    shares: Float64
    coverage: float


def cast_rays(sample: VoxelSample) -> TurntableRays:
    """Sample a volume along the rays of a turntable around z, at random places of a regular pattern."""
    return cast_through([sample])[0]


def cast_through(samples: Sequence[VoxelSample]) -> list[TurntableRays]:
    """Sample volumes, each in its place in the world, along the same rays, around the largest one's centre.

    The unit of length is the first one's diagonal.
    """
    random, unit = np.random.default_rng(0), samples[0].diagonal
    middle = max(samples, key=attrgetter("diagonal")).centre
    boxes = [_box(sample, middle, unit) for sample in samples]
    radius = max(float(np.linalg.norm(box.offset) + np.linalg.norm(box.half)) for box in boxes)
    step = max(min(float(box.spacing.min()) for box in boxes), 2 * radius / _MAX_SAMPLES)
    step = min(step, max(min(float(box.half.min()) for box in boxes), 2 * radius / _MAX_SAMPLES_OF_SLABS))
    count = math.ceil(2 * radius / step)
    found, cells = [], np.indices((_RAYS_PER_SIDE, _RAYS_PER_SIDE)).reshape(2, -1)
    for view in range(_NUM_VIEWS):
        axes = _view_axes(2 * math.pi * (view + 0.3) / _NUM_VIEWS)
        sides = [
            max(abs(box.offset @ axis) + box.half @ np.abs(axis @ box.directions) for box in boxes) for axis in axes
        ]
        across, along = (2 * cells + 2 * random.random(cells.shape)) / _RAYS_PER_SIDE - 1  # one place in each
        lengths = (np.arange(count) + random.random((len(across), 1))) * step - radius
        of_view = [_values_along(box, axes, (across * sides[0], along * sides[1]), lengths) for box in boxes]
        is_met = np.any([is_inside.any(axis=1) for _, is_inside in of_view], axis=0)
        found.append([values[is_met] for values, _ in of_view])
    return [
        TurntableRays(np.concatenate(values), step, sample.is_interpolated)
        for values, sample in zip(zip(*found, strict=True), samples, strict=True)
    ]


class _Box(NamedTuple):
    """A sampled volume in units of a common length. offset: of its centre, in the world. half: of its sides, x, y, z.

    values: float32 [z, y, x], NaN without data. spacing: of the samples along x, y, z. directions: as in VoxelSample.
    """

    values: Float32
    spacing: Float64
    half: Float64
    offset: Float64
    directions: Float64


def _box(sample: VoxelSample, middle: Float64, unit: float) -> _Box:
    values = np.where(sample.is_valid, sample.normalized, np.nan).astype(np.float32)
    spacing = np.array(sample.spacing[::-1]) / unit
    return _Box(values, spacing, spacing * values.shape[::-1] / 2, (sample.centre - middle) / unit, sample.directions)


def _values_along(
    box: _Box, axes: Sequence[Float64], places: tuple[Float64, Float64], lengths: Float64
) -> tuple[Float32, Bools]:
    """Return the values at samples of rays, NaN outside of the volume, and which of them are inside.

    axes: to the right, up and forward. places: of the rays along the first two. lengths: [rays, samples].
    """
    shape = np.array(box.values.shape[::-1])
    right, up, forward = (axis @ box.directions for axis in axes)
    starts = places[0][:, None] * right + places[1][:, None] * up - box.offset @ box.directions
    at = np.floor((starts[:, None] + lengths[..., None] * forward) / box.spacing + shape / 2).astype(np.int32)
    is_inside = ((at >= 0) & (at < shape)).all(axis=2)
    x, y, z = np.moveaxis(np.clip(at, 0, shape - 1), 2, 0)
    return np.where(is_inside, box.values[z, y, x], np.float32(np.nan)), np.asarray(is_inside)


def _view_axes(azimuth: float) -> tuple[Float64, Float64, Float64]:
    """Return the directions to the right, up and away from the camera, in the world."""
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    outward, rise = np.array([math.cos(azimuth), math.sin(azimuth), 0.0]), np.array([0.0, 0.0, 1.0])
    sine, cosine = math.sin(_ELEVATION), math.cos(_ELEVATION)
    return right, cosine * rise - sine * outward, -sine * rise - cosine * outward


def measure_visibility(rays: TurntableRays, layers: Sequence[Layer], depths: Float64) -> Visibility:
    """Return what a picture shows of layers with the given optical depths of 1 % of the diagonal."""
    return _measure(_weights(rays, layers), depths)


def solve_depths(rays: TurntableRays, layers: Sequence[Layer], coverage: float, *, by_area: bool = False) -> Float64:
    """Return the optical depth of 1 % of the diagonal of each layer at weight 1.

    coverage: the mean opacity of the rays that meet any of them. by_area: multiply shares by the part of the rays that
    meet a layer, so that a small one inside of others is not asked for more than it can have, and hides nothing. Layers
    that no ray meets become crisp.
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
    """Return factors on the densities of two layers, so that the first has this share of what is seen.

    The second becomes thinner, or denser within a bound; only where that is not enough, the first becomes thinner.
    weights: of `step_weights`, [2, rays, steps], on rays that meet both.
    """
    weights = _compact(weights)
    low, high = -_MAX_LOG_FACTOR, _MAX_LOG_FACTOR
    for _ in range(_NUM_STEPS):
        middle = (low + high) / 2
        first, second = np.exp(np.minimum([middle + _MAX_LOG_DENSER, -middle], [0.0, _MAX_LOG_DENSER]))
        low, high = (low, middle) if _measure(weights, np.array([first, second])).shares[0] > share else (middle, high)
    return float(first), float(second)


def _weights(rays: TurntableRays, layers: Sequence[Layer]) -> Float32:
    """Return the weights of the steps between samples, without those that have none."""
    return _compact(step_weights(rays, layers))


def step_weights(rays: TurntableRays, layers: Sequence[Layer]) -> Float32:
    """Return the weights of the steps between samples, times their lengths in 1 % of the diagonal.

    [layers, rays, steps].
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
    """Return the optical depths of the steps of rays, [rays, steps].

    sample: of the volume that the rays are of. unit: the length that theirs are given in.
    """
    transfer = make_transfer_function(look, min(sample.spacing))
    at, depths = map(sample.normalize, transfer.values.tolist()), (transfer.extinctions * unit / 100).tolist()
    return np.asarray(step_weights(rays, [Layer("", tuple(zip(at, depths, strict=True)))])[0])


def _compact(weights: Float32) -> Float32:
    """Leave out steps without any weight: those of a ray that remain move together."""
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
