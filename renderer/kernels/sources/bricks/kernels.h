// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// As in renderer/bricks/layout.py.
struct Voxels {
    AnyArray<3> raw;
    Maybe<Array<const double, 1>> scalars;
    bool has_absent, is_labels;
};

struct MeasureVoxelBricks {
    Voxels voxels;
    Array<const int32_t, 2> cells;
    Array<const double, 1> breakpoints;
    TransferTable curve;
    Maybe<Array<const uint8_t, 3>> shown;
    bool are_lit;
    Maybe<Array<const float, 5>> texels;
    Array<float, 5> bounds;
    Array<double, 4> measures;
};
LONG_KERNEL(measure_voxel_bricks, MeasureVoxelBricks)

struct MeasureRanges {
    Voxels voxels;
    Array<const int32_t, 2> cells;
    Array<double, 2> ranges;
};
KERNEL(measure_ranges, MeasureRanges)

struct AddNodes {
    Array<const int32_t, 2> cells;
    Array<const int64_t, 1> sizes;
    Array<const double, 1> errors;
    Array<const bool, 1> is_visible;
    Array<double, 6> max_error_by_neighbour;
    Array<uint8_t, 8> bounds_by_neighbour;
    Array<double, 3> max_error_below, squared_errors_below;
};
KERNEL(add_nodes, AddNodes)

struct FillScalarTexels {
    Voxels voxels;
    Array<const int32_t, 2> cells;
    double first, width, factor, world_from_gradient[9], scale, toward_light[3];
    Array<const double, 1> opacities;
    Array<float, 2> texels;
};
KERNEL(fill_scalar_texels, FillScalarTexels)

struct ExtrapolateBorder {
    Array<const int32_t, 2> cells;
    double extents[3], brightest;
    Array<float, 5> texels;
};
KERNEL(extrapolate_border, ExtrapolateBorder)
