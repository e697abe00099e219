// Sort bricks into tiles of a pixel grid.
#include "draw/kernels.h"

// Write `starts` and `numbers` of a grid (see Grid in draw/kernels.h). Here `starts` has one number more than in Grid, and
// is zero at first; `numbers` has room for all bricks over all tiles.
Status bin_bricks(const BinBricks* arguments) {
    const auto [windows, num_columns, num_rows, starts, numbers] = *arguments;
    if (starts.shape[0] != num_columns * num_rows + 2) return OUT_OF_BOUNDS;
    auto for_tiles = [&](auto function) {
        for (int64_t i = 0; i < windows.shape[0]; i++)
            for (int64_t row = windows(i, 1); row < windows(i, 3); row++)
                for (int64_t column = windows(i, 0); column < windows(i, 2); column++)
                    function(i, row * num_columns + column);
    };
    for_tiles([&](int64_t, int64_t tile) { starts[tile + 2]++; });
    for (int64_t tile = 1; tile < starts.shape[0]; tile++) starts[tile] += starts[tile - 1];  // tile k begins at k + 1
    if (starts[starts.shape[0] - 1] > numbers.shape[0]) return OUT_OF_BOUNDS;
    // Afterwards, starts[tile + 1] is where the next tile begins.
    for_tiles([&](int64_t brick, int64_t tile) { numbers[starts[tile + 1]++] = brick; });
    return DONE;
}
