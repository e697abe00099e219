// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// The voxels of a volume, as kernels read them into bricks.
struct Voxels {
    // [z, y, x]: as `raw_voxels` returns them (renderer/transfer/classify.py).
    AnyArray<3> raw;
    // [patterns]: the scalar of each bit pattern; None where voxels are scalars themselves.
    Maybe<Array<const double, 1>> scalars;
    // Whether any voxel has no data.
    bool has_absent;
    // Whether scalars are numbers of labels.
    bool is_labels;
};

// Measure the dual cells in bricks of level 0.
struct MeasureVoxelBricks {
    Voxels voxels;
    // [n, 3]: the bricks (x, y, z).
    EACH_CALL Array<const int32_t, 2> cells;
    // The visibility breakpoints (renderer/transfer/transfer_function.py).
    Array<const double, 1> breakpoints;
    // The channels w whose variation is measured, by the scalar.
    TransferTable curve;
    // [z, y, x]: 0 for voxels that a mask hides; None without a mask.
    Maybe<Array<const uint8_t, 3>> shown;
    // Whether labels are lit, by light that changes where they end.
    bool are_lit;
    // [n, 18, 18, 18, 4]: w of voxels that are colours, which is linear between them. Only J is measured then.
    EACH_CALL Maybe<Array<const float, 5>> texels;
    // [z, y, x, 2, 3]: the visible bounds of the bricks, as in BrickLevel; 0 before.
    Array<float, 5> bounds;
    // [3, z, y, x]: the largest D or J, and the root mean squares of D / width^2 and of J; 0 before.
    Array<double, 4> measures;
};
LONG_KERNEL(measure_voxel_bricks, MeasureVoxelBricks)

// Find the ranges of scalars in bricks of level 0 and their halo.
struct MeasureRanges {
    Voxels voxels;
    // [n, 3]: the bricks (x, y, z).
    EACH_CALL Array<const int32_t, 2> cells;
    // [n, 2]: the smallest and the largest scalar of each.
    EACH_CALL Array<double, 2> ranges;
};
KERNEL(measure_ranges, MeasureRanges)

// Add nodes to the statistics of bricks (NodeStatistics in renderer/bricks/node_statistics.py).
struct AddNodes {
    // [n, 3]: the nodes (x, y, z).
    Array<const int32_t, 2> cells;
    // [n]: their numbers of voxels.
    Array<const int64_t, 1> sizes;
    // [n]: their errors.
    Array<const double, 1> errors;
    // [n]: whether they are visible.
    Array<const bool, 1> is_visible;
    // As in NodeStatistics, and so are the next three.
    Array<double, 6> max_error_by_neighbour;
    Array<uint8_t, 8> bounds_by_neighbour;
    Array<double, 3> max_error_below;
    Array<double, 3> squared_errors_below;
};
KERNEL(add_nodes, AddNodes)

// Make the texels of bricks of level 0, as `scalar_texels` returns them (renderer/bricks/texels.py).
struct FillScalarTexels {
    Voxels voxels;
    // [n, 3]: the bricks (x, y, z).
    Array<const int32_t, 2> cells;
    // The scalar whose texel is 0.
    double first;
    // The width of the range of scalars times `factor`, as `range_width` returns both.
    double width;
    double factor;
    // [3, 3]: from gradients along the index axes to world axes; the largest entry is 1.
    double world_from_gradient[9];
    // A power of two, with which no difference of two scalars overflows.
    double scale;
    // A unit vector (x, y, z) to which the normals of labels turn a little; 0 for none.
    double toward_light[3];
    // [labels]: the opacity of a voxel of each label, by its number.
    Array<const double, 1> opacities;
    // [n, 18^3]: the scalars; with light [n, 4 * 18^3], the gradients behind them.
    Array<float, 2> texels;
};
KERNEL(fill_scalar_texels, FillScalarTexels)

// Continue the means of bricks beyond the volume's border (renderer/bricks/texels.py).
struct ExtrapolateBorder {
    // [n, 3]: the bricks (x, y, z).
    Array<const int32_t, 2> cells;
    // The volume's, in cells of the level (x, y, z).
    double extents[3];
    // The largest ratio of a colour to its optical depth.
    double brightest;
    // [n, 18, 18, 18, 4]: the means of cells, turned into texels of the field.
    Array<float, 5> texels;
};
KERNEL(extrapolate_border, ExtrapolateBorder)
