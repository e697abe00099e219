"""Lattices of voxels of any shape and place in the world."""

from __future__ import annotations

import numpy as np

from renderer.volume import Volume, make_volume

# One voxel, a row along each axis, 2^k + 1, primes. x, y, z.
SHAPES = [(1, 1, 1), (1, 1, 40), (40, 1, 1), (1, 23, 1), (2, 1, 3), (9, 17, 5), (7, 13, 11), (16, 16, 16), (33, 3, 2)]

ROTATION = np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3
# Index axes in the world, columns: straight, 1000 : 1, oblique, sheared, left-handed, all of it.
MATRICES = [
    np.eye(3), np.diag([1.0, 1.0, 1000.0]), np.diag([1e-3, 1.0, 1.0]), ROTATION,
    np.array([[1.0, 0.5, 0.2], [0.0, 1.0, 0.4], [0.0, 0.0, 1.0]]), np.diag([-1.0, 1.0, 1.0]),
    ROTATION @ np.array([[1.0, 0.3, 0.0], [0.0, -2.0, 0.1], [0.2, 0.0, 50.0]]),
]  # fmt: skip


def turned(of: Volume, permutation: tuple[int, int, int], flips: tuple[int, ...]) -> Volume:
    """The same voxels at the same places, by another order of the index axes: some swapped, some backwards."""
    values = np.transpose(of.values, [2 - permutation[2 - k] for k in range(3)])
    axes = of.world_from_index[:3, :3][:, list(permutation)].copy()
    origin = of.world_from_index[:3, 3].copy()
    for axis in flips:
        values = np.flip(values, 2 - axis)
        origin += axes[:, axis] * (values.shape[2 - axis] - 1)
        axes[:, axis] *= -1
    world_from_index = np.eye(4)
    world_from_index[:3, :3], world_from_index[:3, 3] = axes, origin
    return make_volume(np.ascontiguousarray(values), world_from_index, "turned")
