// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// Average the optical depths of voxels over a slab of cells.
struct AverageVoxels {
    // [z, y, x]: the voxels of the volume; those of at most 16 bits as unsigned bit patterns (`raw_voxels` in
    // renderer/transfer/classify.py).
    AnyArray<3> raw;
    // [patterns]: the optical depth of each bit pattern of a voxel; None if `curve` is given.
    Maybe<Array<const float, 1>> by_pattern;
    // The transfer function, if scalars have more than 16 bits; otherwise None.
    Maybe<TransferTable> curve;
    // [z, y, x, 2]: the ranges of scalars in bricks, as in BuildBlocks; None if they are unknown.
    Maybe<Array<const double, 4>> ranges;
    // The scalars, ascending, at which voxels become visible or invisible.
    Array<const double, 1> breakpoints;
    // The level of the cells, which are 2^level voxels wide.
    int64_t level;
    // The index of the slab of cells, along z.
    EACH_CALL int64_t slab;
    // [y, x]: the mean optical depth of each cell.
    EACH_CALL Array<float, 2> out;
};
LONG_KERNEL(average_voxels, AverageVoxels)

// Find how much light reaches a slab of cells, by rays from their centres.
struct Transmit {
    // [z + 2, y + 2, x + 2]: the mean optical depth of each cell, on a path as long as the finest voxel spacing. The
    // outermost cells are repeated once beyond each border.
    Array<const float, 3> depths;
    // [rays, samples, 3] (x, y, z): the offsets of the samples of each ray from its start, outwards, in cells.
    Array<const float, 3> offsets;
    // [z + 2, y + 2, parts]: for each part of 16 cells of a row, whether any depth is above 0 in the part or the next
    // one, or in the same two parts of the next rows along y and z.
    Array<const bool, 3> filled;
    // [samples]: the length that each sample stands for, in finest voxel spacings.
    Array<const float, 1> lengths;
    // The highest corner of the volume (x, y, z), in cells; rays end at the volume's border.
    float end[3];
    // The index of the slab of cells, along z.
    EACH_CALL int64_t slab;
    // [y, x]: the mean transmission of the rays of each cell.
    EACH_CALL Array<float, 2> out;
};
LONG_KERNEL(transmit, Transmit)
