// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// As in renderer/transfer/piecewise.py.
struct TransferTable {
    Array<const double, 1> values;
    Array<const double, 2> rows;
    double scale;
    Array<const uint64_t, 1> guide;
    double buckets_per_unit;
};

// As in renderer/transfer/light_factors.py.
struct LightGrid {
    Array<const float, 3> occlusion, shadow;
    Array<const int32_t, 1> corners;
    double cell_size, occlusion_strength, shadow_strength;
};

// As in renderer/transfer/classify.py, and the next one.
struct VoxelLighting {
    double light[5], world_from_gradient[9];
    LightGrid grid;
};

struct Classifier {
    Maybe<Array<const float, 2>> table;
    Maybe<Array<const double, 1>> scalars;
    Maybe<TransferTable> curve;
    bool is_opacity;
    Maybe<VoxelLighting> lighting;
    Array<const double, 1> breakpoints;
    Maybe<Sized<const uint8_t, 4, 3>> colors;
    Maybe<Array<const uint8_t, 3>> shown;
};

// As in renderer/transfer/piecewise.py.
struct PiecewiseTransfer {
    Array<const float, 2> rows;
    Array<const int32_t, 1> guide;
    float lowest_visible;
};
