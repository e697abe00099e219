"""Turn the voxels of blocks into nodes, and nodes into what is stored of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.pyramid import kernels
from renderer.pyramid.memory import Groups
from renderer.transfer import Classifier

Array = npt.NDArray[Any]


def as_packed_channels(values: npt.NDArray[np.float32]) -> npt.NDArray[np.complex128]:
    """Return float32 [..., 4] as items of 16 bytes [...]; a view."""
    return values.view(np.complex128)[..., 0]


def classify_blocks(
    raw: Array, classifier: Classifier, starts: Array, extents: Array, voxels: npt.NDArray[np.float32], groups: Groups
) -> None:
    """Build all nodes of the blocks at voxels `starts` [g, 3]; `extents` [g, 3] (x, y, z) of each are real.

    voxels: float32 [512, 4], scratch.
    """
    unlit = classifier.lighting is None
    packed_table = as_packed_channels(classifier.table) if unlit and classifier.table is not None else None
    curve = classifier.curve if unlit else None
    packed_voxels = as_packed_channels(voxels)
    kernels.build_channel_level(
        raw, classifier, packed_table, curve, starts, extents, voxels, packed_voxels, *groups[0]
    )  # fmt: skip
    merge(groups, extents, 2)


def merge(groups: Groups, extents: Array, side: int) -> None:
    """Merge the 64 nodes of each group, `side` voxels wide, into their 8 parents and the root."""
    nodes, parents, roots = groups
    kernels.merge_groups(*nodes, extents, side, *parents, *roots)


def opacities_to_depths(means: npt.NDArray[np.float32], max_depth: float) -> None:
    """Convert means of (a c, a) [n, 4] to optical depths times (c, 1), in place.

    Depths keep their digits in half precision. Of opacities near 1 it would leave none.
    """
    opacities = means[:, 3].astype(np.float64)
    with np.errstate(divide="ignore"):  # an opacity that rounds to 1 has the largest depth
        depths = np.minimum(-np.log1p(-np.minimum(opacities, 1)), max_depth)
    means *= (depths / opacities)[:, None]


def store_scaled(values: npt.NDArray[np.float32], factor: float, out: Array) -> None:
    """Write `values` times `factor` (a power of two) in the precision of `out`."""
    if out.dtype == np.float16:
        kernels.store_float16(values.reshape(-1), factor, out.view(np.uint16).reshape(-1))
    else:
        np.multiply(values, np.float32(factor), out=out)
