// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

struct AverageVoxels {
    AnyArray<3> raw;
    Maybe<Array<const float, 1>> by_pattern;
    Maybe<TransferTable> curve;
    int64_t level, slab;
    Array<float, 2> out;
};
LONG_KERNEL(average_voxels, AverageVoxels)

struct Transmit {
    Array<const float, 3> depths, offsets;
    Array<const bool, 3> filled;
    Array<const float, 1> lengths;
    float end[3];
    int64_t slab;
    Array<float, 2> out;
};
LONG_KERNEL(transmit, Transmit)
