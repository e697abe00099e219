"""Records that kernels take: the structs of the headers `sources/*/kernels.h` that are members of others.

`tests/support/kernel_records.py` makes this file from the headers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Voxels(NamedTuple):
    """The voxels of a volume, as kernels read them into bricks."""

    # [z, y, x]: as `raw_voxels` returns them (renderer/transfer/classify.py).
    raw: NDArray[Any]
    # [patterns]: the scalar of each bit pattern; None where voxels are scalars themselves.
    scalars: NDArray[np.float64] | None
    # Whether any voxel has no data.
    has_absent: bool
    # Whether scalars are numbers of labels.
    is_labels: bool


class Grid(NamedTuple):
    """A grid of pixels into which bricks are drawn, in tiles (renderer/draw/bricks/grid.py)."""

    # The side of a tile, in pixels of the grid.
    side: int
    # The pixels of the grid are every `stride`-th pixel along both axes. Grid pixel 0 is the centre of pixel 0.
    stride: int
    # [n, 4]: left, top, right and bottom of each brick, half-open, in pixels of the grid and inside it.
    rectangles: NDArray[np.int64]
    # [tiles + 1]: the bricks over tile k are `numbers[starts[k] : starts[k + 1]]`, front to back.
    starts: NDArray[np.int64]
    numbers: NDArray[np.int64]
    # [rows, columns]: the pixels of the grid that are drawn.
    is_drawn: NDArray[np.bool]
    # [rows, columns, 4]: premultiplied RGBA.
    image: NDArray[np.float32]


class Shading(NamedTuple):
    """The coefficients of a light, as in ShadingSpec (renderer/scene/shading_section.py)."""

    ambient: float
    diffuse: float
    specular: float
    shininess: float
    silhouette: float
    two_sided: bool


class Light(NamedTuple):
    """Light and extinction that depend on the view or on the length of the gradient."""

    shading: Shading
    # The share of the light that reaches each place.
    grid: LightGrid
    # Whether the light comes from the viewer, and not from `toward`.
    is_camera: bool
    # The unit vector to the light, in world axes.
    toward: NDArray[np.float64]
    # [3, 3]: from directions in index space to the world; a common factor does not matter.
    world_from_index: NDArray[np.float64]
    # [n, 3]: a gradient's length in texels, the factor on extinction there, and its slope up to the next one.
    factors: NDArray[np.float32]
    # The place of the volume's centre in `grid` (x, y, z), in cells.
    first_cell: NDArray[np.float64]


class FieldMask(NamedTuple):
    """A mask of a field."""

    # For places relative to the volume's centre.
    grid: MaskGrid
    # [bricks]: whether a part of the brick is outside of the mask.
    are_cut: NDArray[np.bool]


class Field(NamedTuple):
    """The field of a layer: the texels of all bricks, in two atlases, and the table that classifies them."""

    # Of each brick of voxels PADDED_BRICK_SIZE^3 texels; with light, PADDED_BRICK_SIZE^3 gradients (x, y, z) follow.
    # Where voxels are colours, (tau c, tau) of each.
    scalars: NDArray[np.float32]
    # Of each brick of means PADDED_BRICK_SIZE^3 texels (tau c, tau).
    means: NDArray[np.float32]
    # [bricks]: the first texel of each brick in its atlas; -1 where it shows none.
    texel_offsets: NDArray[np.int64]
    pieces: PiecewiseTransfer
    # A factor on extinction.
    weight: float
    # The unit vector to the light (x, y, z), ambient and diffuse; used if `is_lit`.
    lambert: NDArray[np.float64]
    # Whether any voxel has no data.
    has_absent: bool
    # Whether scalars are numbers of labels.
    is_labels: bool
    # Whether voxels are colours.
    has_colors: bool
    # Whether the light follows Lambert's law alone, from a fixed direction.
    is_lit: bool
    # Whether faces that clipping cuts are lit by their own normal.
    lights_faces: bool
    # None without a light, or by Lambert's law alone.
    light: Light | None
    # None without a mask.
    mask: FieldMask | None


class LayerBricks(NamedTuple):
    """The bricks of layers on one grid of voxels."""

    rays: RaySetup
    # Finest spacings in a model unit.
    spacings_per_model_unit: float
    # [bricks, 11]: as in BrickView (renderer/draw/bricks/brick_cache.py).
    boxes: NDArray[np.float64]
    # [bricks]: whether the texels of the brick are means. The means of all layers are in the first field, with their
    # weights.
    is_mean: NDArray[np.bool]
    # [bricks]: whether the brick is near a face that clipping cuts.
    have_faces: NDArray[np.bool]
    # The distance from such a face up to which it is lit by its own normal, a length in the world.
    face_depth: float
    # One of each layer.
    fields: Sequence[Field]


class SearchRules(NamedTuple):
    """The rules of a search for the most extreme scalar, the same in all bricks.

    A texel u stands for the number `offset + slope * u`, whose maximum is sought: it is 0 where a scalar is as good as
    none, and 1 at the other end of the colours.
    """

    offset: float
    slope: float
    # A number counts if it exceeds the largest one that was found by this.
    slack: float
    # A number takes the place of the largest one if it exceeds it by this.
    min_rise: float
    # A ray ends at this number.
    ceiling: float
    # Whether the bounds of bricks fall; otherwise they come front to back.
    is_sorted: bool
    # Whether any voxel has no data.
    has_absent: bool
    # The rise of nearness by a step along each index axis; 0 where depth does not count. Nearness falls from 1 to 0
    # through the ball around the volume.
    forward: NDArray[np.float64]


class VisibleNodes(NamedTuple):
    """Room for the visible nodes of some groups: for each level of all groups, one level behind the other.

    A level's visible nodes are at its beginning, in Morton order.
    """

    # [n, 4]: the means.
    means: NDArray[np.float32]
    # [n]: the roots of variances, which are summed over channels.
    deviations: NDArray[np.float32]
    # [n]: as in Level (renderer/pyramid/pyramid.py); not of the first level of blocks.
    masks: NDArray[np.uint8]
    # [n, 3]: the nodes (x, y, z); empty if not asked for.
    cells: NDArray[np.int32]
    # [n]: their numbers of voxels; empty if not asked for.
    sizes: NDArray[np.int64]
    # [3]: the number of visible nodes of each level.
    counts: NDArray[np.int64]
    # [groups, 4]: the mean of each group's root, visible or not.
    root_means: NDArray[np.float32]
    # [groups, channels]: the means of the channels that errors are measured on, of the roots.
    root_error_means: NDArray[np.float64]
    # [groups, channels]: the variances of the same.
    root_variances: NDArray[np.float64]


class TransferTable(NamedTuple):
    """A table of four channels as a function of a scalar: linear between control values, constant outside.

    Two control points at one value are a step, whose value belongs to the upper side.
    """

    # [n]: control values, not descending.
    values: NDArray[np.float64]
    # [n + 1, 10]: of each segment its start, its width, the channels [4] at the start, and their rise [4]. Segment k
    # holds the scalars from control value k - 1 to control value k; the first and the last are constant. Starts and
    # widths are multiplied by `scale`.
    rows: NDArray[np.float64]
    # A power of two with which differences of scalars are finite.
    scale: float
    # [GUIDE_SIZE + 3]: from guide[b] to guide[b + 3] control values are at or below a scalar in bucket b.
    guide: NDArray[np.uint64]
    # Buckets of the guide per unit of the scaled scalar.
    buckets_per_unit: float


class LightGrid(NamedTuple):
    """A grid of factors on light, from 0, dark, to 1, at the centres of cells, between which they are linear."""

    # [z + 2, y + 2, x + 2]: factors on the ambient light, in steps of 1 / 255; [0, 0, 0] if not asked for. They are 1
    # where neither a cell nor a neighbour of it shows anything.
    occlusion: NDArray[np.float32]
    # [z + 2, y + 2, x + 2]: the same on the diffuse light.
    shadow: NDArray[np.float32]
    # For each cell the factors that are there, each in two numbers: 255 times the factors at the cell and at its
    # neighbours, eight bytes, x before y before z. Two numbers follow.
    corners: NDArray[np.int32]
    # The width of a cell, in voxels. Cells begin at the corner of the first voxel.
    cell_size: float
    # From 0 to 1: how much of the factors on the ambient light applies.
    occlusion_strength: float
    # From 0 to 1: how much of the factors on the diffuse light applies.
    shadow_strength: float


class VoxelLighting(NamedTuple):
    """A light on voxels."""

    # The unit vector towards the light in world axes, ambient, diffuse.
    light: NDArray[np.float64]
    # [3, 3]: from a gradient along the index axes to the world.
    world_from_gradient: NDArray[np.float64]
    # The share of the light that reaches each voxel; NO_LIGHT_GRID where all of it does.
    grid: LightGrid


class Classifier(NamedTuple):
    """A set of tables with which kernels classify a voxel (renderer/transfer/classify.py)."""

    # [patterns, 4]: channels by bit pattern; None for wider values.
    table: NDArray[np.float32] | None
    # [patterns]: the scalar of each bit pattern; None for wider values.
    scalars: NDArray[np.float64] | None
    # The transfer function, extinctions times the finest spacing; None where `table` is used.
    curve: TransferTable | None
    # Whether the channels are (a c, a), and not (tau c, tau).
    is_opacity: bool
    # None without shading.
    lighting: VoxelLighting | None
    # The visibility breakpoints (renderer/transfer/transfer_function.py).
    breakpoints: NDArray[np.float64]
    # [z, y, x, 3]: colours of voxels, factors on the transfer function's colours; None for white.
    colors: NDArray[np.uint8] | None
    # [z, y, x]: 0 for voxels that a mask hides; None without a mask.
    shown: NDArray[np.uint8] | None


class PiecewiseTransfer(NamedTuple):
    """A table of colour and extinction by u, a scalar normalized to a range: 0 is its start and 1 its end."""

    # [n, PIECE_FLOATS]: of each segment its end, its origin, the extinction times the finest spacing there and its
    # slope; (r, g, b, the same extinction) at the origin; and their slopes. Segment k holds u from the end of the one
    # before, included, to its own end, excluded; the last end is infinite. Kernels read rows in fours.
    rows: NDArray[np.float32]
    # [GUIDE_SIZE]: from u = b / GUIDE_SIZE on the segment is guide[b] or later. For u < 0 it is the first.
    guide: NDArray[np.int32]
    # Below this u nothing is visible.
    lowest_visible: float


class Intervals(NamedTuple):
    """A transfer function of n control values as n + 1 intervals, the first and last of them unbounded."""

    # [n]: control values times `scale`, not descending. Interval k has knots[k - 1] <= value < knots[k]: the value of
    # a step belongs to its upper side.
    knots: NDArray[np.float64]
    # [n + 1, 10]: base [4], slope [4], origin and the number of the first k control points that have extinction:
    # (r, g, b, extinction) of a value is base + slope * (value - origin).
    rows: NDArray[np.float64]
    # Of scalars and knots: a power of two with which sums and differences neither overflow nor vanish.
    scale: float


class RayShading(NamedTuple):
    """The light on rays, of scalars that are multiplied by `Intervals.scale`."""

    # Whether Lambert's law is all, so that highlights, silhouettes, factors and the grid do not count.
    is_plain: bool
    # Whether the light comes from the viewer.
    is_camera: bool
    # As in ShadingSpec (renderer/scene/shading_section.py), and so are the next five.
    two_sided: bool
    ambient: float
    diffuse: float
    specular: float
    shininess: float
    silhouette: float
    # The distance from cut faces up to which they are lit by their own normal, a length in the world.
    face_depth: float
    # The unit vector to the light, in world axes; not used where the light comes from the viewer.
    light: NDArray[np.float64]
    # [3, 3]: from positions in index space to the world.
    world_from_index: NDArray[np.float64]
    # [3, 3]: from gradients along the index axes to the world.
    world_from_gradient: NDArray[np.float64]
    # [n, 3]: a gradient's magnitude, times `Intervals.scale`, the factor on extinction there and its slope up to the
    # next one.
    factors: NDArray[np.float64]
    # The share of the light that reaches each place.
    grid: LightGrid


class RemovedSet(NamedTuple):
    """A convex set that is clipped away: the points from `low` to `high` in axes of its own, in world lengths.

    A half-space has one axis, the first, and the others are 0.
    """

    # [3, 4]: from index space to the axes of the set.
    own_from_index: NDArray[np.float64]
    # [3, 3]: from directions along these axes to the world.
    world_from_own: NDArray[np.float64]
    # The lowest corner.
    low: NDArray[np.float64]
    # The highest corner.
    high: NDArray[np.float64]


class IndexRays(NamedTuple):
    """A set of n rays in index space, and their parts that are neither clipped away nor masked."""

    # [n, 3]: positions (x, y, z), in voxels.
    origins: NDArray[np.float64]
    # [n, 3]: of unit length in the world.
    directions: NDArray[np.float64]
    # [n, k, 2]: world lengths from the origin at which parts start and end, one behind the other; some are empty.
    parts: NDArray[np.float64]
    # The sets that are clipped away, where their faces are lit; none otherwise.
    removed: Sequence[RemovedSet]


class LayerOptics(NamedTuple):
    """A layer: the values of a volume, and how they are shown."""

    # [z, y, x]: the values.
    values: NDArray[Any]
    # [z, y, x]: the state of each macrocell; 0, unknown, at first, and updated, for calls with the same values and
    # intervals.
    macrocells: NDArray[np.uint8]
    intervals: Intervals
    # None without a light.
    shading: RayShading | None
    # A factor on extinction.
    weight: float
    # [z, y, x, 3]: colours of voxels, factors on the transfer function's colours; None for white.
    colors: NDArray[np.uint8] | None
    # [labels]: the opacity of a voxel of each label, by its number; numbers above have the last one. None where values
    # are not labels.
    label_opacities: NDArray[np.float64] | None


class ClipRegion(NamedTuple):
    """A region that clip planes and boxes leave: the points p of a volume in all slabs and in no removed box.

    A slab is [8]: a normal n [3], bounds of n . p, a length, with p in index space relative to the volume's centre, and
    n as a unit vector [3] in the world.
    """

    # [k, 8]: the slab of a plane is unbounded on one side.
    slabs: NDArray[np.float64]
    # [m, 3, 8]: of each removed box the slabs across its axes.
    boxes: NDArray[np.float64]


class RaySetup(NamedTuple):
    """The rays of a view in the grid of a volume.

    With (x, y) the position of a pixel's centre in pixels, y downwards, relative to `center_px`:

        origin = origins @ (1, x, y)        direction = directions @ (1, x, y)
    """

    # [3, 3]: index space relative to the volume's centre.
    origins: NDArray[np.float64]
    # [3, 3]: index units per model unit of depth in perspective, per model unit of length otherwise.
    directions: NDArray[np.float64]
    # A ray's length per unit of depth is `sqrt(1 + slope_per_px^2 (x^2 + y^2))`.
    slope_per_px: float
    # The near plane, in model units along the direction.
    start: float
    # The image's centre (x, y).
    center_px: NDArray[np.float64]
    # The rest of the volume, if the view clips it.
    clip: ClipRegion | None


class ModelView(NamedTuple):
    """A view in model units."""

    # [3, 4]: rotation and translation, model units.
    view_from_model: NDArray[np.float64]
    # Whether the projection is in perspective; orthographic otherwise.
    perspective: bool
    # Focal length in pixels (perspective), pixels per model unit (orthographic).
    scale_px: float
    # The image's width and height.
    size: tuple[int, int]
    # The depth of the near plane, in model units.
    near: float
    # Bounds on |x| / depth and |y| / depth where footprints are linearised.
    slope_limit: NDArray[np.float64]


class MaskGrid(NamedTuple):
    """A mask on a grid of its own."""

    # [z, y, x]: which of the nine voxels around each in its plane are in the mask, a bit each, x fastest; beyond the
    # border the nearest voxels are repeated.
    planes: NDArray[np.uint16]
    # [3, 4]: from places in the index space of another volume to places in the mask's.
    from_index: NDArray[np.float64]
