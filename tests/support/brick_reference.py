"""Rasterise bricks in float64, one after the other: slow, and simple enough to check by eye.

The reference for the kernels. It shares their inputs; `renderer.bricks.sampling` says what is drawn. It classifies,
averages and interpolates the voxels with code of its own. Everything happens in index coordinates:

    ray of a pixel -> its segment in a brick's box -> equal parts -> the field in the middle of each part
                   -> the parts composited front to back

N. Max, "Optical Models for Direct Volume Rendering", IEEE TVCG 1 (1995): the integral that the parts add up to.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise, product

import numpy as np
from brickwork import alone
from dense_bricks import means_over_cells

from renderer.bricks import BrickBatch, BrickLayer, Bricks, ScreenSampling, cut_bricks, make_brick_batch
from renderer.scene import ShadingSpec
from renderer.transfer import MAX_NORMALIZED_SCALAR, VISIBILITY_THRESHOLD
from renderer.view import View, visible_bricks
from renderer.volume import Array, Bools, Float64, Int64, UInt32, Volume

# The share by which the number of parts of a ray varies with the ray's phase, as in the kernels' header `rays.h`.
DITHER = 0.15
# The factors of a pixel's column and row in the hash from which its phase follows, as in the kernels' header `rays.h`.
JITTER_PER_PX = (3242174889, 2447445414)

# A function from the rows and columns of pixels, [n, 2], and the number of rays along a pixel's side to the colours of
# the rays, [n, rays, 4].
DrawRays = Callable[[Int64, int], Float64]
# The field of each level of bricks that was drawn: from `_scalar_field` for level 0, else from `_mean_field`.
Fields = dict[int, Float64]


@dataclass(frozen=True)
class _Rays:
    """Rays in index coordinates: `origins + t * directions` for t from `starts` on, where t is a length in the world.

    origins, directions: [n, 3]. starts: [n]. phases: [n], from 0 to 1, by which the parts of neighbouring rays differ.
    """

    origins: Float64
    directions: Float64
    starts: Float64
    phases: Float64

    def at(self, t: Float64) -> Float64:
        """Return the points of the rays at lengths t [n]: index coordinates, [n, 3]."""
        return self.origins + t[:, None] * self.directions

    def __getitem__(self, which: Array) -> _Rays:
        return _Rays(self.origins[which], self.directions[which], self.starts[which], self.phases[which])


def rasterize_bricks_reference(batch: BrickBatch, order: UInt32, view: View) -> Float64:
    """Return the picture of bricks: float64 [height, width, 4], premultiplied RGBA.

    order: the numbers of the bricks to draw, front to back.
    """
    strides = batch.screen_sampling.strides
    nodes = _pixel_grid(view.size, strides[0])
    fields: Fields = {}
    image = _radiance(batch, order, _rays(batch.cut.volume, view, *nodes), fields).reshape(*nodes[0].shape, 4)
    for coarse, stride in pairwise(strides):
        assert coarse % stride == 0, strides
        nodes = _pixel_grid(view.size, stride)
        is_alike = _are_alike(image, batch.screen_sampling.difference_threshold)[nodes[1] // coarse, nodes[0] // coarse]
        is_drawn = ~is_alike & ((nodes[0] % coarse != 0) | (nodes[1] % coarse != 0))
        image = _between(image, coarse, *nodes)
        image[is_drawn] = _radiance(batch, order, _rays(batch.cut.volume, view, *(n[is_drawn] for n in nodes)), fields)
    image = _between(image, strides[-1], *_pixel_grid(view.size, 1))
    if strides[-1] == 1:
        _antialias(image, batch, lambda at, across: _several_rays(batch, order, view, at, across, fields))
    return image


def _antialias(image: Float64, batch: BrickBatch, draw: DrawRays) -> None:
    """Pixels that differ from a neighbour become the mean of 4 rays, and those whose rays differ that of 16."""
    sampling = batch.screen_sampling
    has_several = np.zeros(image.shape[:2], np.bool_)
    spreads = np.zeros(image.shape[:2])
    marked = _contrasts(image, np.ones_like(has_several)) > sampling.contrast_threshold
    while marked.any():
        rays = np.minimum(draw(np.argwhere(marked), 2), 1)  # as they are displayed
        with_first = np.concatenate([rays, np.minimum(image[marked], 1)[:, None]], axis=1)
        image[marked], spreads[marked] = rays.mean(axis=1), np.ptp(with_first, axis=1).max(axis=-1)
        has_several |= marked
        marked = (_contrasts(image, marked) > sampling.contrast_threshold) & ~has_several
    marked = spreads > sampling.spread_threshold
    has_many = np.zeros_like(marked)
    while marked.any():
        image[marked] = np.minimum(draw(np.argwhere(marked), 4), 1).mean(axis=1)
        has_many |= marked
        marked = _neighbours(_are_on_lines(image, sampling.contrast_threshold) & marked) & ~has_many


def _are_on_lines(image: Float64, threshold: float) -> Bools:
    """[rows, columns]: pixels above both of two opposite neighbours, or below both; none at the picture's border."""
    found = np.zeros(image.shape[:2], np.bool_)
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        one, other = (image - np.roll(image, (sign * down, sign * right), (0, 1)) for sign in (1, -1))
        above, below = np.minimum(one, other), -np.maximum(one, other)
        found |= np.maximum(above, below).max(axis=-1) > threshold
    found[[0, -1]] = found[:, [0, -1]] = False
    return found


def _neighbours(among: Bools) -> Bools:
    """[rows, columns]: pixels that are among some, or next to one of them."""
    height, width = among.shape
    padded = np.pad(among, 1)
    return np.any([padded[y : y + height, x : x + width] for y, x in product(range(3), range(3))], axis=0)


def _contrasts(image: Float64, among: Bools) -> Float64:
    """[rows, columns]: the largest difference of a channel between each pixel and its neighbours among some pixels."""
    padded, shown = np.pad(image, ((1, 1), (1, 1), (0, 0))), np.pad(among, 1)
    height, width = among.shape
    largest = np.zeros(among.shape)
    for down, right in product(range(3), range(3)):
        part = slice(down, down + height), slice(right, right + width)
        largest = np.maximum(largest, np.abs(padded[part] - image).max(axis=-1) * shown[part])
    return largest


def _several_rays(batch: BrickBatch, order: UInt32, view: View, at: Int64, across: int, fields: Fields) -> Float64:
    """[n, across^2, 4]: the rays of pixels at rows and columns `at` [n, 2], row by row.

    Those of one row are lower by a step of a ray's width from one to the next, and those of one column further left.
    """
    inside = np.arange(across)
    centres = (inside + 0.5) / across
    shifts = (centres - 0.5) / across
    lattice = across * at[:, None, None, :] + np.stack(np.meshgrid(inside, inside, indexing="ij"), axis=-1)
    x = at[:, None, None, 1] + centres + shifts[:, None]
    y = at[:, None, None, 0] + centres[:, None] - shifts
    rays = _rays(batch.cut.volume, view, lattice[..., 1], lattice[..., 0], x - 0.5, y - 0.5)
    return _radiance(batch, order, rays, fields).reshape(len(at), across**2, 4)


def nudged(batch: BrickBatch, step: float, spread: float) -> BrickBatch:
    """Return a batch whose steps, and whose thresholds for interpolating pixels and for more rays, are changed.

    They are multiplied by `1 + step` and by `1 + spread`.
    """
    screen_sampling = replace(
        batch.screen_sampling,
        difference_threshold=batch.screen_sampling.difference_threshold * (1 + spread),
        contrast_threshold=batch.screen_sampling.contrast_threshold * (1 + spread),
        spread_threshold=batch.screen_sampling.spread_threshold * (1 + spread),
    )
    return replace(batch, steps=batch.steps * (1 + step), screen_sampling=screen_sampling)


def picture_at(
    bricks: Bricks, view: View, tolerance: float, shading: ShadingSpec | None = None, *, every_pixel: bool = True
) -> Float64:
    """Return the picture of bricks at a tolerance, as if voxels were about a pixel wide, by one ray a pixel.

    every_pixel: whether every pixel is drawn; otherwise pixels of smooth regions are interpolated.
    """
    layers, cut = alone(bricks, shading), cut_bricks(bricks, tolerance)
    batch = make_brick_batch(cut, layers, tolerance=tolerance, voxel_px=1.0)
    sampling = batch.screen_sampling
    of_grids = ScreenSampling(sampling.strides, sampling.difference_threshold, sampling.termination_transmittance)
    batch = replace(batch, screen_sampling=ScreenSampling((1,), 0.0, 0.0) if every_pixel else of_grids)
    return rasterize_bricks_reference(batch, visible_bricks(batch, view), view)


def _pixel_grid(size: tuple[int, int], stride: int) -> tuple[Int64, Int64]:
    """Return the columns and the rows of a lattice of pixels, [rows, columns] each.

    Both are multiples of the stride. The last of them may lie outside of the image, so that every pixel of the image is
    a node of the lattice or lies between nodes.
    """
    columns, rows = (stride * np.arange((num - 1 + stride - 1) // stride + 1) for num in size)
    at_columns, at_rows = np.meshgrid(columns, rows)
    return at_columns, at_rows


def _are_alike(nodes: Float64, spread: float) -> Bools:
    """Return, for each square of four neighbouring nodes, whether their colours are alike or linear: [rows, columns].

    nodes: [rows, columns, 4], the RGBA of the nodes of a lattice. A square has the place of its upper left node.
    """
    around = np.pad(nodes, ((1, 1), (1, 1), (0, 0)), mode="edge")
    along_row = np.abs(around[1:-1, :-2] - 2 * nodes + around[1:-1, 2:])
    along_column = np.abs(around[:-2, 1:-1] - 2 * nodes + around[2:, 1:-1])
    bends = np.maximum(along_row, along_column).max(axis=-1)
    ranges = np.ptp(_corners(nodes), axis=0).max(axis=-1)
    return np.asarray((ranges <= spread) | (_corners(bends).max(axis=0) <= spread))


def _corners(nodes: Float64) -> Float64:
    """Return each node, and its neighbours to the right, below, and diagonally below: [4, rows, columns, ...].

    Beyond the last row and column, they are repeated.
    """
    further = np.pad(nodes, ((0, 1), (0, 1)) + ((0, 0),) * (nodes.ndim - 2), mode="edge")
    return np.stack([further[:-1, :-1], further[:-1, 1:], further[1:, :-1], further[1:, 1:]])


def _between(nodes: Float64, stride: int, columns: Int64, rows: Int64) -> Float64:
    """Return the RGBA of some pixels, [..., 4], interpolated bilinearly from a lattice's nodes [rows, columns, 4]."""
    corners = _corners(nodes)[:, rows // stride, columns // stride]
    down, right = (rows % stride / stride)[..., None], (columns % stride / stride)[..., None]
    upper = (1 - right) * corners[0] + right * corners[1]
    lower = (1 - right) * corners[2] + right * corners[3]
    return np.asarray((1 - down) * upper + down * lower)


def _rays(
    volume: Volume, view: View, columns: Int64, rows: Int64, x_px: Float64 | None = None, y_px: Float64 | None = None
) -> _Rays:
    """Return the rays through the centres of pixels, which may lie outside of the image.

    columns, rows: the places of the pixels, [...] each. x_px, y_px: other places of the rays, in pixels from the centre
    of the pixel in the top left corner; columns and rows then choose the jitter alone. The origins of rays lie on the
    plane through the volume's centre that faces the camera, as origins at a distant eye would leave few digits to
    points in the volume. If the centre is behind the eye, the origins lie on the plane through the eye.
    """
    x = ((columns if x_px is None else x_px).ravel() + 0.5 - view.size[0] / 2) / view.scale_px
    y = (view.size[1] / 2 - (rows if y_px is None else y_px).ravel() - 0.5) / view.scale_px
    centre = view.view_from_world(volume.centre)
    depth = max(0.0, -centre[2])
    if view.projection == "perspective":
        directions = np.stack([x, y, np.full_like(x, -1.0)], axis=1)
        origins = depth * directions
    else:
        directions = np.broadcast_to([0.0, 0.0, -1.0], (len(x), 3))
        origins = np.stack([x, y, np.full_like(x, -depth)], axis=1)
    per_depth = np.linalg.norm(directions, axis=1)  # length in the world per depth
    index_from_view = np.linalg.inv(volume.world_from_index[:3, :3]) @ view.axes.T
    return _Rays(
        volume.centre_index + (origins - centre) @ index_from_view.T,
        directions / per_depth[:, None] @ index_from_view.T,
        (view.near - depth) * per_depth,
        _phases(columns.ravel(), rows.ravel()),
    )


def _phases(columns: Int64, rows: Int64) -> Float64:
    """Return the phases of the rays of pixels, [n]: multiples of 2^-24 from 0 to 1."""
    whole = columns * JITTER_PER_PX[0] + rows * JITTER_PER_PX[1] & 0xFFFFFFFF
    return np.asarray((whole >> 8) / 2.0**24)


def _radiance(batch: BrickBatch, order: UInt32, rays: _Rays, fields: Fields) -> Float64:
    """Return the RGBA of rays, [n, 4], through the bricks in this order.

    fields: the fields that earlier calls with this batch have made, by level; this call adds to them.
    """
    total = np.zeros((len(rays.starts), 4))
    for brick in order:
        enter, leave = _span(rays, batch.cut.visible_bounds[brick])
        is_hit = (enter < leave) & (1 - total[:, 3] >= batch.screen_sampling.termination_transmittance)
        if is_hit.any():
            level = int(batch.cut.levels[brick])
            if level not in fields:
                fields[level] = _mean_field(_layer_of(batch).bricks, level) if level else _scalar_field(batch)
            of_brick = _of_brick(batch, int(brick), fields[level], rays[is_hit], (enter[is_hit], leave[is_hit]))
            total[is_hit] += (1 - total[is_hit, 3:]) * of_brick
    return total


def _layer_of(batch: BrickBatch) -> BrickLayer:
    (layer,) = batch.bricks.layers
    assert layer.weight == 1.0 and not batch.bricks.clip
    return layer


def _span(rays: _Rays, box: Float64) -> tuple[Float64, Float64]:
    """Return the lengths along rays at which they enter and leave a box, [n] each.

    If a ray misses the box, the first length is not below the second. A ray that runs within a face of boxes belongs to
    the box above the face.
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


def _of_brick(batch: BrickBatch, brick: int, field: Float64, rays: _Rays, segment: tuple[Float64, Float64]) -> Float64:
    """Return the RGBA of rays through a brick, [n, 4].

    field: the field of the brick's level. segment: the lengths at which rays enter and leave the brick, [n] each.
    """
    level, (enter, leave) = int(batch.cut.levels[brick]), segment
    length = np.linalg.norm(rays.directions, axis=1) * (leave - enter) / 2**level  # length in cells
    spread = 1 + DITHER * (rays.phases - 0.5)
    num_parts = np.maximum(1, np.floor(length / batch.steps[brick] * spread + 0.5 + rays.phases))
    num_parts += num_parts % 4 == 0
    part = (leave - enter) / num_parts
    number = np.arange(num_parts.max())
    is_part = number < num_parts[:, None]
    rays_of, numbers = np.nonzero(is_part)
    index = rays[rays_of].at(enter[rays_of] + (numbers + 0.5) * part[rays_of])
    channels = np.zeros((*is_part.shape, 4))
    texels = _trilinear(field, (index + 0.5) / 2**level)
    channels[is_part] = (texels if level else _classified(batch, texels)) / batch.cut.volume.finest_spacing
    total = np.zeros((len(enter), 4))
    for k in range(len(number)):
        tau = channels[:, k, 3:]
        color = np.divide(channels[:, k, :3], tau, out=np.zeros((len(tau), 3)), where=tau > 0)
        alpha = -np.expm1(-tau * part[:, None])
        total += (1 - total[:, 3:]) * np.hstack([alpha * color, alpha])
    return total


def _scalar_field(batch: BrickBatch) -> Float64:
    """Return the scalars relative to their range, [z + 2, y + 2, x + 2, 1], with the nearest voxels around the volume.

    With shading, it is [..., 4]: after each scalar comes a gradient in the world, of which only the direction counts.
    All numbers are rounded to float32, the precision in which bricks are stored.
    """
    bricks = _layer_of(batch).bricks
    halves = bricks.volume.values.astype(np.float64) / 2  # differences of halves are finite
    first, last = (end / 2 for end in bricks.scalar_range)
    limit = MAX_NORMALIZED_SCALAR
    channels = [np.clip((halves - first) / (last - first), -limit, limit)[..., None]]
    if _layer_of(batch).shading is not None:
        world_from_index = bricks.volume.world_from_index[:3, :3]
        channels.append(index_gradients(halves) @ np.linalg.inv(world_from_index))
    around = [(1, 1), (1, 1), (1, 1), (0, 0)]
    return np.pad(np.concatenate(channels, axis=-1), around, mode="edge").astype(np.float32).astype(np.float64)


def index_gradients(scalars: Float64) -> Float64:
    """Return gradients [z, y, x, 3], along x, y, z: central differences, one-sided at the border.

    Along an axis with a single voxel, gradients are 0. They are divided by the largest difference of two scalars.
    """
    scaled = scalars / (np.ptp(scalars) or 1.0)
    along = [np.gradient(scaled, axis=axis) if n > 1 else np.zeros_like(scaled) for axis, n in enumerate(scaled.shape)]
    return np.stack(along[::-1], axis=-1)


def _mean_field(bricks: Bricks, level: int) -> Float64:
    """Return (tau c, tau) times the finest spacing at the centres of cells, [z + 2, y + 2, x + 2, 4].

    If the border of the volume cuts a cell, its mean belongs to the middle of the part inside the volume. From there,
    the field is linear to the cell before, and to one cell beyond the border, as `renderer.bricks.texels` says.
    """
    field = _cell_means(bricks, level)
    lighting = bricks.pyramid.classifier.lighting
    brightest = max(1.0, bricks.transfer.colors.max() * (lighting.light[3] + lighting.light[4] if lighting else 1))
    for axis in (2, 1, 0):
        rows = np.moveaxis(field, axis, 0)
        last, before = rows[-1], rows[max(len(rows) - 2, 0)]
        share = bricks.volume.values.shape[axis] / 2**level - len(rows) + 1
        slope = 2 * (last - before) / (1 + share)
        beyond = _held(last + slope * (3 - share) / 2, brightest)
        rows = np.concatenate([rows[:-1], [_held(last + slope * (1 - share) / 2, brightest) if share < 1 else last]])
        first = _held(2 * rows[0] - rows[min(1, len(rows) - 1)], brightest)
        field = np.moveaxis(np.concatenate([[first], rows, [beyond]]), 0, axis)
    return field


def _held(channels: Float64, brightest: float) -> Float64:
    """Return (tau c, tau), held to at least 0, and to colours of at most `brightest` plus a rounding of 11 bits."""
    depths = np.maximum(channels[..., 3:], 0.0)
    return np.concatenate([np.clip(channels[..., :3], 0.0, depths * brightest * (1 + 2.0**-9)), depths], axis=-1)


def _cell_means(bricks: Bricks, level: int) -> Float64:
    """Return the means of the classified voxels of each cell, [z, y, x, 4], rounded as they are stored."""
    pyramid = bricks.pyramid
    scalars = bricks.volume.values.astype(np.float64)
    colors, extinctions = bricks.transfer.classify(scalars)
    lighting = pyramid.classifier.lighting
    if lighting is not None:
        shading = ShadingSpec(*lighting.light[3:], tuple(lighting.light[:3].tolist()))
        gradients = index_gradients(scalars / 2) @ np.linalg.inv(bricks.volume.world_from_index[:3, :3])
        colors = colors * light_factor(shading, gradients.reshape(-1, 3)).reshape(*scalars.shape, 1)
    weights = extinctions[..., None] * bricks.volume.finest_spacing
    if pyramid.max_depth is not None:  # the pyramid averages opacities in place of extinctions
        weights = -np.expm1(-weights)
    weights = np.where(weights < VISIBILITY_THRESHOLD, 0.0, weights)
    means = means_over_cells(np.concatenate([colors * weights, weights], axis=-1), level)
    if pyramid.max_depth is not None:
        with np.errstate(divide="ignore"):
            depths = np.minimum(-np.log1p(-means[..., 3:]), pyramid.max_depth)
        means *= np.divide(depths, means[..., 3:], out=np.ones_like(depths), where=means[..., 3:] > 0)
    stored = (means / pyramid.mean_unit).astype(np.float32).astype(pyramid.levels[0].means.dtype)
    return np.asarray(stored.astype(np.float64) * pyramid.mean_unit)


def _trilinear(field: Float64, at: Float64) -> Float64:
    """Return a field [z + 2, y + 2, x + 2, k], interpolated trilinearly at some points: [n, k].

    at: the points (x, y, z), [n, 3], in cells from the volume's lowest corner.
    """
    place = at + 0.5  # index 1 of `field` is the centre of the first cell
    low = np.clip(np.floor(place).astype(int), 0, np.array(field.shape[2::-1]) - 2)
    share = place - low
    total = np.zeros((len(at), field.shape[-1]))
    for corner in product((0, 1), repeat=3):
        x, y, z = (low + corner).T
        total += np.prod(np.where(corner, share, 1 - share), axis=1)[:, None] * field[z, y, x]
    return total


def _classified(batch: BrickBatch, texel: Float64) -> Float64:
    """Return (tau c, tau) times the finest spacing, [n, 4].

    texel: interpolated texels, [n, 1] or [n, 4]: a scalar relative to its range or, with shading, also its gradient.
    """
    rows = _layer_of(batch).bricks.pieces.rows
    k = np.searchsorted(rows[:, 0], texel[:, 0], side="right")
    offset = (texel[:, 0] - rows[k, 1])[:, None]
    channels = rows[k, 4:8] + offset * rows[k, 8:].astype(np.float64)
    if (shading := _layer_of(batch).shading) is not None:
        channels[:, :3] *= light_factor(shading, texel[:, 1:])[:, None]
    return np.hstack([channels[:, :3] * channels[:, 3:], channels[:, 3:]])


def light_factor(shading: ShadingSpec, gradient: Float64) -> Float64:
    """Return the factors on colours by Lambert's law, [n].

    gradient: gradients in the world, [n, 3]. The lit surface faces against its gradient.
    """
    length = np.linalg.norm(gradient, axis=1)
    toward_light = -gradient @ (np.array(shading.light) / np.linalg.norm(shading.light))
    cosine = np.divide(toward_light, length, out=np.zeros_like(length), where=length > 0)
    return np.asarray(shading.ambient + shading.diffuse * np.maximum(0.0, cosine))
