// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "pyramid/kernels.h"

// The voxels of a volume, from which kernels make bricks.
struct Voxels {
    // [z, y, x]: the voxels of the volume; those of at most 16 bits as unsigned bit patterns (`raw_voxels` in
    // renderer/transfer/classify.py).
    AnyArray<3> raw;
    // [patterns]: the scalar of each bit pattern; None if the voxels themselves are scalars.
    Maybe<Array<const double, 1>> scalars;
    // Whether the volume has voxels without data.
    bool has_absent;
    // Whether the scalars are numbers of labels.
    bool is_labels;
};

// Measure the dual cells, each between eight voxel centres, in bricks of level 0.
struct MeasureVoxelBricks {
    Voxels voxels;
    // [n, 3]: the place (x, y, z) of each brick, in widths of a brick.
    EACH_CALL Array<const int32_t, 2> cells;
    // The scalars, ascending, at which the transfer function changes between invisible and visible
    // (renderer/transfer/transfer_function.py).
    Array<const double, 1> breakpoints;
    // The table of the channels w (subvoxel.cpp), whose variation is measured, as a function of the scalar.
    TransferTable curve;
    // [z, y, x]: 0 for voxels that a mask hides; None without a mask.
    Maybe<Array<const uint8_t, 3>> shown;
    // Whether labels are lit. Lit labels end at the border of the volume; unlit labels continue beyond.
    bool are_lit;
    // [n, 18, 18, 18, 4]: the channels w (subvoxel.cpp) of voxels that are colours, linear between voxels: only J is
    // then written to `measures`. None to measure by the voxels' scalars.
    EACH_CALL Maybe<Array<const float, 5>> texels;
    // [z, y, x, 2, 3]: the visible bounds of the bricks, as in BrickLevel; the caller must zero the array.
    Array<float, 5> bounds;
    // [3, z, y, x]: for each brick, the largest D or J, and the root mean squares of D / width^2 and of J, which
    // subvoxel.cpp defines; the caller must zero the array.
    Array<double, 4> measures;
    // [z, y, x, 2]: bounds of the scalars of each brick and its halo, minus infinity and infinity if none are known. The
    // kernel reads no voxels of a brick whose measures and visible bounds are 0 by them. To the bounds of the bricks
    // that it reads it writes the smallest and the largest scalar; infinity and minus infinity if there is no scalar.
    Array<double, 4> ranges;
};
LONG_KERNEL(measure_voxel_bricks, MeasureVoxelBricks)

// Add nodes to the statistics of bricks.
struct AddNodes {
    // [n, 3]: the place (x, y, z) of each node, in widths of a node.
    Array<const int32_t, 2> cells;
    // [n]: the number of voxels of each node.
    Array<const int64_t, 1> sizes;
    // [n]: the error of each node, in the unit of the error measure.
    Array<const double, 1> errors;
    // [n]: whether each node is visible.
    Array<const bool, 1> is_visible;
    // The statistics to which the nodes are added.
    BrickSums sums;
};
KERNEL(add_nodes, AddNodes)

// The rules by which the texels of bricks of level 0 are made (renderer/bricks/texels.py).
struct TexelRules {
    Voxels voxels;
    // The scalar whose texel is 0: the start of the range to which scalars are normalized.
    double first;
    // The width of the range of scalars, multiplied by `factor`, as `range_width` returns it.
    double width;
    // The factor on scalars, 1 or 1/2, with which their differences do not overflow.
    double factor;
    // [3, 3]: the matrix from gradients along the index axes to world axes; its largest entry is 1.
    double world_from_gradient[9];
    // A power of two by which scalars are multiplied for gradients, so that no difference of two scalars overflows.
    double scale;
    // The direction (x, y, z), a unit vector, to which the normals of labels are turned a little; zeros to turn none.
    double toward_light[3];
    // [labels]: the opacity of a voxel of each label, by the label's number.
    Array<const double, 1> opacities;
    // Whether gradients follow the scalars of a brick.
    bool is_lit;
};

// Make the texels of bricks of level 0.
struct FillScalarTexels {
    TexelRules rules;
    // [n, 3]: the place (x, y, z) of each brick, in widths of a brick.
    Array<const int32_t, 2> cells;
    // [n]: the row of `texels` that takes each brick.
    Array<const int64_t, 1> slots;
    // [slots, 18^3]: the scalars of bricks and their halo; with light [slots, 4 * 18^3], with gradients after the
    // scalars.
    Array<float, 2> texels;
};
KERNEL(fill_scalar_texels, FillScalarTexels)

// Continue the means of bricks beyond the volume's border (renderer/bricks/texels.py).
struct ExtrapolateBorder {
    // [n, 3]: the place (x, y, z) of each brick, in widths of a brick.
    Array<const int32_t, 2> cells;
    // The extents (x, y, z) of the volume, in cells of the level of the bricks.
    double extents[3];
    // The largest ratio of a mean of tau c to a mean of tau; colours are clamped to it.
    double brightest;
    // [n, 18, 18, 18, 4]: the means of cells, which are turned into values of the field at the cells' centres.
    Array<float, 5> texels;
};
KERNEL(extrapolate_border, ExtrapolateBorder)
