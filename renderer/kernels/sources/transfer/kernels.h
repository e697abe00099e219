// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// A table of four channels as a function of a scalar: linear between control values, constant outside.
//
// Two control points at one value are a step, whose value belongs to the upper side.
struct TransferTable {
    // [n]: control values, not descending.
    Array<const double, 1> values;
    // [n + 1, 10]: of each segment its start, its width, the channels [4] at the start, and their rise [4]. Segment k
    // holds the scalars from control value k - 1 to control value k; the first and the last are constant. Starts and
    // widths are multiplied by `scale`.
    Array<const double, 2> rows;
    // A power of two with which differences of scalars are finite.
    double scale;
    // [GUIDE_SIZE + 3]: from guide[b] to guide[b + 3] control values are at or below a scalar in bucket b.
    Array<const uint64_t, 1> guide;
    // Buckets of the guide per unit of the scaled scalar.
    double buckets_per_unit;
};

// A grid of factors on light, from 0, dark, to 1, at the centres of cells, between which they are linear.
struct LightGrid {
    // [z + 2, y + 2, x + 2]: factors on the ambient light, in steps of 1 / 255; [0, 0, 0] if not asked for. They are 1
    // where neither a cell nor a neighbour of it shows anything.
    Array<const float, 3> occlusion;
    // [z + 2, y + 2, x + 2]: the same on the diffuse light.
    Array<const float, 3> shadow;
    // For each cell the factors that are there, each in two numbers: 255 times the factors at the cell and at its
    // neighbours, eight bytes, x before y before z. Two numbers follow.
    Array<const int32_t, 1> corners;
    // The width of a cell, in voxels. Cells begin at the corner of the first voxel.
    double cell_size;
    // From 0 to 1: how much of the factors on the ambient light applies.
    double occlusion_strength;
    // From 0 to 1: how much of the factors on the diffuse light applies.
    double shadow_strength;
};

// A light on voxels.
struct VoxelLighting {
    // The unit vector towards the light in world axes, ambient, diffuse.
    double light[5];
    // [3, 3]: from a gradient along the index axes to the world.
    double world_from_gradient[9];
    // The share of the light that reaches each voxel; NO_LIGHT_GRID where all of it does.
    LightGrid grid;
};

// A set of tables with which kernels classify a voxel (renderer/transfer/classify.py).
struct Classifier {
    // [patterns, 4]: channels by bit pattern; None for wider values.
    Maybe<Array<const float, 2>> table;
    // [patterns]: the scalar of each bit pattern; None for wider values.
    Maybe<Array<const double, 1>> scalars;
    // The transfer function, extinctions times the finest spacing; None where `table` is used.
    Maybe<TransferTable> curve;
    // Whether the channels are (a c, a), and not (tau c, tau).
    bool is_opacity;
    // None without shading.
    Maybe<VoxelLighting> lighting;
    // The visibility breakpoints (renderer/transfer/transfer_function.py).
    Array<const double, 1> breakpoints;
    // [z, y, x, 3]: colours of voxels, factors on the transfer function's colours; None for white.
    Maybe<Sized<const uint8_t, 4, 3>> colors;
    // [z, y, x]: 0 for voxels that a mask hides; None without a mask.
    Maybe<Array<const uint8_t, 3>> shown;
};

// A table of colour and extinction by u, a scalar normalized to a range: 0 is its start and 1 its end.
struct PiecewiseTransfer {
    // [n, PIECE_FLOATS]: of each segment its end, its origin, the extinction times the finest spacing there and its
    // slope; (r, g, b, the same extinction) at the origin; and their slopes. Segment k holds u from the end of the one
    // before, included, to its own end, excluded; the last end is infinite. Kernels read rows in fours.
    Array<const float, 2> rows;
    // [GUIDE_SIZE]: from u = b / GUIDE_SIZE on the segment is guide[b] or later. For u < 0 it is the first.
    Array<const int32_t, 1> guide;
    // Below this u nothing is visible.
    float lowest_visible;
};
