// What kernels take: the one place where both languages read it.
//
// Python reads this file, too (binding.py), and fills each struct by the names of its members, from a NamedTuple or from
// keyword arguments. It knows these types of members, and refuses a file with others:
//
//     int64_t, float, double, bool, ...   a number
//     double x[3]                         a sequence of three numbers, or an array of that size
//     Array<const float, 2>               an array of that dtype and number of dimensions, contiguous; without `const`
//                                         it must be writeable, too
//     AnyArray<3>                         an array of any dtype, contiguous, read only
//     Struct                              one that is defined above
//     Maybe<any of these but numbers>     the same, or None
//
// KERNEL(name, Struct) declares a kernel that takes a Struct. Rooms are in the order of docs/architecture.md.
#pragma once
#include "arrays.h"

#ifndef KERNEL
#define KERNEL(name, Arguments) \
    extern "C" __attribute__((visibility("default"))) Status name(const Arguments* arguments);
#endif

// ---- transfer

// As in renderer/transfer/piecewise.py.
struct TransferTable {
    Array<const double, 1> values;
    Array<const double, 2> rows;
    double scale;
    Array<const uint64_t, 1> guide;
    double buckets_per_unit;
};

// ---- pyramid

// ---- lighting

// ---- splats

// ---- bricks

// As in renderer/bricks/layout.py.
struct Voxels {
    AnyArray<3> raw;
    Maybe<Array<const double, 1>> scalars;
    bool has_absent;
};

struct MeasureVoxelBricks {
    Voxels voxels;
    Array<const int32_t, 2> cells;
    Array<const double, 1> breakpoints;
    TransferTable curve;
    Array<float, 5> bounds;
    Array<double, 4> measures;
};
KERNEL(measure_voxel_bricks, MeasureVoxelBricks)

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
    Array<double, 3> max_error_below;
    Array<double, 3> squared_errors_below;
};
KERNEL(add_nodes, AddNodes)

struct CopyNodes {
    Array<const float, 3> nodes;
    Array<const int64_t, 2> first_cells;
    Array<const int64_t, 1> bricks;
    Array<float, 5> means;
};
KERNEL(copy_nodes, CopyNodes)

struct FillScalarTexels {
    Voxels voxels;
    Array<const int32_t, 2> cells;
    double first;
    double width;
    double factor;
    Maybe<Array<const double, 2>> world_from_gradient;
    double scale;
    Array<float, 5> texels;
};
KERNEL(fill_scalar_texels, FillScalarTexels)

struct ExtrapolateBorder {
    Array<const int32_t, 2> cells;
    double extents[3];
    double brightest;
    Array<float, 3> texels;
};
KERNEL(extrapolate_border, ExtrapolateBorder)

// ---- view

// ---- modes

// ---- draw

struct BinBricks {
    Array<const int64_t, 2> tile_windows;
    int64_t num_columns;
    int64_t num_rows;
    Array<int64_t, 1> starts;
    Array<int64_t, 1> numbers;
};
KERNEL(bin_bricks, BinBricks)

// ---- film

// ---- truth
