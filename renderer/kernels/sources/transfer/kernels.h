// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// A table of four channels as a function of a scalar: linear between control values, constant outside.
//
// Two control points at one value are a step, whose value belongs to the upper side.
struct TransferTable {
    // [n]: the control values, ascending; equal ones are a step.
    Array<const double, 1> values;
    // [n + 1, 10]: for each segment its start, its width, the channels [4] at the start, and their rise [4]. Segment k
    // holds the scalars from control value k - 1 to control value k; the first and the last segment are constant.
    // Starts and widths are multiplied by `scale`.
    Array<const double, 2> rows;
    // A power of two by which scalars are multiplied, so that their differences are finite.
    double scale;
    // [GUIDE_SIZE + 3]: a guide to the segments. The range of the control values is divided into GUIDE_SIZE equal
    // buckets. For a scalar in bucket b, from guide[b] to guide[b + 3] control values are at or below the scalar.
    Array<const uint64_t, 1> guide;
    // The number of buckets of the guide per unit of a scalar multiplied by `scale`.
    double buckets_per_unit;
};

// A grid of factors on light, from 0 (dark) to 1. Factors are given at the centres of cells and are linear between
// them.
struct LightGrid {
    // [z + 2, y + 2, x + 2]: factors on the ambient light, in steps of 1 / 255; [0, 0, 0] if the scene asks for no
    // occlusion. A factor is 1 if neither the cell nor a neighbour shows anything.
    Array<const float, 3> occlusion;
    // [z + 2, y + 2, x + 2]: factors on the diffuse light, in steps of 1 / 255; [0, 0, 0] if the scene asks for no
    // shadows. A factor is 1 if neither the cell nor a neighbour shows anything.
    Array<const float, 3> shadow;
    // For each cell and each kind of factor that the scene asks for, two numbers. Their eight bytes are 255 times the
    // factors at the cell and at its next neighbours along x, y and z, x fastest. Two more numbers follow the last
    // cell.
    Array<const int32_t, 1> corners;
    // The width of a cell of the light grid, in voxels. Cells begin at the corner of the first voxel.
    double cell_size;
    // From 0 to 1: how much of the factors on the ambient light applies.
    double occlusion_strength;
    // From 0 to 1: how much of the factors on the diffuse light applies.
    double shadow_strength;
};

// A light on voxels, by Lambert's law.
struct VoxelLighting {
    // The unit vector towards the light in world axes, then the ambient and the diffuse coefficient.
    double light[5];
    // [3, 3]: the matrix from gradients along the index axes to the world.
    double world_from_gradient[9];
    // The share of the light that reaches each voxel; NO_LIGHT_GRID if all of the light reaches every voxel.
    LightGrid grid;
};

// The tables with which kernels classify a voxel (renderer/transfer/classify.py).
struct Classifier {
    // [patterns, 4]: the channels of each bit pattern; None for voxels of more than 16 bits.
    Maybe<Array<const float, 2>> table;
    // [patterns]: the scalar of each bit pattern; None for voxels of more than 16 bits.
    Maybe<Array<const double, 1>> scalars;
    // The transfer function, with extinctions multiplied by the finest voxel spacing; None if `table` is used.
    Maybe<TransferTable> curve;
    // Whether the channels are (a c, a), with the opacity a and the colour c, and not (tau c, tau), with the extinction
    // tau.
    bool is_opacity;
    // The light on voxels, by which colours are multiplied; None without shading.
    Maybe<VoxelLighting> lighting;
    // The scalars, ascending, at which the transfer function changes between invisible and visible
    // (renderer/transfer/transfer_function.py).
    Array<const double, 1> breakpoints;
    // [z, y, x, 3]: the colours of voxels, which multiply the transfer function's colours; None for white.
    Maybe<Sized<const uint8_t, 4, 3>> colors;
    // [z, y, x]: 0 for voxels that a mask hides; None without a mask.
    Maybe<Array<const uint8_t, 3>> shown;
};

// A table of colour and extinction by u, a scalar normalized to a range: 0 is its start and 1 its end.
struct PiecewiseTransfer {
    // [n, PIECE_FLOATS]: for each segment its end and its origin; the extinction at the origin, times the finest voxel
    // spacing, and its slope; (r, g, b, the same extinction) at the origin, and their slopes. Segment k holds u from
    // the end of the segment before, included, to its own end, excluded; the last end is infinite. Kernels read four
    // numbers of a row at a time.
    Array<const float, 2> rows;
    // [GUIDE_SIZE]: a scalar u >= b / GUIDE_SIZE lies in segment guide[b] or later. A scalar u < 0 lies in the first
    // segment.
    Array<const int32_t, 1> guide;
    // The normalized scalar u below which no scalar is visible.
    float lowest_visible;
    // [GUIDE_SIZE + 1]: the opacities over OPACITY_SPACINGS of the finest voxel spacing, at u = k / GUIDE_SIZE. They
    // tell surfaces.
    Array<const float, 1> opacities;
};
