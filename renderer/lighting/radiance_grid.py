"""Solve for the light in matter that scatters: the mean radiance at each place of a grid over all layers.

Scattering is the same in all directions. A place of extinction t and albedo a scatters a t phi, with phi the mean over
all directions of the radiance that arrives. It is found by rounds: light is carried through all cells along 24
directions, cells scatter its mean, and so on, until a round changes little. The last rounds are mixed so that the
change is least (Anderson 1965, "Iterative Procedures for Nonlinear Integral Equations"). The light on a grid of cells
twice as wide is the start, because rounds are slow to change light over long distances.

The directions are those of one, turned by the 24 rotations of a cube. Its coordinates are the three places of
Chebyshev's quadrature with equal weights between 0 and 1, so that surfaces across an axis of the grid get the right
irradiance from the half of all directions that they face. All directions have paths of one length through a cell, so
that the share of light that passes a cell is found once for all rounds.

Cells at surfaces have optical depths far above 1. Thick matter is seen at depths up to about 1, but the middle of a
thick cell is deeper, and dark. So a cell has the light of its matter weighted by how well it is seen from its lit side,
exp(-x) at the depth x. On a path of p widths of a cell, light arrives there by exp(-p x), and the weighted mean over a
cell of the depth t is (1 - exp(-(1 + p) t)) / ((1 + p) (1 - exp(-t))): exp(-p t / 2) in clear cells, and 1 / (1 + p) in
opaque ones, as a half-space shows light that scatters once. Light that passes a cell meets t, so that a wall of one
cell is as opaque as it should be. The key light passes between the middles of cells by the mean of their
transmittances, so that a surface that it grazes is not dark; of a wall of one cell, at 45 degrees, it lets 0.12
through, and none of a wall of two cells.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from renderer.errors import InputError
from renderer.kernels import ThreadPool, kernels
from renderer.lighting.environment import LightSources, environment_radiance
from renderer.lighting.matter_grid import ROW_CELLS, Matter, MatterGrid, average_layers, coarser, place_grid
from renderer.scene import LightSpec
from renderer.system import free_bytes
from renderer.volume import Float32, Float64

# The width of a cell, in the finest spacing of all volumes, where the grid has few enough cells. Pictures of a head of
# 64 x 64 x 93 voxels are within 40.2 dB of Monte Carlo with cells of one voxel, 34.8 dB with cells of two, and 30.6 dB
# with cells of four; at the coarse tolerance of 0.6, within 37.4, 33.8 and 30.2 dB. So the tolerance does not choose
# the cell. Films whose tolerances are found are then the same as films that name these tolerances. With cells of half a
# voxel, ripples in 64 x 64 x 64 voxels have 40.4 dB in place of 34.3, but each frame of a film whose light moves takes
# 2.8 s of processor time in place of 0.5 s.
CELL_VOXELS = 1.0
# The largest radiance of a source of light.
MAX_RADIANCE = 1e30
# The largest change of the last round, as a share of the brightest source.
TOLERANCE = 0.002
# The largest number of rounds on a grid.
MAX_ROUNDS = 64
# The largest number of float32 numbers that a solve keeps for a cell; a test measures it.
_NUMBERS_PER_CELL = 80
# The number of bytes of a solve on the smallest grid.
_FEW_BYTES = 1 << 20
# The number of rounds that are mixed.
_MIXED_ROUNDS = 4
# The number of directions to the key light.
_NUM_KEY_DIRECTIONS = 16
# The number of cells along the longest axis up to which no coarser grid gives the start.
_COARSEST = 12
# The coordinates of one of the directions: the places of Chebyshev's quadrature. Their squares have the sum 1.
_COORDINATES = ((2 + np.sqrt(2)) / 4, 0.5, (2 - np.sqrt(2)) / 4)
# The turn between neighbouring points of a spiral, in radians. With this angle, points are spread evenly.
_GOLDEN_ANGLE = np.pi * (1 + 5**0.5)


class RadianceGrid(NamedTuple):
    """The light at the middles of cells, in a grid with the axes of the world. It is linear between the middles."""

    # [3]: the lowest corner (x, y, z) of the grid in the world. The middle of cell i is i + 1/2 widths from it.
    origin: Float64
    # The width of a cell, in the world.
    cell: float
    # [z, y, x, rgb]: the mean radiance over all directions, with the key light. Matter shows its albedo times it.
    mean_radiance: Float32
    # [z, y, x]: the share of the key light that arrives without being scattered.
    key: Float32
    # [z, y, x, 3, rgb]: the mean over all directions of the direction (x, y, z) that radiance comes from, times the
    # radiance, without the key light that arrives straight; None if it was not asked for. With phi the mean radiance
    # without that light, a surface of the normal n has the irradiance pi (phi + 2 n . flux).
    flux: Float32 | None
    # The largest change of the last round, as a share of the brightest source.
    residual: float
    # The number of rounds on the finest grid.
    num_rounds: int
    # The matter that the light was found in.
    matter: MatterGrid


def compute_radiance_grid(
    layers: Sequence[Matter],
    sources: LightSources,
    *,
    cell_voxels: float = CELL_VOXELS,
    max_cells: int = LightSpec.cells,
    with_flux: bool = False,
    num_threads: int = 1,
) -> RadianceGrid:
    """Return the light in layers of matter. The result does not depend on the number of threads.

    cell_voxels, max_cells: as in `place_grid`. with_flux: whether to return the flux.

    Raises InputError if a source of light is not from 0 to MAX_RADIANCE, or if a volume's file was changed.
    """
    brightest = _brightest(sources)
    scaled = sources._replace(
        environment=sources.environment / brightest, key_irradiance=sources.key_irradiance / brightest
    )
    origin, cell, shape = place_grid(layers, cell_voxels, max_cells)
    _require_memory(solve_bytes(shape))
    with ThreadPool(num_threads) as threads:
        matter = average_layers(layers, origin, cell, shape, threads)
        solve = _Solve(matter, scaled, threads)
        radiance, residual, num_rounds = solve.run(_start(matter, scaled, threads))
        flux = solve.flux(radiance) if with_flux else None
    x = matter.shape_xyz[0]
    radiance += solve.key_radiance.astype(np.float32)[:, None, None, None] * solve.key

    def restored(light: Float32) -> Float32:
        return np.ascontiguousarray(np.moveaxis(light[..., :x], 0, -1) * np.float32(brightest))

    fluxes = None if flux is None else np.stack([restored(part) for part in flux], axis=-2)
    key = np.ascontiguousarray(solve.key[..., :x])
    return RadianceGrid(matter.origin, matter.cell, restored(radiance), key, fluxes, residual, num_rounds, matter)


def solve_bytes(shape_xyz: tuple[int, int, int]) -> int:
    """Return the largest number of bytes that a solve takes, on a grid of this many cells along x, y, z."""
    x, y, z = shape_xyz
    rows = max(-(-x // ROW_CELLS) * ROW_CELLS * y * z, x * y * -(-z // ROW_CELLS) * ROW_CELLS)
    return _NUMBERS_PER_CELL * 4 * rows + _FEW_BYTES


def _require_memory(num_bytes: int) -> None:
    if num_bytes > free_bytes():
        raise InputError(
            "The light of this scene does not fit into memory.",
            got=f"{num_bytes / 2**20:.0f} MiB",
            expected=f"at most the {free_bytes() / 2**20:.0f} MiB that are free",
        )


def _brightest(sources: LightSources) -> float:
    """Return the largest radiance of the environment, or mean radiance of the key light; 1 in the dark."""
    environment = float(np.abs(sources.environment).sum(axis=0).max())
    key = float(np.max(sources.key_irradiance)) / (4 * np.pi)
    if not (environment <= MAX_RADIANCE and key <= MAX_RADIANCE and np.min(sources.key_irradiance) >= 0):
        raise InputError(
            "A source of light has a strength that is not a number, or is too large.",
            got=f"an environment of {environment:g} and a key light of {key:g}",
            expected=f"strengths from 0 to {MAX_RADIANCE:g}",
        )
    return max(environment, key) or 1.0


def _start(matter: MatterGrid, sources: LightSources, threads: ThreadPool) -> Float32:
    """Return the mean radiance that rounds begin with, float32 [3, z, y, x], padded: the light on a coarser grid.

    On the coarsest grid it is the mean of the environment, which is the light in matter that absorbs nothing.
    """
    x, y, z = matter.shape_xyz
    start = np.zeros((3, *matter.cells.shape[1:]), np.float32)
    if max(x, y, z) <= _COARSEST:
        mean = environment_radiance(sources, _all_directions()).mean(axis=0)
        start[..., :x] = mean.astype(np.float32)[:, None, None, None]
        return start
    wide = coarser(matter)
    found, _, _ = _Solve(wide, sources, threads).run(_start(wide, sources, threads))
    for axis in (1, 2, 3):
        found = np.repeat(found, 2, axis=axis)
    start[..., :x] = found[:, :z, :y, :x]
    return start


def _all_directions() -> Float64:
    """Return the 24 directions, unit vectors to where light comes from: float64 [24, 3]."""
    rotations = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1, -1), repeat=3):
            rotation = np.zeros((3, 3))
            rotation[range(3), order] = signs
            if np.linalg.det(rotation) > 0:
                rotations.append(rotation)
    return np.asarray(np.array(rotations) @ np.array(_COORDINATES))


def _key_directions(sources: LightSources, num: int) -> Float64:
    """Return directions to places that are spread evenly over the key light, on a spiral: float64 [num, 3]."""
    toward = np.array(sources.key, np.float64)
    side = np.cross(toward, np.eye(3)[np.abs(toward).argmin()])
    side /= np.linalg.norm(side)
    turns = np.arange(num)[:, None] + 0.5
    cosine = 1 - turns / num * (1 - np.cos(np.radians(sources.key_radius)))
    across = np.cos(_GOLDEN_ANGLE * turns) * side + np.sin(_GOLDEN_ANGLE * turns) * np.cross(toward, side)
    return np.asarray(cosine * toward + np.sqrt(1 - cosine * cosine) * across)


class _Way(NamedTuple):
    """How light of a direction goes through the layouts of the grid."""

    # The axis of the largest part of the direction: 0 for x, 1 for y, 2 for z.
    axis: int
    is_upwards: bool
    # The place from which light comes in the plane before, in rows and in cells.
    offset: tuple[float, float]
    # The length of a path through a cell, in widths of a cell.
    path: float


def _way_of(direction: Float64) -> _Way:
    axis = int(np.abs(direction).argmax())
    rows, cells = ((1, 2), (2, 0), (1, 0))[axis]
    largest = abs(float(direction[axis]))
    offset = float(direction[rows]) / largest, float(direction[cells]) / largest
    return _Way(axis, bool(direction[axis] < 0), offset, 1 / largest)


class _Solve:
    """The solve on one grid: its cells in two layouts, the key light in it, and the rounds.

    Arrays along x are [..., z, y, x], arrays along z are [..., x, y, z]; the last axis is padded.
    """

    def __init__(self, matter: MatterGrid, sources: LightSources, threads: ThreadPool) -> None:
        x, y, z = matter.shape_xyz
        self._sources, self._threads = sources, threads
        self._along_x = (z, y, matter.cells.shape[3])
        self._along_z = (x, y, -(-z // ROW_CELLS) * ROW_CELLS)
        self._directions = _all_directions()
        self._blocks = range(-(-z // ROW_CELLS))
        self._albedos = np.zeros((3, *self._along_x), np.float32)
        self._shares = self._prepared(matter)
        self.key_radiance = sources.key_irradiance / (4 * np.pi)
        self.key = self._key_light()
        self._scattered = self._both(3)
        # Sums of sweeps: four along y and z, two along x.
        self._sums = np.zeros((4, 3, *self._along_x), np.float32), np.zeros((2, 3, *self._along_z), np.float32)

    def _both(self, channels: int) -> tuple[Float32, Float32]:
        return np.zeros((channels, *self._along_x), np.float32), np.zeros((channels, *self._along_z), np.float32)

    def _prepared(self, matter: MatterGrid) -> tuple[Float32, Float32]:
        shares = self._both(3)
        for each in shares:
            each[:2] = 1  # the padding lets all light through
        prepare = kernels().prepare_cells.partial(cells=matter.cells, path=_way_of(self._directions[0]).path)
        albedos, (along_x, along_z) = self._albedos, shares
        self._threads.map(
            lambda block: prepare(block=block, albedos=albedos, along_x=along_x, along_z=along_z), self._blocks
        )
        if self._sources.scattering < 1:
            albedos *= np.float32(self._sources.scattering)
        return shares

    def _key_light(self) -> Float32:
        """Return the share of the key light that reaches each cell, float32 [z, y, x], padded."""
        out = np.zeros((1, *self._along_x), np.float32)
        (key,) = out
        if not self.key_radiance.any():
            return key
        ways = [_way_of(direction) for direction in _key_directions(self._sources, _NUM_KEY_DIRECTIONS)]
        # Four sums, whatever the number of threads, so that their order is the same.
        sums = np.zeros((4, 1, *self._along_x), np.float32), np.zeros((4, 1, *self._along_z), np.float32)

        def shine(number: int) -> None:
            for way in ways[number::4]:
                layout = int(way.axis == 0)
                kernels().shine_key(
                    shares=self._shares[layout], are_planes_first=way.axis != 1, is_upwards=way.is_upwards,
                    offset=np.array(way.offset, np.float32), path=way.path, weight=1 / len(ways),
                    out=sums[layout][number],
                )  # fmt: skip

        self._threads.map(shine, range(4))
        self._gather(sums, out)
        return key

    def _gather(self, sums: tuple[Float32, Float32], out: Float32) -> None:
        gather = kernels().gather_light.partial(along_x=sums[0], along_z=sums[1])
        self._threads.map(lambda block: gather(block=block, out=out), self._blocks)

    def run(self, start: Float32) -> tuple[Float32, float, int]:
        """Return the mean radiance without the straight key light, [3, z, y, x], the last change, and the rounds."""
        begun = np.empty((_MIXED_ROUNDS, *start.shape), np.float32)
        ended = np.zeros_like(begun)  # zeros in the padding, so that nothing changes there
        products = np.zeros((3, _MIXED_ROUNDS, _MIXED_ROUNDS))
        begun[0] = start
        for number in range(MAX_ROUNDS):
            here, known = number % _MIXED_ROUNDS, min(number + 1, _MIXED_ROUNDS)
            self._round(begun[here], np.full(24, 1 / 24), ended[here])
            changes, residual = self._measured(begun[:known], ended[:known], here)
            products[:, here, :known] = products[:, :known, here] = changes
            if residual <= TOLERANCE or number + 1 == MAX_ROUNDS:
                break
            self._mix(ended[:known], products[:, :known, :known], begun[(number + 1) % _MIXED_ROUNDS])
        return ended[here].copy(), residual, number + 1

    def _mix(self, ended: Float32, products: Float64, out: Float32) -> None:
        weights = np.array([_best_weights(each) for each in products], np.float32).T
        mix = kernels().mix_rounds.partial(ended=ended, weights=np.ascontiguousarray(weights))
        self._threads.map(lambda z: mix(slab=z, out=out), range(out.shape[1]))

    def _round(self, radiance: Float32, weights: Float64, out: Float32) -> None:
        """Scatter the mean radiance, and write the weighted sum of the radiances of all directions.

        radiance, out: [3, z, y, x]. weights: [24].
        """
        self._scatter(radiance)
        ways = [_way_of(direction) for direction in self._directions]
        entering = environment_radiance(self._sources, self._directions).astype(np.float32)

        def sweep(group: tuple[int, bool]) -> None:
            axis, is_upwards = group
            chosen = [k for k, way in enumerate(ways) if (way.axis, way.is_upwards) == group]
            layout = int(axis == 0)
            number = int(is_upwards) + (2 if axis == 2 else 0)
            kernels().sweep_light(
                shares=self._shares[layout], scattered=self._scattered[layout], are_planes_first=axis != 1,
                is_upwards=is_upwards, offsets=np.array([ways[k].offset for k in chosen], np.float32),
                entering=entering[chosen], weights=weights[chosen].astype(np.float32), out=self._sums[layout][number],
            )  # fmt: skip

        self._threads.map(sweep, [(axis, is_upwards) for axis in range(3) for is_upwards in (False, True)])
        self._gather(self._sums, out)

    def _scatter(self, radiance: Float32) -> None:
        scatter = kernels().scatter_light.partial(
            albedos=self._albedos, radiance=radiance, key=self.key, key_radiance=self.key_radiance
        )
        along_x, along_z = self._scattered
        self._threads.map(lambda block: scatter(block=block, along_x=along_x, along_z=along_z), self._blocks)

    def _measured(self, begun: Float32, ended: Float32, number: int) -> tuple[Float64, float]:
        """Return the inner products of the change of a round with all changes, [3, rounds], and its largest change."""
        slabs = begun.shape[2]
        products, largest = np.empty((slabs, 3, len(begun))), np.empty(slabs, np.float32)
        measure = kernels().measure_round.partial(begun=begun, ended=ended, number=number)
        self._threads.map(lambda z: measure(slab=z, products=products, largest=largest), range(slabs))
        total = np.zeros(products.shape[1:])
        for each in products:  # one after the other: np.sum chooses an order by the processor
            total += each
        return total, float(largest.max())

    def flux(self, radiance: Float32) -> list[Float32]:
        """Return the means of the parts x, y and z of directions times their radiances, each [3, z, y, x]."""
        found = []
        for axis in range(3):
            out = np.zeros_like(radiance)
            self._round(radiance, self._directions[:, axis] / 24, out)
            found.append(out)
        return found


def _best_weights(products: Float64) -> Float64:
    """Return the weights, whose sum is 1, for which the weighted sum of changes is least.

    products: the inner products of the changes, [n, n].
    """
    num = len(products)
    size = float(np.trace(products)) or 1.0
    matrix = products / size + 1e-10 * np.eye(num)
    # Gauss's elimination, written out: libraries order sums by the processor.
    rows = [[float(number) for number in row] + [1.0] for row in matrix]
    for k in range(num):
        for row in rows[k + 1 :]:
            factor = row[k] / rows[k][k]
            for j in range(k, num + 1):
                row[j] -= factor * rows[k][j]
    weights = [0.0] * num
    for k in reversed(range(num)):
        rest = rows[k][num] - sum(rows[k][j] * weights[j] for j in range(k + 1, num))
        weights[k] = rest / rows[k][k]
    return np.array(weights) / sum(weights)
