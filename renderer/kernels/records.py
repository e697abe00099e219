"""Records that kernels take: the structs of the headers `sources/*/kernels.h` that are members of others.

`tests/support/kernel_records.py` makes this file from the headers.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray


class Voxels(NamedTuple):
    """The voxels of a volume, from which kernels make bricks."""

    # [z, y, x]: the voxels of the volume; those of at most 16 bits as unsigned bit patterns (`raw_voxels` in
    # renderer/transfer/classify.py).
    raw: NDArray[Any]
    # [patterns]: the scalar of each bit pattern; None if the voxels themselves are scalars.
    scalars: NDArray[np.float64] | None
    # Whether the volume has voxels without data.
    has_absent: bool
    # Whether the scalars are numbers of labels.
    is_labels: bool


class VoxelTexels(NamedTuple):
    """The form of texels that are voxels. The bit of their sign is inverted, so that texels ascend as scalars do."""

    # The size of a voxel, 1 or 2.
    num_bytes: int
    # The bit of the sign in a voxel, which texels have inverted; 0 if voxels have no sign.
    sign_bit: int
    # The scalar of texel 0; those of other texels follow it, one by one.
    lowest: int
    # The normalized scalar of a texel is its scalar less the first one of TexelRules, times this, rounded to float32.
    slope: float


class TexelRules(NamedTuple):
    """The rules by which the texels of bricks of level 0 are made (renderer/bricks/texels.py)."""

    voxels: Voxels
    # The scalar whose texel is 0: the start of the range to which scalars are normalized.
    first: float
    # The width of the range of scalars, multiplied by `factor`, as `range_width` returns it.
    width: float
    # The factor on scalars, 1 or 1/2, with which their differences do not overflow.
    factor: float
    # [3, 3]: the matrix from gradients along the index axes to world axes; its largest entry is 1.
    world_from_gradient: NDArray[np.float64]
    # A power of two by which scalars are multiplied for gradients, so that no difference of two scalars overflows.
    scale: float
    # The direction (x, y, z), a unit vector, to which the normals of labels are turned a little; zeros to turn none.
    toward_light: NDArray[np.float64]
    # [labels]: the opacity of a voxel of each label, by the label's number.
    opacities: NDArray[np.float64]
    # Whether samples have gradients. They follow the scalars of a brick, or are made from texels that are voxels.
    is_lit: bool
    # The form of texels that are voxels; None if texels are float32.
    voxel_texels: VoxelTexels | None


class Grid(NamedTuple):
    """A grid of rays into which bricks are drawn, in tiles (renderer/draw/bricks/grid.py)."""

    # The side of a tile, in rays; a multiple of `rays_across`.
    side: int
    # The pixels of the grid are every `stride`-th pixel of the picture along both axes, from pixel 0 on.
    stride: int
    # The number of rays along each side of a pixel.
    rays_across: int
    # Whether the only ray of a pixel passes through a random place in it, and not through its middle.
    is_scattered: bool
    # The row of the picture that is the first row of the grid.
    first_row: int
    # The number of rows and of columns of pixels.
    shape: tuple[int, int]
    # [n, 4]: left, top, right and bottom of each brick, half-open, counted in rays of the grid and clipped to it.
    rectangles: NDArray[np.int64]
    # [tiles + 1]: the bricks over tile k are `numbers[starts[k] : starts[k + 1]]`.
    starts: NDArray[np.int64]
    # The numbers of the bricks over tiles, tile by tile, in draw order.
    numbers: NDArray[np.int64]
    # [rows, columns]: the index in `rays` of each pixel's first ray, or -1 if the pixel is not drawn; None if pixel k
    # has ray k alone.
    places: NDArray[np.int32] | None
    # [rays, 4]: premultiplied RGBA of the rays, or other amounts that they gather.
    rays: NDArray[np.float32]


class Shading(NamedTuple):
    """The coefficients of a light, as in ShadingSpec (renderer/scene/shading_section.py)."""

    ambient: float
    diffuse: float
    specular: float
    shininess: float
    silhouette: float
    two_sided: bool


class Light(NamedTuple):
    """The light on a layer and factors on its extinction, if these depend on the view or on the gradient's length."""

    shading: Shading
    # The share of the light that reaches each position.
    grid: LightGrid
    # Whether the light comes from the viewer, and not from `toward`.
    is_camera: bool
    # The unit vector towards the light, in world axes; unused if the light comes from the viewer.
    toward: NDArray[np.float64]
    # [3, 3]: the matrix from directions in index space to the world, up to a common factor.
    world_from_index: NDArray[np.float64]
    # [n, 3]: the length of a gradient between texels, the factor on extinction at this length, and the slope of the
    # factor up to the next row's length.
    factors: NDArray[np.float32]
    # The position of the volume's centre in `grid` (x, y, z), in cells.
    first_cell: NDArray[np.float64]
    # The change over the finest spacing, in texels, along a gradient of the length 1 between texels; of labels, in
    # smoothed opacities.
    change_per_length: float


class FieldMask(NamedTuple):
    """The mask that limits where a field is drawn: a volume of labels."""

    # The mask's grid, for positions relative to the centre of the field's volume.
    grid: MaskGrid
    # [bricks]: whether a part of a brick is outside the mask.
    are_cut: NDArray[np.bool]


class AtlasTexels(NamedTuple):
    """The texels of bricks in an atlas. Missing texels of bricks of voxels are made when a ray first meets their brick
    (atlas.h).
    """

    # For each brick of voxels, PADDED_BRICK_SIZE^3 texels; if the layer is lit, PADDED_BRICK_SIZE^3 gradients (x, y, z)
    # follow them. If voxels are colours, each texel is (tau c, tau). If texels are voxels, it has their bytes.
    texels: NDArray[np.float32]
    # [bricks]: the position of each brick's first texel in its atlas; -1 for a brick that shows nothing, -2 for one
    # whose texels are missing. Kernels write the positions of the texels that they make.
    offsets: NDArray[np.int64]
    # The rules by which texels are made; None if kernels do not make them.
    rules: TexelRules | None
    # [bricks, 3]: the place (x, y, z) of each brick, in widths of a brick.
    cells: NDArray[np.int32]
    # [n]: the positions in `texels` for missing bricks, which are taken in this order. There may be fewer than bricks.
    free: NDArray[np.int64]
    # [1]: the number of positions of `free` that are taken; more than there are if a brick found none.
    num_taken: NDArray[np.int64]
    # [bricks]: whether a ray has met each brick. Kernels set it.
    are_met: NDArray[np.bool]


class Field(NamedTuple):
    """The field of a layer: the texels of all bricks, in two atlases, and the table that classifies them."""

    # The texels of bricks of voxels, and the offsets of all bricks, each in its atlas.
    voxels: AtlasTexels
    # For each brick of means, PADDED_BRICK_SIZE^3 texels (tau c, tau).
    means: NDArray[np.float32]
    pieces: PiecewiseTransfer
    # A factor on the layer's extinction.
    weight: float
    # The unit vector towards the light (x, y, z), the ambient and the diffuse coefficient; used if `is_lit`.
    lambert: NDArray[np.float64]
    # Whether the volume has voxels without data.
    has_absent: bool
    # Whether the scalars are numbers of labels.
    is_labels: bool
    # Whether voxels are colours.
    has_colors: bool
    # Whether the light follows Lambert's law alone, from a fixed direction.
    is_lit: bool
    # Whether faces that clipping cuts are lit by their own normals.
    lights_faces: bool
    # The light; None without a light, or if `lambert` is all of it.
    light: Light | None
    # The mask that limits the field; None without a mask.
    mask: FieldMask | None


class SurfaceCells(NamedTuple):
    """The light on surfaces, as in SurfaceLight (renderer/lighting/scene_light.py)."""

    # The share of light that a surface reflects, from 0 to 1; the remainder is scattered.
    share: float
    # The coefficient and the exponent of highlights.
    specular: float
    shininess: float
    # The unit vector to the middle of the key light, in world axes.
    key: NDArray[np.float64]
    # [rgb]: the irradiance of the key light, divided by pi.
    key_light: NDArray[np.float64]


class RadianceCells(NamedTuple):
    """The mean radiance in matter that scatters light, on a grid over all layers (renderer/lighting/scene_light.py)."""

    # [z, y, x, 4]: the mean radiance (r, g, b) at the middles of cells, and the share of the key light that arrives
    # straight. With surfaces [z, y, x, 16]: then the flux along x (r, g, b), y and z, and three numbers more.
    cells: NDArray[np.float32]
    # The light on surfaces; None if no surface reflects light. Otherwise fields have a light of the viewer, for their
    # gradients.
    surface: SurfaceCells | None
    # [3, 4]: the matrix from positions in index space, relative to the centre of the layers' volume, to cells. The
    # middle of cell i is at i.
    cells_from_index: NDArray[np.float64]


class FogRamp(NamedTuple):
    """The fog in a grid of voxels: the share of its colour, which is linear in the depth (renderer/view/camera.py)."""

    # [rgb]: the colour of the fog.
    color: NDArray[np.float64]
    # The share at the centre of the volume, not limited to numbers from 0 to 1.
    share: float
    # The change of the share per voxel along x, y and z.
    per_index: NDArray[np.float64]


class LayerBricks(NamedTuple):
    """The bricks of layers on one grid of voxels."""

    rays: RaySetup
    # The number of finest voxel spacings in a model unit.
    spacings_per_model_unit: float
    # [bricks, 11]: the boxes of bricks, as in BrickView (renderer/draw/bricks/brick_cache.py).
    boxes: NDArray[np.float64]
    # [bricks]: whether the texels of a brick are means. The first field holds the means of all layers, with the
    # layers' weights.
    is_mean: NDArray[np.bool]
    # [bricks]: whether a brick is near a face that clipping cuts.
    have_faces: NDArray[np.bool]
    # Points up to this distance from a face that clipping cuts, in units of the world, are lit by the face's normal.
    face_depth: float
    # The light by which colours are multiplied, which are then albedos; None if matter does not scatter light.
    radiance: RadianceCells | None
    # The fog; None without fog.
    fog: FogRamp | None
    # One field for each layer.
    fields: Sequence[Field]


class SearchRules(NamedTuple):
    """The rules of a search for the most extreme scalar, which are the same in all bricks.

    A texel u stands for the number `offset + slope * u`, whose maximum is sought: 0 for a scalar that shows nothing,
    and 1 at the other end of the colour range.
    """

    # The number of texel 0.
    offset: float
    # The change of the number with the texel; below 0 to find the smallest scalar.
    slope: float
    # A brick or a cell is searched only if its bound exceeds the largest number so far by more than this.
    slack: float
    # A number replaces the largest number so far only if it exceeds it by more than this.
    min_rise: float
    # The number from which on a ray ends, as it needs no larger one.
    ceiling: float
    # Whether bricks come in the order of falling bounds; otherwise they come front to back.
    is_sorted: bool
    # Whether the volume has voxels without data.
    has_absent: bool
    # The change of nearness over a step along each index axis; zeros if depth does not count. Nearness falls from 1 to
    # 0 through the ball around the volume.
    forward: NDArray[np.float64]


class VisibleNodes(NamedTuple):
    """Arrays for the visible nodes of several groups. A group is 64 nodes, their 8 parents, and one root (groups.h).

    Arrays have room for all nodes of all groups: first the lowest level of every group, then the middle level, then the
    roots. In the room of each level, its visible nodes come first, in Morton order.
    """

    # [n, 4]: the means of the four channels of each node.
    means: NDArray[np.float32]
    # [n]: the standard deviation of each node: the square root of the sum of its channels' variances.
    deviations: NDArray[np.float32]
    # [n]: the masks of visible children, as in Level (renderer/pyramid/pyramid.py); unused for nodes of level 1, whose
    # children are voxels.
    masks: NDArray[np.uint8]
    # [3]: the number of visible nodes on each level, over all groups: of lowest nodes, of parents, and of roots.
    counts: NDArray[np.int64]
    # [groups, 4]: the means of the channels of the root of each group of 73 nodes, visible or not.
    root_means: NDArray[np.float32]
    # [groups, channels]: the means of the root of each group of 73 nodes, in the channels that errors are measured on.
    root_error_means: NDArray[np.float64]
    # [groups, channels]: the variances of the root of each group of 73 nodes, in the channels that errors are measured
    # on.
    root_variances: NDArray[np.float64]


class BrickSums(NamedTuple):
    """Statistics of the nodes of one level, by brick (renderer/bricks/node_statistics.py), which kernels update."""

    # [z, y, x, 3, 3, 3]: for each brick and each neighbour at -1, 0 and 1 along z, y, x, the largest error of the
    # brick's nodes in the neighbour's halo. The middle entry is for all nodes of the brick.
    max_error_by_neighbour: NDArray[np.float64]
    # [z, y, x, 3, 3, 3, 2, 3]: the bounds of the visible ones among these nodes: the lowest place (x, y, z) in the
    # brick, and one above the highest place; BRICK_SIZE and 0 if no node is visible.
    bounds_by_neighbour: NDArray[np.uint8]
    # [z, y, x]: the largest error of the nodes in each brick of the level below, half as wide.
    max_error_below: NDArray[np.float64]
    # [z, y, x]: for each brick of the level below, the sum of squared errors of its nodes, weighted by their numbers of
    # voxels, and divided by the square of the largest error.
    squared_errors_below: NDArray[np.float64]


class StreamedLevel(NamedTuple):
    """A level whose nodes are added to statistics, and not stored. The statistics are those of nodes as they would be
    stored: of rounded errors, and of means that are not rounded to 0.
    """

    # The statistics to which the visible nodes of the level are added.
    sums: BrickSums
    # The factor from the root of a variance to an error in stored units: a power of two.
    error_factor: float
    # Whether errors are rounded to float16.
    is_half: bool
    # [n + 1]: the factor from an error in stored units to an error in the measure's unit, for each number of voxels of
    # a node.
    error_scales: NDArray[np.float64]
    # The largest mean extinction or opacity of a node that rounds to 0.
    most_invisible: float


class TransferTable(NamedTuple):
    """A table of four channels as a function of a scalar: linear between control values, constant outside.

    Two control points at one value are a step, whose value belongs to the upper side.
    """

    # [n]: the control values, ascending; equal ones are a step.
    values: NDArray[np.float64]
    # [n + 1, 10]: for each segment its start, its width, the channels [4] at the start, and their rise [4]. Segment k
    # holds the scalars from control value k - 1 to control value k; the first and the last segment are constant.
    # Starts and widths are multiplied by `scale`.
    rows: NDArray[np.float64]
    # A power of two by which scalars are multiplied, so that their differences are finite.
    scale: float
    # [GUIDE_SIZE + 3]: a guide to the segments. The range of the control values is divided into GUIDE_SIZE equal
    # buckets. For a scalar in bucket b, from guide[b] to guide[b + 3] control values are at or below the scalar.
    guide: NDArray[np.uint64]
    # The number of buckets of the guide per unit of a scalar multiplied by `scale`.
    buckets_per_unit: float


class LightGrid(NamedTuple):
    """A grid of factors on light, from 0 (dark) to 1. Factors are given at the centres of cells and are linear between
    them.
    """

    # [z + 2, y + 2, x + 2]: factors on the ambient light, in steps of 1 / 255; [0, 0, 0] if the scene asks for no
    # occlusion. A factor is 1 if neither the cell nor a neighbour shows anything.
    occlusion: NDArray[np.float32]
    # [z + 2, y + 2, x + 2]: factors on the diffuse light, in steps of 1 / 255; [0, 0, 0] if the scene asks for no
    # shadows. A factor is 1 if neither the cell nor a neighbour shows anything.
    shadow: NDArray[np.float32]
    # For each cell and each kind of factor that the scene asks for, two numbers. Their eight bytes are 255 times the
    # factors at the cell and at its next neighbours along x, y and z, x fastest. Two more numbers follow the last
    # cell.
    corners: NDArray[np.int32]
    # The width of a cell of the light grid, in voxels. Cells begin at the corner of the first voxel.
    cell_size: float
    # From 0 to 1: how much of the factors on the ambient light applies.
    occlusion_strength: float
    # From 0 to 1: how much of the factors on the diffuse light applies.
    shadow_strength: float


class VoxelLighting(NamedTuple):
    """A light on voxels, by Lambert's law."""

    # The unit vector towards the light in world axes, then the ambient and the diffuse coefficient.
    light: NDArray[np.float64]
    # [3, 3]: the matrix from gradients along the index axes to the world.
    world_from_gradient: NDArray[np.float64]
    # The share of the light that reaches each voxel; NO_LIGHT_GRID if all of the light reaches every voxel.
    grid: LightGrid


class Classifier(NamedTuple):
    """The tables with which kernels classify a voxel (renderer/transfer/classify.py)."""

    # [patterns, 4]: the channels of each bit pattern; None for voxels of more than 16 bits.
    table: NDArray[np.float32] | None
    # [patterns]: the scalar of each bit pattern; None for voxels of more than 16 bits.
    scalars: NDArray[np.float64] | None
    # The transfer function, with extinctions multiplied by the finest voxel spacing; None if `table` is used.
    curve: TransferTable | None
    # Whether the channels are (a c, a), with the opacity a and the colour c, and not (tau c, tau), with the extinction
    # tau.
    is_opacity: bool
    # The light on voxels, by which colours are multiplied; None without shading.
    lighting: VoxelLighting | None
    # The scalars, ascending, at which the transfer function changes between invisible and visible
    # (renderer/transfer/transfer_function.py).
    breakpoints: NDArray[np.float64]
    # [z, y, x, 3]: the colours of voxels, which multiply the transfer function's colours; None for white.
    colors: NDArray[np.uint8] | None
    # [z, y, x]: 0 for voxels that a mask hides; None without a mask.
    shown: NDArray[np.uint8] | None


class PiecewiseTransfer(NamedTuple):
    """A table of colour and extinction by u, a scalar normalized to a range: 0 is its start and 1 its end."""

    # [n, PIECE_FLOATS]: for each segment its end and its origin; the extinction at the origin, times the finest voxel
    # spacing, and its slope; (r, g, b, the same extinction) at the origin, and their slopes. Segment k holds u from
    # the end of the segment before, included, to its own end, excluded; the last end is infinite. Kernels read four
    # numbers of a row at a time.
    rows: NDArray[np.float32]
    # [GUIDE_SIZE]: a scalar u >= b / GUIDE_SIZE lies in segment guide[b] or later. A scalar u < 0 lies in the first
    # segment.
    guide: NDArray[np.int32]
    # The normalized scalar u below which no scalar is visible.
    lowest_visible: float
    # [GUIDE_SIZE + 1]: the opacities over OPACITY_SPACINGS of the finest voxel spacing, at u = k / GUIDE_SIZE. They
    # tell surfaces.
    opacities: NDArray[np.float32]


class Intervals(NamedTuple):
    """A transfer function of n control values as n + 1 intervals, the first and last of them unbounded."""

    # [n]: control values times `scale`, not descending. Interval k has knots[k - 1] <= value < knots[k]: the value of
    # a step belongs to its upper side.
    knots: NDArray[np.float64]
    # [n + 1, 10]: for interval k its base [4], slope [4], origin, and how many of the first k control points have
    # extinction. The channels (r, g, b, extinction) of a value are base + slope * (value - origin).
    rows: NDArray[np.float64]
    # A factor on scalars and knots: a power of two with which sums and differences neither overflow nor vanish.
    scale: float


class RayShading(NamedTuple):
    """The light on rays, for scalars that are multiplied by `Intervals.scale`."""

    # Whether the light follows Lambert's law alone; then highlights, silhouettes, factors and the grid are unused.
    is_plain: bool
    # Whether the light comes from the viewer.
    is_camera: bool
    # Whether both sides of a surface are lit, as in ShadingSpec (renderer/scene/shading_section.py).
    two_sided: bool
    # The coefficient of the ambient light, which reaches every point from all sides.
    ambient: float
    # The coefficient of the diffuse light, which is multiplied by the cosine between normal and light.
    diffuse: float
    # The coefficient of the highlight, where a surface mirrors the light.
    specular: float
    # The exponent of the highlight; a larger one makes highlights smaller.
    shininess: float
    # The share of the light that a surface seen edge-on loses, as in ShadingSpec.
    silhouette: float
    # The distance from a cut face up to which points are lit by the face's normal, as a length in the world.
    face_depth: float
    # The unit vector towards the light, in world axes; unused if the light comes from the viewer.
    light: NDArray[np.float64]
    # [3, 3]: the matrix from positions in index space to the world.
    world_from_index: NDArray[np.float64]
    # [3, 3]: the matrix from gradients along the index axes to the world.
    world_from_gradient: NDArray[np.float64]
    # [n, 3]: a gradient's magnitude times `Intervals.scale`, the factor on extinction at this magnitude, and the
    # factor's slope up to the next row.
    factors: NDArray[np.float64]
    # The share of the light that reaches each position.
    grid: LightGrid


class RemovedSet(NamedTuple):
    """A convex set that is clipped away: the points from `low` to `high` in the set's own axes, in world lengths.

    A half-space is bounded along the first axis only; the rows of its other two axes are 0.
    """

    # [3, 4]: the transformation from index space to the set's own axes.
    own_from_index: NDArray[np.float64]
    # [3, 3]: the matrix from directions along the set's own axes to the world.
    world_from_own: NDArray[np.float64]
    # The lowest corner of the set, in its own axes.
    low: NDArray[np.float64]
    # The highest corner of the set, in its own axes.
    high: NDArray[np.float64]


class IndexRays(NamedTuple):
    """A set of n rays in index space, and their parts that are neither clipped away nor masked."""

    # [n, 3]: the origin (x, y, z) of each ray, in voxels.
    origins: NDArray[np.float64]
    # [n, 3]: the direction of each ray, in index space, of unit length in the world.
    directions: NDArray[np.float64]
    # [n, k, 2]: the distances from the origin, in the world, at which the parts of each ray start and end; some parts
    # are empty.
    parts: NDArray[np.float64]
    # The clip sets that are removed, given only if cut faces are lit by their own normals; empty otherwise.
    removed: Sequence[RemovedSet]


class PlacedVoxels(NamedTuple):
    """The voxels of a volume, in any order. The place of a voxel is the sum of a number for each of its coordinates."""

    # [n]: the values of the voxels, at their places.
    values: NDArray[Any]
    # [z], [y], [x]: the numbers of each coordinate, ascending. The sum of the three last ones is below n.
    z: NDArray[np.int64]
    y: NDArray[np.int64]
    x: NDArray[np.int64]


class LayerOptics(NamedTuple):
    """A layer: the values of a volume, and how they are shown."""

    # The voxels of the volume.
    voxels: PlacedVoxels
    # [z, y, x]: the state of each macrocell, a block of 4^3 cells: UNKNOWN (0) at first, then whether it may show
    # anything. The array is updated, and later calls with the same voxels and intervals use it.
    macrocells: NDArray[np.uint8]
    # The transfer function of the layer.
    intervals: Intervals
    # The light on the layer; None without a light.
    shading: RayShading | None
    # The factor on the layer's extinction.
    weight: float
    # [z, y, x, 3]: the colours of voxels, which multiply the transfer function's colours; None for white.
    colors: NDArray[np.uint8] | None
    # [labels]: the opacity of a voxel of each label, by the label's number; larger numbers have the last opacity. None
    # if values are not labels.
    label_opacities: NDArray[np.float64] | None


class RayFog(NamedTuple):
    """The fog along rays: the share of its colour, which is linear in the length along a ray, from 0 to 1."""

    # [rgb]: the colour of the fog.
    color: NDArray[np.float64]
    # [n, 2]: the share at the origin of each ray, not limited to numbers from 0 to 1, and its change per length in the
    # world. The parts of rays end where the share becomes 0 or 1.
    shares: NDArray[np.float64]


class PathMask(NamedTuple):
    """The mask of a layer, for points in space."""

    # The numbers of labels; the layer is shown at points whose label is not 0.
    voxels: PlacedVoxels
    # [3, 4]: the transformation from the world to the mask's index space.
    index_from_world: NDArray[np.float64]


class PathMedium(NamedTuple):
    """A layer in space, for paths that turn. Places in the world are relative to a point that all layers share."""

    # [z, y, x]: the largest extinction in each macrocell, a block of 4^3 cells; NaN at first. The array is updated, and
    # later calls with the same values and intervals use it.
    majorants: NDArray[np.float64]
    # [3, 4]: the transformation from the world to the layer's index space.
    index_from_world: NDArray[np.float64]
    # [3, 4]: the transformation from the layer's index space to the world.
    world_from_index: NDArray[np.float64]
    # The finest spacing of voxels.
    voxel: float
    # The mask of the layer; None without a mask.
    mask: PathMask | None


class PathSurface(NamedTuple):
    """The surfaces of layers, as in SurfaceSpec (renderer/scene/light_section.py)."""

    # The largest share of a point that is a surface.
    share: float
    # The coefficient and the exponent of highlights.
    specular: float
    shininess: float


class PathLight(NamedTuple):
    """The sources of light around the layers, as in LightSources (renderer/lighting/environment.py), in world axes."""

    # The axis of the environment, a unit vector.
    up: NDArray[np.float64]
    # [band, rgb]: the coefficients of the environment's radiance.
    environment: NDArray[np.float64]
    # The unit vector to the middle of the key light.
    key: NDArray[np.float64]
    # 1 less the cosine of the key light's angular radius.
    key_rise: float
    # [rgb]: the integral of the key light's radiance over its solid angle.
    key_irradiance: NDArray[np.float64]
    # The factor on albedos of matter that light meets on its way; points of rays have their whole albedo.
    scattering: float
    # The surfaces on which paths may begin; None without surfaces.
    surface: PathSurface | None


class ClipRegion(NamedTuple):
    """The region that clip planes and boxes leave: the points p of a volume in all slabs and in no removed box.

    A slab is [8]: a normal n [3], the lower and the upper bound of n . p, and n as a unit vector [3] in the world. The
    product n . p is a length, with p in index space relative to the volume's centre.
    """

    # [k, 8]: the slabs of clip planes, which are unbounded on one side.
    slabs: NDArray[np.float64]
    # [m, 3, 8]: for each removed box, the slabs across its axes.
    boxes: NDArray[np.float64]


class RaySetup(NamedTuple):
    """The rays of a view in the index space of a volume.

    With (x, y) the position of a pixel's centre in pixels, y downwards, relative to `center_px`:

        origin = origins @ (1, x, y)        direction = directions @ (1, x, y)
    """

    # [3, 3]: the matrix from (1, x, y) to the origin of a ray, in index space relative to the volume's centre.
    origins: NDArray[np.float64]
    # [3, 3]: the matrix from (1, x, y) to directions of rays, in index units per model unit (half the largest volume's
    # diagonal): per unit of depth in perspective, and of length otherwise.
    directions: NDArray[np.float64]
    # The slope of a ray per pixel of distance from the optical axis: at (x, y), a ray's length per unit of depth is
    # `sqrt(1 + slope_per_px^2 (x^2 + y^2))`.
    slope_per_px: float
    # The distance from the origin at which rays start, on the near plane, in model units (half the largest volume's
    # diagonal) along the direction.
    start: float
    # The position (x, y) of the optical axis in the image, in pixels.
    center_px: NDArray[np.float64]
    # The region that clipping leaves; None if the view clips nothing.
    clip: ClipRegion | None


class ModelView(NamedTuple):
    """A view of a model: where the eye is, and how points are projected to pixels. Lengths are in model units (half the
    volume's diagonal).
    """

    # [3, 4]: the rotation and translation from the model to the view, in model units (half the volume's diagonal).
    view_from_model: NDArray[np.float64]
    # Whether the projection is in perspective; orthographic otherwise.
    perspective: bool
    # The focal length in pixels in perspective; otherwise the number of pixels in a model unit (half the volume's
    # diagonal).
    scale_px: float
    # The image's width and height, in pixels.
    size: tuple[int, int]
    # The position (x, y) of the optical axis in the image, in pixels.
    center_px: NDArray[np.float64]
    # The depth of the near plane, in model units (half the volume's diagonal); nothing nearer to the eye is drawn.
    near: float
    # The largest slopes |x| / depth and |y| / depth, across and down the image. The footprint of a splat with a larger
    # slope is linearised as one with these slopes.
    slope_limit: NDArray[np.float64]


class MaskGrid(NamedTuple):
    """A mask of labels, on a grid of its own."""

    # [z, y, x]: for each voxel of the mask, nine bits, x fastest: which of the 3 x 3 voxels around it in its xy plane
    # are inside the mask. Beyond the border, the nearest voxels are repeated.
    planes: NDArray[np.uint16]
    # [3, 4]: the transformation from the index space of another volume to the index space of the mask.
    from_index: NDArray[np.float64]
