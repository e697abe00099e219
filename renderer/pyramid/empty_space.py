"""Find the blocks of voxels that show nothing, by the kernel of `empty_space.cpp`. Pyramids are built of the others.

Voxels with a table are looked up until one is visible. Wider voxels take the min-max test of `renderer.transfer`.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels import kernels
from renderer.transfer import Classifier, RawVoxels
from renderer.volume import Bools, Int64


def visible_blocks(raw: RawVoxels, classifier: Classifier, starts: Int64, extents: Int64) -> Bools:
    """Return which blocks at voxels `starts` [g, 3], `extents` [g, 3] large (x, y, z), may show something, bool [g].

    Exact with a table. Without one, a block may count although no voxel in it is visible.
    """
    visible = np.empty(len(starts), np.bool_)
    kernels().test_blocks(raw=raw, classifier=classifier, starts=starts, extents=extents, visible=visible)
    return visible
