"""Rasterise bricks in float64, one after the other: slow, and meant to be seen to be right. The oracle of the tests.

It shares its inputs with `renderer.draw.gl.raster`, nothing else; `renderer.bricks.sampling` says what is drawn. All of
it happens in index coordinates, into which rays are brought from the world:

    ray of a pixel -> its way through a brick's box -> equal parts -> the field in the middle of each -> front to back

N. Max, "Optical Models for Direct Volume Rendering", IEEE TVCG 1 (1995): the integral that the parts add up to.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.bricks import BRICK_SIZE, DITHER, HALO, JITTER_PER_PX, BrickBatch, mean_texels, scalar_texels
from renderer.scene import ShadingSpec
from renderer.view import View
from renderer.volume import Volume

Float64 = npt.NDArray[np.float64]
Int64 = npt.NDArray[np.int64]


@dataclass(frozen=True)
class _Rays:
    """Rays in index coordinates, `origins + t * directions`, all [n, 3], drawn from t = `starts` [n]; t is a world
    length. phases: [n], of their pixels."""

    origins: Float64
    directions: Float64
    starts: Float64
    phases: Float64

    def at(self, t: Float64) -> Float64:
        """[n, 3], index coordinates."""
        return self.origins + t[:, None] * self.directions

    def __getitem__(self, which: npt.NDArray[Any]) -> _Rays:
        return _Rays(self.origins[which], self.directions[which], self.starts[which], self.phases[which])


def rasterize_bricks_reference(batch: BrickBatch, order: npt.NDArray[np.uint32], view: View) -> Float64:
    """Composite the bricks `order`, front to back: float64 [height, width, 4], premultiplied RGBA over nothing."""
    strides = batch.screen_sampling.strides
    nodes = _pixel_grid(view.size, strides[0])
    image = _radiance(batch, order, _rays(batch.cut.volume, view, *nodes)).reshape(*nodes[0].shape, 4)
    for coarse, stride in pairwise(strides):
        assert coarse % stride == 0, strides
        nodes = _pixel_grid(view.size, stride)
        is_alike = _are_alike(image, batch.screen_sampling.difference_threshold)[nodes[1] // coarse, nodes[0] // coarse]
        is_drawn = ~is_alike & ((nodes[0] % coarse != 0) | (nodes[1] % coarse != 0))
        image = _between(image, coarse, *nodes)
        image[is_drawn] = _radiance(batch, order, _rays(batch.cut.volume, view, *(n[is_drawn] for n in nodes)))
    return _between(image, strides[-1], *_pixel_grid(view.size, 1))


def _pixel_grid(size: tuple[int, int], stride: int) -> tuple[Int64, Int64]:
    """Columns and rows of the pixels whose both are multiples of the stride, [rows, columns] each: as many as it takes
    to have every pixel of the image among them or between them."""
    columns, rows = (stride * np.arange((num - 1 + stride - 1) // stride + 1) for num in size)
    at_columns, at_rows = np.meshgrid(columns, rows)
    return at_columns, at_rows


def _are_alike(nodes: Float64, spread: float) -> npt.NDArray[np.bool_]:
    """[rows, columns]: of nodes [rows, columns, 4], which four, the lowest of which has this place, do not differ."""
    around = np.pad(nodes, ((1, 1), (1, 1), (0, 0)), mode="edge")
    along_row = np.abs(around[1:-1, :-2] - 2 * nodes + around[1:-1, 2:])
    along_column = np.abs(around[:-2, 1:-1] - 2 * nodes + around[2:, 1:-1])
    bends = np.maximum(along_row, along_column).max(axis=-1)
    ranges = np.ptp(_corners(nodes), axis=0).max(axis=-1)
    return np.asarray((ranges <= spread) | (_corners(bends).max(axis=0) <= spread))


def _corners(nodes: Float64) -> Float64:
    """[4, rows, columns, ...]: each node and those to its right, below it and both; the last ones repeated."""
    further = np.pad(nodes, ((0, 1), (0, 1)) + ((0, 0),) * (nodes.ndim - 2), mode="edge")
    return np.stack([further[:-1, :-1], further[:-1, 1:], further[1:, :-1], further[1:, 1:]])


def _between(nodes: Float64, stride: int, columns: Int64, rows: Int64) -> Float64:
    """[..., 4]: bilinear between the nodes [rows, columns, 4] of a lattice, at some pixels."""
    corners = _corners(nodes)[:, rows // stride, columns // stride]
    down, right = (rows % stride / stride)[..., None], (columns % stride / stride)[..., None]
    upper = (1 - right) * corners[0] + right * corners[1]
    lower = (1 - right) * corners[2] + right * corners[3]
    return np.asarray((1 - down) * upper + down * lower)


def _rays(volume: Volume, view: View, columns: Int64, rows: Int64) -> _Rays:
    """Through the centres of pixels ([...] each, which may lie outside of the image), one after the other.

    They begin beside the volume's centre, on the plane through it that faces the camera: those of a distant eye would
    be worth few digits. Where the centre is behind the eye they begin at the eye plane.
    """
    x = (columns.ravel() + 0.5 - view.size[0] / 2) / view.scale_px
    y = (view.size[1] / 2 - rows.ravel() - 0.5) / view.scale_px
    centre = view.in_view(volume.centre)
    depth = max(0.0, -centre[2])
    if view.projection == "perspective":
        directions = np.stack([x, y, np.full_like(x, -1.0)], axis=1)
        origins = depth * directions
    else:
        directions = np.broadcast_to([0.0, 0.0, -1.0], (len(x), 3))
        origins = np.stack([x, y, np.full_like(x, -depth)], axis=1)
    per_depth = np.linalg.norm(directions, axis=1)  # world length
    index_from_view = np.linalg.inv(volume.world_from_index[:3, :3]) @ view.axes.T
    return _Rays(
        volume.centre_index + (origins - centre) @ index_from_view.T,
        directions / per_depth[:, None] @ index_from_view.T,
        (view.near - depth) * per_depth,
        _phases(columns.ravel(), rows.ravel()),
    )


def _phases(columns: Int64, rows: Int64) -> Float64:
    """[n]: multiples of 2^-24 from 0 to 1."""
    whole = columns * JITTER_PER_PX[0] + rows * JITTER_PER_PX[1] & 0xFFFFFFFF
    return np.asarray((whole >> 8) / 2.0**24)


def _radiance(batch: BrickBatch, order: npt.NDArray[np.uint32], rays: _Rays) -> Float64:
    """[n, 4]: all bricks, one after the other."""
    total = np.zeros((len(rays.starts), 4))
    for brick in order:
        enter, leave = _span(rays, batch.cut.visible_bounds[brick])
        is_hit = (enter < leave) & (1 - total[:, 3] >= batch.screen_sampling.termination_transmittance)
        if is_hit.any():
            of_brick = _of_brick(batch, int(brick), rays[is_hit], enter[is_hit], leave[is_hit])
            total[is_hit] += (1 - total[is_hit, 3:]) * of_brick
    return total


def _span(rays: _Rays, box: Float64) -> tuple[Float64, Float64]:
    """World lengths [n] at which the rays enter and leave a box; the first is not below the second where they miss it.

    A ray within a face belongs to the box that lies above it.
    """
    enter, leave = rays.starts.copy(), np.full(rays.starts.shape, np.inf)
    for axis in range(3):
        at, speed = rays.origins[:, axis], rays.directions[:, axis]
        is_across = speed != 0
        is_beside = ~is_across & ((at < box[0, axis]) | (at >= box[1, axis]))
        first, last = (box[k, axis] - at[is_across] for k in (0, 1))
        first, last = np.sort([first / speed[is_across], last / speed[is_across]], axis=0)
        enter[is_across] = np.maximum(enter[is_across], first)
        leave[is_across] = np.minimum(leave[is_across], last)
        leave[is_beside] = -np.inf
    return enter, leave


def _of_brick(batch: BrickBatch, brick: int, rays: _Rays, enter: Float64, leave: Float64) -> Float64:
    """[n, 4]: what rays take up in a brick between two lengths."""
    level, cell = int(batch.cut.levels[brick]), batch.cut.cells[brick]
    length = np.linalg.norm(rays.directions, axis=1) * (leave - enter) / 2**level  # in cells
    spread = 1 + DITHER * (rays.phases - 0.5)
    num_parts = np.maximum(1, np.floor(length / batch.steps[brick] * spread + 0.5 + rays.phases))
    num_parts += num_parts % 4 == 0
    part = (leave - enter) / num_parts
    number = np.arange(num_parts.max())
    is_part = number < num_parts[:, None]
    rays_of, numbers = np.nonzero(is_part)
    index = rays[rays_of].at(enter[rays_of] + (numbers + 0.5) * part[rays_of])
    channels = np.zeros((*is_part.shape, 4))
    channels[is_part] = _field(batch, level, cell)((index + 0.5) / 2**level - BRICK_SIZE * cell)
    total = np.zeros((len(enter), 4))
    for k in range(len(number)):
        tau = channels[:, k, 3:]
        color = np.divide(channels[:, k, :3], tau, out=np.zeros((len(tau), 3)), where=tau > 0)
        alpha = -np.expm1(-tau * part[:, None])
        total += (1 - total[:, 3:]) * np.hstack([alpha * color, alpha])
    return total


def _field(batch: BrickBatch, level: int, cell: npt.NDArray[np.int32]) -> Callable[[Float64], Float64]:
    """(tau c, tau) over the world unit, [n, 4], at points of a brick [n, 3], in cells from its lowest corner."""
    if level > 0:
        means = mean_texels(batch.bricks, level, cell[None])[0].astype(np.float64)
        return lambda at: _trilinear(means, at) / batch.cut.volume.finest_spacing
    texels = scalar_texels(batch.bricks, cell[None], lit=batch.shading is not None)[0].astype(np.float64)
    texels = texels.reshape(*texels.shape[:3], -1)
    return lambda at: _classified(batch, _trilinear(texels, at)) / batch.cut.volume.finest_spacing


def _trilinear(texels: Float64, at: Float64) -> Float64:
    """[n, k]: texels [z, y, x, k], whose first one lies in the apron, at points (x, y, z) in cells of the brick."""
    place = at + HALO - 0.5  # of a texel's centre its index
    low = np.clip(np.floor(place).astype(int), 0, BRICK_SIZE + 2 * HALO - 2)
    share = place - low
    total = np.zeros((len(at), texels.shape[-1]))
    for corner in product((0, 1), repeat=3):
        x, y, z = (low + corner).T
        total += np.prod(np.where(corner, share, 1 - share), axis=1)[:, None] * texels[z, y, x]
    return total


def _classified(batch: BrickBatch, texel: Float64) -> Float64:
    """[n, 4]: (tau c, tau) times the finest spacing of interpolated texels, (u) or (u, world gradient)."""
    pieces = batch.pieces
    k = np.searchsorted(pieces.ends, texel[:, 0], side="right")
    offset = (texel[:, 0] - pieces.origins[k])[:, None]
    channels = pieces.lows[k] + offset * pieces.slopes[k].astype(np.float64)
    if batch.shading is not None:
        channels[:, :3] *= _light(batch.shading, texel[:, 1:])[:, None]
    return np.hstack([channels[:, :3] * channels[:, 3:], channels[:, 3:]])


def _light(shading: ShadingSpec, gradient: Float64) -> Float64:
    """[n]: what the colour is multiplied by, Lambert's law for a surface that faces down a world gradient [n, 3]."""
    length = np.linalg.norm(gradient, axis=1)
    toward_light = -gradient @ (np.array(shading.light) / np.linalg.norm(shading.light))
    cosine = np.divide(toward_light, length, out=np.zeros_like(length), where=length > 0)
    return np.asarray(shading.ambient + shading.diffuse * np.maximum(0.0, cosine))
