// Sort bricks into tiles of a pixel grid.
#include "draw/kernels.h"

// Write the rays and the tiles that each brick may cover.
Status place_bricks(const PlaceBricks* arguments) {
    const auto& [rectangles_px, first_px, step_px, reach_px, shape, side, rectangles, tile_windows] = *arguments;
    if (side < 1 || !match(rectangles_px, rectangles, tile_windows)) return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < rectangles_px.shape[0]; i++) {
        int64_t low[2], end[2];
        for (int axis = 0; axis < 2; axis++) {
            auto held = [&](double ray) { return (int64_t)least(most(0.0, ray), (double)shape[axis]); };
            double left = rectangles_px(i, axis) - first_px[axis], right = rectangles_px(i, axis + 2) - first_px[axis];
            low[axis] = held(__builtin_ceil((left - reach_px) / step_px));
            end[axis] = held(__builtin_floor((right + reach_px) / step_px) + 1.0);
        }
        bool is_empty = low[0] >= end[0] || low[1] >= end[1];
        for (int axis = 0; axis < 2; axis++) {
            rectangles(i, axis) = is_empty ? 0 : low[axis], rectangles(i, axis + 2) = is_empty ? 0 : end[axis];
            tile_windows(i, axis) = rectangles(i, axis) / side;
            tile_windows(i, axis + 2) = (rectangles(i, axis + 2) + side - 1) / side;
        }
    }
    return DONE;
}

// Write `starts` and `numbers` of a grid (see Grid in draw/kernels.h). Here `starts` has one number more than in Grid, and
// is zero at first; `numbers` has room for all bricks over all tiles.
Status bin_bricks(const BinBricks* arguments) {
    const auto& [windows, have_rays, starts, numbers] = *arguments;
    const int64_t num_columns = have_rays.shape[1];
    if (starts.shape[0] != have_rays.size() + 2) return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < windows.shape[0]; i++)
        if (windows(i, 0) < 0 || windows(i, 1) < 0 || windows(i, 2) > num_columns || windows(i, 3) > have_rays.shape[0])
            return OUT_OF_BOUNDS;
    auto for_tiles = [&](auto function) {
        for (int64_t i = 0; i < windows.shape[0]; i++)
            for (int64_t row = windows(i, 1); row < windows(i, 3); row++)
                for (int64_t column = windows(i, 0); column < windows(i, 2); column++)
                    if (have_rays(row, column)) function(i, row * num_columns + column);
    };
    for_tiles([&](int64_t, int64_t tile) { starts[tile + 2]++; });
    for (int64_t tile = 1; tile < starts.shape[0]; tile++) starts[tile] += starts[tile - 1];  // tile k begins at k + 1
    if (starts[starts.shape[0] - 1] > numbers.shape[0]) return OUT_OF_BOUNDS;
    // Afterwards, starts[tile + 1] is where the next tile begins.
    for_tiles([&](int64_t brick, int64_t tile) { numbers[starts[tile + 1]++] = brick; });
    return DONE;
}
