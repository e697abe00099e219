// Tell by the ranges of scalars in bricks, which an earlier pass over the voxels found, where nothing can be visible.
#pragma once
#include "pyramid/kernels.h"
#include "pyramid/brick_layout.h"
#include "transfer/transfer.h"

namespace {

// Return whether the ranges are those of the bricks of a volume, if there are any.
inline bool fits(const Maybe<Array<const double, 4>>& ranges, const AnyArray<3>& raw) {
    auto num = [&](int axis) { return (raw.shape[axis] + BRICK_SIZE - 1) / BRICK_SIZE; };
    return !ranges.exists || has_shape(ranges.value, num(0), num(1), num(2), 2);
}

// Return whether any scalar in the brick around a voxel (x, y, z) may be visible. Without ranges, it may be.
INLINE bool may_show_brick(const Maybe<Array<const double, 4>>& ranges, const Array<const double, 1>& breakpoints,
                           int64_t x, int64_t y, int64_t z) {
    if (!ranges.exists) return true;
    const double* range = &ranges.value(z / BRICK_SIZE, y / BRICK_SIZE, x / BRICK_SIZE, 0);
    return range[0] <= range[1] && is_range_visible(breakpoints, range[0], range[1]);
}

}  // namespace
