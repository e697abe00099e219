// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// As in renderer/volume/mask.py. from_index: rows of a matrix of 3 x 4.
struct MaskGrid {
    Array<const uint16_t, 3> planes;
    double from_index[12];
};

struct MarkVoxels {
    MaskGrid mask;
    Array<uint8_t, 3> out;
};
KERNEL(mark_voxels, MarkVoxels)
