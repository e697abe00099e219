// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// A mask of labels, on a grid of its own.
struct MaskGrid {
    // [z, y, x]: for each voxel of the mask, nine bits, x fastest: which of the 3 x 3 voxels around it in its xy plane
    // are inside the mask. Beyond the border, the nearest voxels are repeated.
    Array<const uint16_t, 3> planes;
    // [3, 4]: the transformation from the index space of another volume to the index space of the mask.
    double from_index[12];
};

// Find the voxels of another volume whose centres are in a mask.
struct MarkVoxels {
    MaskGrid mask;
    // [z, y, x]: 1 for voxels of the other volume whose centres are in the mask, 0 for all others.
    Array<uint8_t, 3> out;
};
KERNEL(mark_voxels, MarkVoxels)

// Count how often each bit pattern occurs among voxels.
struct CountPatterns {
    // [z, y, x]: voxels of at most 16 bits, as unsigned bit patterns; fewer than 2^32.
    AnyArray<3> raw;
    // [patterns]: the number of voxels of each bit pattern; counts are added to the array.
    Array<int64_t, 1> counts;
};
KERNEL(count_patterns, CountPatterns)
