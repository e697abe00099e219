// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// As in renderer/pyramid/nodes.py.
struct VisibleNodes {
    Array<float, 2> means;
    Array<float, 1> deviations;
    Array<uint8_t, 1> masks;
    Array<int32_t, 2> cells;
    Array<int64_t, 1> sizes, counts;
    Array<float, 2> root_means;
    Array<double, 2> root_error_means, root_variances;
};

struct BuildBlocks {
    AnyArray<3> raw;
    Classifier classifier;
    Maybe<Classifier> error_classifier;
    Maybe<Array<const double, 1>> normalization;
    double leaf_variance_limits[2];
    Array<bool, 3> occupied;
    int64_t occupied_level;
    Array<const int64_t, 2> starts, extents;
    Array<bool, 1> visible;
    VisibleNodes nodes;
};
LONG_KERNEL(build_blocks, BuildBlocks)

struct MergeTier {
    Array<const float, 2> means;
    Array<const double, 2> error_means, variances;
    Array<const int64_t, 1> places;
    Array<const int64_t, 2> extents;
    int64_t side;
    VisibleNodes nodes;
};
KERNEL(merge_tier, MergeTier)

struct AverageCells {
    AnyArray<3> raw;
    Classifier classifier;
    int64_t level;
    Array<const int64_t, 2> corners;
    Array<float, 5> means;
};
KERNEL(average_cells, AverageCells)

struct StoreFloat16 {
    Array<const float, 1> values;
    float factor;
    Array<uint16_t, 1> out;
};
KERNEL(store_float16, StoreFloat16)

struct ListChildren {
    Array<const int64_t, 1> nodes, first_children;
    Array<const int32_t, 2> cells;
    Array<const uint8_t, 1> masks;
    Array<int64_t, 1> child_nodes;
    Array<int32_t, 2> child_cells;
};
KERNEL(list_children, ListChildren)

struct FindVoxels {
    AnyArray<3> raw;
    Classifier classifier;
    Array<const int32_t, 2> parents;
    Array<uint8_t, 1> counts;
    Array<int32_t, 2> cells;
    Array<float, 2> depths;
};
KERNEL(find_voxels, FindVoxels)
