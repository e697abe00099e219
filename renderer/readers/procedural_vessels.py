"""Make the vessels of a kidney: an artery and a vein that branch until they reach everywhere, as labels 1 and 2."""

from __future__ import annotations

import numpy as np

from renderer.readers.procedural_grid import blocks, random_places
from renderer.scene import ProceduralSource
from renderer.volume import Array

# How many places each tree has grown to after its trunk, its large and small branches, and its twigs.
_NUM_PLACES = (10, 50, 250, 1500)
# The largest number of segments from one end of a tree to a place that it grows to.
_MOST_STEPS = 90
# The length of a segment, a share of half of the volume, as all lengths here.
_SEGMENT = 0.03
# The weight of the direction of a segment in that of the next one, beside the pull of places.
_PERSISTENCE = 0.5
# A place is reached at this distance.
_REACHED = 0.045
# The radius of the thinnest vessels.
_THINNEST = 0.0065
# Where the artery, and the vein, begins.
_ROOTS = ((0.66, -0.03, 0.06), (0.66, 0.1, -0.06))


def vessel_values(source: ProceduralSource) -> Array:
    """Return a label for each tree: segments with round ends, at least a voxel wide, so that none is broken.

    Radii follow Murray's law (C. D. Murray, "The Physiological Principle of Minimum Work", PNAS 12, 1926): where a
    vessel parts, r^3 is the sum of the r^3 of its branches, so that r grows with the cube root of the number of ends.
    """
    values = np.zeros(source.shape[::-1], np.uint8)
    trees = [vessel_tree(2 * source.seed + k, np.array(root)) for k, root in enumerate(_ROOTS)]
    for block in blocks(source, values, (1.5, 1.0, 2.0)):
        for label, (start, end, radius) in enumerate(trees, 1):
            wide = np.maximum(radius, 0.9 * block.step)[:, None]
            low, high = np.minimum(start, end) - wide, np.maximum(start, end) + wide
            for k in block.near(low, high):
                part, _ = block.part(low[k], high[k])
                (ux, uy, uz), (dx, dy, dz) = start[k], end[k] - start[k]
                x, y, z = part.x - ux, part.y - uy, part.z - uz
                along = np.clip((x * dx + y * dy + z * dz) / (dx * dx + dy * dy + dz * dz), 0, 1)
                square = (x - along * dx) ** 2 + (y - along * dy) ** 2 + (z - along * dz) ** 2
                part.out[square < wide[k] * wide[k]] = label
    return values


def vessel_tree(seed: int, root: Array) -> tuple[Array, Array, Array]:
    """Return the starts, ends and radii of segments that grow from a root towards random places in a kidney.

    Each place pulls at the nearest end of a segment until it is reached, by space colonization (A. Runions, B. Lane,
    P. Prusinkiewicz, "Modeling Trees with a Space Colonization Algorithm", 2007).
    """
    places = random_places(seed, 4 * _NUM_PLACES[-1]) * [0.75, 0.5, 1.0]
    bent = places[:, 0] - 0.55 * places[:, 2] ** 2 + 0.12  # a bean: its hollow side is at high x
    all_places = places[(bent / 0.5) ** 2 + (places[:, 1] / 0.42) ** 2 + (places[:, 2] / 0.95) ** 2 < 1]
    nodes, parents = root[None], np.array([0])
    for begin, end in zip((0, *_NUM_PLACES), _NUM_PLACES, strict=False):
        places = all_places[begin:end]
        nearest, square = np.zeros(len(places), int), np.full(len(places), np.inf)
        for k, node in enumerate(nodes):
            distance = _square(places - node)
            nearest, square = np.where(distance < square, k, nearest), np.minimum(distance, square)
        for _ in range(_MOST_STEPS):
            left = square > _REACHED**2
            places, nearest, square = places[left], nearest[left], square[left]
            pulls = np.zeros_like(nodes)
            np.add.at(pulls, nearest, (places - nodes[nearest]) / np.sqrt(square)[:, None])
            growing = np.flatnonzero(_square(pulls) > 0)
            if not growing.size:
                break
            heading = pulls[growing] / np.sqrt(_square(pulls[growing]))[:, None]
            heading += _PERSISTENCE / _SEGMENT * (nodes[growing] - nodes[parents[growing]])
            heading *= _SEGMENT / np.sqrt(_square(heading))[:, None]
            first = len(nodes)
            kept: list[int] = []
            for k, node in enumerate(nodes[growing] + heading):
                distance = _square(places - node)
                if (distance < square).any():
                    nearest = np.where(distance < square, first + len(kept), nearest)
                    square = np.minimum(distance, square)
                    kept.append(k)
            nodes = np.concatenate([nodes, (nodes[growing] + heading)[kept]])
            parents = np.append(parents, growing[kept])
    ends = np.bincount(parents[1:], minlength=len(nodes)) == 0
    num_ends = ends.astype(int)
    for k in range(len(nodes) - 1, 0, -1):
        num_ends[parents[k]] += num_ends[k]
    radius = _THINNEST * np.round(np.cbrt(num_ends) * 2**20) / 2**20  # rounded, since cube roots differ in a last bit
    return nodes[parents[1:]], nodes[1:], radius[1:]


def _square(vectors: Array) -> Array:
    return np.asarray(vectors[:, 0] ** 2 + vectors[:, 1] ** 2 + vectors[:, 2] ** 2)
