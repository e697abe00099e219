// Gather the means of nodes in bricks (renderer/bricks/means.py).
#include "brick_voxels.h"

// Copy nodes [g, n, 4] of groups, 4^3 or 2^3, to means [., z, y, x, 4] at first_cells [g, 3] (x, y, z) of bricks [g], as
// far as they fit.
Status copy_nodes(const CopyNodes* arguments) {
    const auto [nodes, first_cells, bricks, means] = *arguments;
    int64_t num = nodes.shape[0], side = nodes.shape[1] == 64 ? 4 : 2;
    if (nodes.shape[1] != side * side * side || nodes.shape[2] != 4 || means.shape[4] != 4) return OUT_OF_BOUNDS;
    if (first_cells.shape[0] != num || first_cells.shape[1] != 3 || bricks.shape[0] != num) return OUT_OF_BOUNDS;
    // Where nodes lie along an axis, as NODE_OFFSETS in renderer/pyramid/nodes.py.
    auto offset = [&](int64_t at) { return side == 4 ? 8 * (at & 1) + (at >> 1) : at; };
    for (int64_t g = 0; g < num; g++) {
        int64_t x0 = first_cells(g, 0), y0 = first_cells(g, 1), z0 = first_cells(g, 2), brick = bricks[g];
        for (int64_t z = 0; z < least(side, means.shape[1] - z0); z++)
            for (int64_t y = 0; y < least(side, means.shape[2] - y0); y++)
                for (int64_t x = 0; x < least(side, means.shape[3] - x0); x++) {
                    int64_t node = offset(x) + 2 * offset(y) + 4 * offset(z);
                    __builtin_memcpy(&means(brick, z0 + z, y0 + y, x0 + x, 0), &nodes(g, node, 0), 4 * sizeof(float));
                }
    }
    return DONE;
}
