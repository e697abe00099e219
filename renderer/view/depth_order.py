"""Sort splats and bricks back to front; ties are broken by the cell's place in the cut.

`depth_order` sorts by depth, which splats that overlap need. `box_order` is the exact visibility order of the octree's
cells as boxes (the traversal of Laur and Hanrahan 1991): right for bricks and for footprints inside their cells.
Overlapping footprints show seams along the planes between large cells seen edge-on.
"""

from __future__ import annotations

import numpy as np

from renderer.compiled import jit
from renderer.view.camera import View
from renderer.volume import Float32, Int32, Int64, UInt8, UInt32, UInt64, Volume


def depth_order(depths: Float32) -> UInt32:
    """Return the order of descending depths (float32 [n], no NaN), equal ones by ascending index: uint32 [n]."""
    keys = _sort_keys(depths.view(np.uint32))
    keys.sort()
    return keys.astype(np.uint32)


@jit
def _sort_keys(bits: UInt32) -> UInt64:
    """Return numbers that ascend as float32, given by their bits, descend; the low half of each is its index."""
    keys, sign = np.empty(len(bits), np.uint64), np.uint32(1 << 31)
    for i in range(len(bits)):
        # Bits of positive numbers ascend with the number, of negative ones descend, and the two zeros are equal.
        key = bits[i] if bits[i] > sign else np.uint32(sign - np.uint32(1)) - (bits[i] & ~sign)
        keys[i] = np.uint64(key) << np.uint64(32) | np.uint64(i)
    return keys


def box_order(levels: UInt8, cells: Int32, volume: Volume, view: View) -> Int64:
    """Return nodes of the octree back to front as boxes, exactly, in perspective or parallel projection: int64 [n].

    levels: [n], of the nodes. cells: [n, 3], x, y, z in units of the node's own width, 2^level voxels.

    A child of a node may hide another child only if fewer of the node's three splitting planes lie between it and the
    eye. That number, 0 to 3, is one base-4 digit of the cell's key, the root's first. It is a sum over the axes, so
    that three tables by coordinate give every key. The digits of splits inside the cell are cleared.
    """
    index_from_world = np.linalg.inv(volume.world_from_index[:3, :3])
    if view.projection == "perspective":
        from_centre = (view.target - volume.centre) + view.distance * view.axes[2]
        eye = volume.centre_index + index_from_world @ from_centre
    else:  # the eye at infinity; a splitting plane seen edge-on hides nothing
        direction = index_from_world @ view.forward
        eye = np.where(direction == 0, np.nan, np.copysign(np.inf, -direction))
    num_levels = max(1, (max(volume.shape_xyz) - 1).bit_length())
    keys = np.zeros(len(cells), np.uint64)
    first = cells.astype(np.int64) << levels[:, None].astype(np.int64)
    for axis in range(3):
        keys += _split_plane_digits(float(eye[axis]), volume.shape_xyz[axis], num_levels)[first[:, axis]]
    cleared = 2 * levels.astype(np.uint64)
    keys = keys >> cleared << cleared
    return np.argsort(~keys, kind="stable")


@jit
def _split_plane_digits(eye: float, num: int, num_levels: int) -> UInt64:
    """Return the digits by index along an axis: uint64 [num], two bits a level, 1 where the split hides the index."""
    digits = np.zeros(num, np.uint64)
    for index in range(num):
        for level in range(num_levels):
            plane = (index >> (level + 1) << (level + 1)) + (1 << level) - 0.5
            is_upper = index >> level & 1 == 1
            if eye < plane if is_upper else eye > plane:
                digits[index] |= np.uint64(1) << np.uint64(2 * level)
    return digits
