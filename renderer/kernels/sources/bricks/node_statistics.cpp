// Add up errors and bounds of the nodes in bricks and around them (renderer/bricks/node_statistics.py).
#include "bricks/kernels.h"
#include "bricks/brick_voxels.h"

namespace {

// Add a node to the largest errors [3, 3, 3], and to the bounds [3, 3, 3, 2, 3] of visible nodes, of each neighbour of
// its brick in whose halo the node lies. x, y, z: the node's position in the brick.
INLINE void add_by_neighbour(int64_t x, int64_t y, int64_t z, double error, bool is_visible,
                             const Array<double, 3>& largest, const Array<uint8_t, 5>& bounds) {
    constexpr int64_t last = BRICK_SIZE - 1 - HALO;
    uint8_t at[3] = {(uint8_t)x, (uint8_t)y, (uint8_t)z};
    for (int k = 1 - (z < HALO); k < 2 + (z > last); k++)
        for (int j = 1 - (y < HALO); j < 2 + (y > last); j++)
            for (int h = 1 - (x < HALO); h < 2 + (x > last); h++) {
                largest(k, j, h) = most(largest(k, j, h), error);
                if (!is_visible) continue;
                uint8_t *low = &bounds(k, j, h, 0, 0), *end = &bounds(k, j, h, 1, 0);
                for (int axis = 0; axis < 3; axis++) {
                    low[axis] = least(low[axis], at[axis]);
                    end[axis] = most(end[axis], (uint8_t)(at[axis] + 1));
                }
            }
}

}  // namespace

// Add nodes to the statistics.
//
// A node also counts for the brick of the level below in which it lies: for the brick's largest error, and for its sum
// of squared errors, weighted by the nodes' numbers of voxels. The sum is divided by the square of the largest error,
// so that it neither overflows nor vanishes.
Status add_nodes(const AddNodes* arguments) {
    const auto [cells, sizes, errors, is_visible, largest, bounds, largest_below, squares_below] = *arguments;
    int64_t num = errors.shape[0];
    if (!has_shape(cells, num, 3) || !has_shape(sizes, num) || !has_shape(is_visible, num)) return OUT_OF_BOUNDS;
    for (int axis = 0; axis < 3; axis++)
        if (largest.shape[axis] != bounds.shape[axis] || largest_below.shape[axis] != squares_below.shape[axis])
            return OUT_OF_BOUNDS;
    constexpr int64_t inside = BRICK_SIZE - 1, levels_below = BRICK_LEVELS - 1;
    for (int64_t i = 0; i < num; i++) {
        int64_t x = cells(i, 0), y = cells(i, 1), z = cells(i, 2);
        int64_t at[3] = {z >> BRICK_LEVELS, y >> BRICK_LEVELS, x >> BRICK_LEVELS};
        add_by_neighbour(x & inside, y & inside, z & inside, errors[i], is_visible[i], largest[at[0]][at[1]][at[2]],
                         bounds[at[0]][at[1]][at[2]]);
        double& below = largest_below(z >> levels_below, y >> levels_below, x >> levels_below);
        below = most(below, errors[i]);
    }
    for (int64_t i = 0; i < num; i++) {
        int64_t x = cells(i, 0) >> levels_below, y = cells(i, 1) >> levels_below, z = cells(i, 2) >> levels_below;
        if (!(errors[i] > 0)) continue;
        double ratio = errors[i] / largest_below(z, y, x);
        squares_below(z, y, x) += (double)sizes[i] * (ratio * ratio);
    }
    return DONE;
}
