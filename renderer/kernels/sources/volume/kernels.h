// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// A mask on a grid of its own.
struct MaskGrid {
    // [z, y, x]: which of the nine voxels around each in its plane are in the mask, a bit each, x fastest; beyond the
    // border the nearest voxels are repeated.
    Array<const uint16_t, 3> planes;
    // [3, 4]: from places in the index space of another volume to places in the mask's.
    double from_index[12];
};

// Find the voxels of another volume whose centres are in a mask.
struct MarkVoxels {
    MaskGrid mask;
    // [z, y, x]: 1 for voxels in the mask, 0 for others.
    Array<uint8_t, 3> out;
};
KERNEL(mark_voxels, MarkVoxels)
