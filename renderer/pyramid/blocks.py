"""From the voxels of blocks to nodes, and from nodes to what is stored of them: what all ways to make them share."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.pyramid import kernels
from renderer.pyramid.memory import Groups
from renderer.transfer import Classifier

Array = npt.NDArray[Any]


def as_packed_channels(values: npt.NDArray[np.float32]) -> npt.NDArray[np.complex128]:
    """float32 [..., 4] as [...] items of 16 bytes; a view."""
    return values.view(np.complex128)[..., 0]


def classify_blocks(
    raw: Array, classifier: Classifier, starts: Array, extents: Array, voxels: npt.NDArray[np.float32], groups: Groups
) -> None:
    """All nodes of the blocks at voxels `starts` [g, 3], `extents` [g, 3] (x, y, z) of which are real.

    voxels: float32 [512, 4], scratch.
    """
    packed_table = None if classifier.table is None else as_packed_channels(classifier.table)
    kernels.build_channel_level(
        raw, *classifier, packed_table, starts, extents, voxels, as_packed_channels(voxels), *groups[0]
    )
    merge(groups, extents, 2)


def merge(groups: Groups, extents: Array, side: int) -> None:
    """The 8 parents of the 64 nodes of each group, which are `side` voxels a side, and theirs."""
    nodes, parents, roots = groups
    kernels.merge_groups(*nodes, extents, side, *parents, *roots)


def opacities_to_depths(means: npt.NDArray[np.float32], max_depth: float) -> None:
    """Means of (a c, a) [n, 4] become those depths times (c, 1), in place.

    As depths they keep their digits in half precision: of opacities near 1 it would leave none.
    """
    opacities = means[:, 3].astype(np.float64)
    with np.errstate(divide="ignore"):  # rounded to 1, it is as deep as the max_depth voxel
        depths = np.minimum(-np.log1p(-np.minimum(opacities, 1)), max_depth)
    means *= (depths / opacities)[:, None]


def store_scaled(values: npt.NDArray[np.float32], factor: float, out: Array) -> None:
    """`values` times `factor` (a power of two) in the precision of `out`."""
    if out.dtype == np.float16:
        kernels.store_float16(values.reshape(-1), factor, out.view(np.uint16).reshape(-1))
    else:
        np.multiply(values, np.float32(factor), out=out)
