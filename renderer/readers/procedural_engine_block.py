"""Make the engine block: metal parts of an engine, blurred as a scanner does, with noise.

It uses only correctly rounded operations and integer random numbers.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from renderer.readers import procedural_grid
from renderer.scene import ProceduralSource
from renderer.volume import Array

# The value of air in the engine block.
_AIR = 12
# The value of coolant, and of oil, in the engine block.
_COOLANT = 40
# The value of aluminium in the engine block.
_ALUMINIUM = 96
# The value of iron in the engine block.
_IRON = 158
# The value of steel in the engine block.
_STEEL = 226
# The standard deviation of the noise of the engine block, whose values are from 0 to 255.
_NOISE = 2.5
# The width over which the edges of the engine block are blurred, as a scanner does, in voxels.
_BLUR_VOXELS = 1.6


@dataclass(frozen=True)
class _Part:
    """A box or a round bar of one material, in model units: the whole phantom lies within [-1, 1]^2 x [-1/2, 1/2].

    low, high: corners of the bounding box. axis: the axis of a bar, which is the cylinder inscribed in the bounding
    box; None for a box. Parts are painted in order, and a part of air cuts a hole into earlier parts.
    """

    material: int
    low: tuple[float, float, float]
    high: tuple[float, float, float]
    axis: int | None = None


def _box(material: int, centre: tuple[float, float, float], half: tuple[float, float, float]) -> _Part:
    (x, y, z), (a, b, c) = centre, half
    return _Part(material, (x - a, y - b, z - c), (x + a, y + b, z + c))


def _bar(material: int, axis: int, centre: tuple[float, float], radius: float, ends: tuple[float, float]) -> _Part:
    """Return a round bar along an axis, 0 to 2 for x to z.

    centre: the coordinates of its centre line along the two other axes, in ascending order of the axes. ends: the
    coordinates of its ends along its own axis.
    """
    low, high = [c - radius for c in centre], [c + radius for c in centre]
    low.insert(axis, ends[0])
    high.insert(axis, ends[1])
    return _Part(material, (low[0], low[1], low[2]), (high[0], high[1], high[2]), axis)


def _engine_parts() -> Iterator[_Part]:
    """Yield the parts of an engine: a block with fins, two cylinders, and moving parts.

    A pipe, a filter and a pulley make the sides of the engine distinguishable.
    """
    yield from _casing()
    for x, piston_z in ((-0.4, 0.1), (0.4, -0.1)):
        yield from _cylinder(x, piston_z)
    yield from _crankshaft()
    for x in (-0.8, 0.0, 0.8):
        for y in (-0.41, 0.41):
            yield _bar(_STEEL, 2, (x, y), 0.03, (-0.1, 0.42))
            yield _bar(_STEEL, 2, (x, y), 0.055, (0.4, 0.45))


def _casing() -> Iterator[_Part]:
    yield _box(_ALUMINIUM, (0, 0, 0.05), (0.86, 0.47, 0.32))
    for k in range(6):  # thin fins
        yield _box(_ALUMINIUM, (0, 0, -0.17 + 0.085 * k), (0.8, 0.64, 0.014))
    yield _box(_ALUMINIUM, (0, 0, 0.385), (0.88, 0.49, 0.025))  # the flange of the head gasket
    yield _bar(_ALUMINIUM, 0, (0, -0.25), 0.22, (-0.84, 0.84))  # crankcase
    yield _bar(_AIR, 0, (0, -0.25), 0.185, (-0.8, 0.8))
    for x in (-0.4, 0.4):  # intake and exhaust pipes; the exhaust pipes are longer
        yield _bar(_ALUMINIUM, 1, (x, 0.27), 0.095, (-0.72, 0))
        yield _bar(_AIR, 1, (x, 0.27), 0.065, (-0.74, 0))
        yield _bar(_ALUMINIUM, 1, (x, 0.27), 0.095, (0, 0.88))
        yield _bar(_AIR, 1, (x, 0.27), 0.065, (0, 0.9))
    yield _bar(_ALUMINIUM, 0, (0.8, 0.27), 0.1, (-0.6, 0.6))  # manifold across the exhaust pipes
    yield _bar(_AIR, 0, (0.8, 0.27), 0.07, (-0.56, 0.64))
    yield _bar(_ALUMINIUM, 1, (0.62, -0.22), 0.13, (-0.78, -0.2))  # oil filter
    yield _bar(_COOLANT, 1, (0.62, -0.22), 0.1, (-0.74, -0.2))
    yield _bar(_IRON, 1, (0.62, -0.22), 0.035, (-0.74, -0.2))


def _cylinder(x: float, piston_z: float) -> Iterator[_Part]:
    """Yield the parts of one cylinder.

    They are water jacket, liner, piston with rings and pin, connecting rod, two valves and the spark plug.
    """
    yield _bar(_COOLANT, 2, (x, 0), 0.385, (-0.12, 0.22))
    yield _bar(_ALUMINIUM, 2, (x, 0), 0.335, (-0.12, 0.22))
    yield _bar(_IRON, 2, (x, 0), 0.31, (-0.2, 0.26))
    yield _bar(_AIR, 2, (x, 0), 0.27, (-0.22, 0.3))
    yield _bar(_ALUMINIUM, 2, (x, 0), 0.26, (piston_z - 0.07, piston_z + 0.06))
    yield _bar(_AIR, 2, (x, 0), 0.2, (piston_z - 0.08, piston_z + 0.03))
    for z in (0.035, 0.0):
        yield _bar(_STEEL, 2, (x, 0), 0.268, (piston_z + z - 0.009, piston_z + z + 0.009))
        yield _bar(_ALUMINIUM, 2, (x, 0), 0.235, (piston_z + z - 0.012, piston_z + z + 0.012))
    yield _bar(_STEEL, 1, (x, piston_z - 0.03), 0.045, (-0.22, 0.22))
    crank_z = -0.25 + (0.08 if piston_z > 0 else -0.08)
    yield _box(_STEEL, (x, 0, (piston_z - 0.03 + crank_z) / 2), (0.028, 0.05, (piston_z - 0.03 - crank_z) / 2))
    for y in (-0.12, 0.12):
        yield _bar(_STEEL, 2, (x, y), 0.022, (0.21, 0.47))
        yield _bar(_STEEL, 2, (x, y), 0.085, (0.195, 0.22))
        yield _bar(_IRON, 2, (x, y), 0.05, (0.4, 0.45))
    yield _bar(_STEEL, 2, (x + 0.12, 0), 0.03, (0.2, 0.44))


def _crankshaft() -> Iterator[_Part]:
    """Yield the parts of the crankshaft.

    They are journals, two offset throws with their webs and counterweights, and a pulley at one end.
    """
    for low, high in ((-0.97, -0.52), (-0.28, 0.28), (0.52, 0.9)):
        yield _bar(_STEEL, 0, (0, -0.25), 0.05, (low, high))
    for x, lift in ((-0.4, 0.08), (0.4, -0.08)):
        yield _bar(_STEEL, 0, (0, -0.25 + lift), 0.045, (x - 0.12, x + 0.12))
        for web in (-0.11, 0.11):
            yield _bar(_STEEL, 0, (0, -0.25 - 0.3 * lift), 0.13, (x + web - 0.025, x + web + 0.025))
    yield _bar(_IRON, 0, (0, -0.25), 0.2, (-0.97, -0.91))
    yield _bar(_AIR, 0, (0, -0.25), 0.15, (-0.98, -0.95))


def engine_block_values(source: ProceduralSource) -> Array:
    """Return the engine block with blurred edges and noise, centred and as large as fits.

    Its bars are round in world units. The noise depends on the seed of `source`.
    """
    shape, spacing = np.array(source.shape), np.array(source.spacing)
    unit = float(np.min(shape * spacing / [2.0, 2.0, 1.0])) * 0.98  # the length of a model unit in world units
    x, y, z = (
        ((np.arange(n) - (n - 1) / 2) * step / unit).astype(np.float32) for n, step in zip(shape, spacing, strict=True)
    )
    blur = np.float32(_BLUR_VOXELS * float(spacing.min()) / unit)
    values = np.empty(source.shape[::-1], np.uint8)
    thickness = max(1, procedural_grid.SLAB_VOXELS // (len(x) * len(y)))
    parts = tuple(_engine_parts())
    num_words = 0  # the number of words of random bits that earlier slabs have used
    for begin in range(0, len(z), thickness):
        slab = values[begin : begin + thickness]
        for rows in procedural_grid.row_blocks(source):
            block = slab[:, rows]
            field = np.full(block.shape, _AIR, np.float32)
            for part in parts:
                _paint(field, part, (x, y[rows], z[begin : begin + thickness]), blur)
            num_before = rows.start * len(x)  # voxels before the block; only a slab of one plane has several blocks
            first_bytes = [8 * num_words + k * slab.size + num_before for k in range(3)]
            field += _noise(source.seed, first_bytes, block.size).reshape(block.shape)
            block[...] = np.clip(np.floor(field + np.float32(0.5)), 0, 255)
        num_words += -(-3 * slab.size // 8)
    return values


def _noise(seed: int, first_bytes: Sequence[int], num: int) -> Array:
    """Return noise of standard deviation _NOISE, float32 [num]: the sum of three uniform bytes is close to normal.

    first_bytes: the places of the first, second and third bytes in the seed's random bits.
    """
    deviation = math.sqrt(3 * (256**2 - 1) / 12)
    centred = np.full(num, -3 * 127.5, np.float32)
    for first in first_bytes:
        centred += procedural_grid.random_bytes(seed, first, num)
    centred *= np.float32(_NOISE / deviation)
    return centred


def _paint(field: Array, part: _Part, axes: tuple[Array, Array, Array], blur: np.float32) -> None:
    """Draw a part into a slab, float32 [z, y, x]; at its surface, coverage falls from 1 to 0 over a width of `blur`."""
    window, near = [], []
    for coordinates, low, high in zip(axes, part.low, part.high, strict=True):
        begin, end = np.searchsorted(coordinates, [low - blur, high + blur])
        window.append(slice(int(begin), int(end)))
        near.append(coordinates[begin:end] - np.float32((low + high) / 2))
    x, y, z = near[0], near[1][:, np.newaxis], near[2][:, np.newaxis, np.newaxis]
    half = [np.float32((high - low) / 2) for low, high in zip(part.low, part.high, strict=True)]
    # Signed distances to the surface, negative inside. They are exact at faces, and too small outside of edges.
    faces = [abs(c) - h for c, h in zip((x, y, z), half, strict=True)]
    if part.axis is not None:
        end_face = faces.pop(part.axis)
        across = [c for i, c in enumerate((x, y, z)) if i != part.axis]
        radius = next(h for i, h in enumerate(half) if i != part.axis)
        faces = [np.sqrt(across[0] ** 2 + across[1] ** 2) - radius, end_face]
    coverage = np.clip(np.float32(0.5) - functools.reduce(np.maximum, faces) / blur, 0, 1)
    target = field[window[2], window[1], window[0]]
    target += (np.float32(part.material) - target) * coverage
