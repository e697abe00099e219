// Bound the scalars in bricks of voxels (renderer/bricks/extremes.py).
#include "bricks/kernels.h"
#include "bricks/brick_voxels.h"

// Write the range of scalars in each brick and its halo.
Status measure_ranges(const MeasureRanges* arguments) {
    const auto [voxels, cells, ranges] = *arguments;
    if (!fit_together(voxels, cells) || !has_shape(ranges, cells.shape[0], 2)) return OUT_OF_BOUNDS;
    // A voxel without data takes a mean of its neighbours, which may lie outside the brick.
    Cube around(PADDED_BRICK_SIZE + 2 * voxels.has_absent);
    if (!around) return NO_MEMORY;
    for (int64_t i = 0; i < cells.shape[0]; i++) {
        load_brick(voxels, cells[i], around.field);
        auto [low, high] = range_of(around.field);
        ranges(i, 0) = low, ranges(i, 1) = high;
    }
    return DONE;
}
