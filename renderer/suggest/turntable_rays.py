"""Sample volumes along the rays of a turntable: parallel rays, in several views around the volume."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import attrgetter
from typing import NamedTuple

import numpy as np

from renderer.statistics import VoxelSample
from renderer.volume import Bools, Float32, Float64

# The number of views in a full turn around the volume.
_NUM_VIEWS = 8
# The number of rays along each side of a view, which is a square grid of rays.
_RAYS_PER_SIDE = 22
# The largest number of samples along a ray.
_MAX_SAMPLES = 256
# The largest number of samples along a ray if a volume is so thin that fewer samples would miss it.
_MAX_SAMPLES_OF_SLABS = 1024
# The elevation of the eye above the horizon, in radians.
_ELEVATION = math.radians(20)


class TurntableRays(NamedTuple):
    """Samples of a volume along rays, front to back.

    values: float32 [rays, samples], normalised; NaN outside of the volume, and without data.
    step: the distance of two samples, as a share of the diagonal.
    is_interpolated: whether values are interpolated between two samples; labels are not.
    """

    values: Float32
    step: float
    is_interpolated: bool


def cast_rays(sample: VoxelSample) -> TurntableRays:
    """Sample a volume along the rays of a turntable around z.

    Each view has a grid of cells, with a ray at a random position in each cell.
    """
    return cast_through([sample])[0]


def cast_through(samples: Sequence[VoxelSample]) -> list[TurntableRays]:
    """Sample volumes at their positions in the world along the same rays, around the centre of the largest volume.

    The unit of length is the diagonal of the first volume.
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
        across, along = (2 * cells + 2 * random.random(cells.shape)) / _RAYS_PER_SIDE - 1  # one ray in each cell
        lengths = (np.arange(count) + random.random((len(across), 1))) * step - radius
        of_view = [_values_along(box, axes, (across * sides[0], along * sides[1]), lengths) for box in boxes]
        is_met = np.any([is_inside.any(axis=1) for _, is_inside in of_view], axis=0)
        found.append([values[is_met] for values, _ in of_view])
    return [
        TurntableRays(np.concatenate(values), step, sample.is_interpolated)
        for values, sample in zip(zip(*found, strict=True), samples, strict=True)
    ]


class _Box(NamedTuple):
    """A sampled volume, with lengths in a unit that several volumes share.

    values: float32 [z, y, x], NaN without data.
    spacing: the distances of samples along x, y, z.
    half: half of the sides along x, y, z.
    offset: the position of the volume's centre in the world, from the centre of the largest of the volumes.
    directions: float64 [3, 3], whose columns are the directions of the axes x, y, z in the world.
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
    """Return the values at the samples of rays, NaN outside the volume, and which samples are inside.

    axes: the directions to the right, up and forward. places: the positions of the rays along the first two axes.
    lengths: the positions of the samples along the third axis, [rays, samples].
    """
    shape = np.array(box.values.shape[::-1])
    right, up, forward = (axis @ box.directions for axis in axes)
    starts = places[0][:, None] * right + places[1][:, None] * up - box.offset @ box.directions
    at = np.floor((starts[:, None] + lengths[..., None] * forward) / box.spacing + shape / 2).astype(np.int32)
    is_inside = ((at >= 0) & (at < shape)).all(axis=2)
    x, y, z = np.moveaxis(np.clip(at, 0, shape - 1), 2, 0)
    return np.where(is_inside, box.values[z, y, x], np.float32(np.nan)), np.asarray(is_inside)


def _view_axes(azimuth: float) -> tuple[Float64, Float64, Float64]:
    """Return the directions to the right, up, and away from the camera, in the world. azimuth: in radians."""
    right = np.array([-math.sin(azimuth), math.cos(azimuth), 0.0])
    outward, rise = np.array([math.cos(azimuth), math.sin(azimuth), 0.0]), np.array([0.0, 0.0, 1.0])
    sine, cosine = math.sin(_ELEVATION), math.cos(_ELEVATION)
    return right, cosine * rise - sine * outward, -sine * rise - cosine * outward
