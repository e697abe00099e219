"""Sort splats and bricks back to front. Cells of equal depth are drawn in the order of the cut.

`order_by_depth` sorts splats by depth, for footprints that overlap. `box_order` is the exact visibility order of the
octree's cells as boxes (the traversal of Laur and Hanrahan 1991). It is right for bricks, and for footprints that do
not reach beyond their cells; with overlapping footprints, it shows seams along the planes between large cells seen
edge-on: a bonsai has 35.2 dB with it, and 36.7 dB sorted by depth.
"""

from __future__ import annotations

import numpy as np

from renderer.kernels import kernels
from renderer.view.camera import View
from renderer.volume import Float32, Int32, UInt8, UInt32, Volume


def order_by_depth(depths: Float32) -> UInt32:
    """Return the indices of depths, the largest depth first, uint32 [n]; equal depths keep their order.

    depths: [n], without NaN.
    """
    order = np.empty(len(depths), np.uint32)
    kernels().depth_order(depths=depths, order=order)
    return order


def box_order(levels: UInt8, cells: Int32, volume: Volume, view: View) -> UInt32:
    """Return the indices of octree nodes, drawn as boxes, in their exact order from back to front, uint32 [n].

    levels: the levels of the nodes, [n]. cells: the positions x, y, z of the nodes, in units of the node's own width,
    which is 2^level voxels, [n, 3].
    """
    index_from_world = np.linalg.inv(volume.world_from_index[:3, :3])
    if view.projection == "perspective":
        from_centre = (view.target - volume.centre) + view.distance * view.axes[2]
        eye = volume.centre_index + index_from_world @ from_centre
    else:  # the eye is at infinity; NaN marks an axis whose splitting planes are seen edge-on and hide nothing
        direction = index_from_world @ view.forward
        eye = np.where(direction == 0, np.nan, np.copysign(np.inf, -direction))
    order = np.empty(len(cells), np.uint32)
    kernels().box_order(levels=levels, cells=cells, eye=eye, shape=volume.shape_xyz, order=order)
    return order
