// Add up errors and bounds of the nodes in bricks and around them (renderer/bricks/node_statistics.py).
#include "bricks/kernels.h"
#include "bricks/brick_voxels.h"

namespace {

// The largest error of some nodes of a brick, and the bounds of the visible ones among them.
struct Summary {
    // The largest error of a node.
    double error = 0;
    // The lowest place (x, y, z) of a visible node in the brick, and then one above the highest place.
    uint8_t bounds[6] = {BRICK_SIZE, BRICK_SIZE, BRICK_SIZE};

    // Add a node. at: its place (x, y, z) in the brick.
    INLINE void add(const uint8_t* at, double node_error, bool is_visible) {
        error = most(error, node_error);
        for (int axis = 0; axis < 3 && is_visible; axis++) {
            bounds[axis] = least(bounds[axis], at[axis]);
            bounds[3 + axis] = most(bounds[3 + axis], (uint8_t)(at[axis] + 1));
        }
    }

    // Join the nodes to others: to their largest error, and to their bounds [2, 3].
    INLINE void join(double& largest, uint8_t* others) const {
        largest = most(largest, error);
        for (int axis = 0; axis < 3; axis++) {
            others[axis] = least(others[axis], bounds[axis]);
            others[3 + axis] = most(others[3 + axis], bounds[3 + axis]);
        }
    }
};

// Add the nodes from `first` on that lie in one brick, to all nodes of the brick and to the nodes in the halo of each of
// its neighbours. Return the first node in another brick.
int64_t add_brick(const AddNodes& arguments, int64_t first) {
    const auto& [cells, sizes, errors, is_visible, largest, bounds, largest_below, squares_below] = arguments;
    constexpr int64_t inside = BRICK_SIZE - 1, last = inside - HALO;
    int64_t brick[3];
    for (int axis = 0; axis < 3; axis++) brick[axis] = cells(first, axis) >> BRICK_LEVELS;
    double* largest_here = &largest(brick[2], brick[1], brick[0], 0, 0, 0);            // [27]
    uint8_t* bounds_here = &bounds(brick[2], brick[1], brick[0], 0, 0, 0, 0, 0);  // [27, 6]
    Summary all;
    int64_t i = first;
    for (; i < errors.shape[0]; i++) {
        uint8_t at[3];
        bool is_here = true, is_in_halo = false;
        for (int axis = 0; axis < 3; axis++) {
            is_here &= cells(i, axis) >> BRICK_LEVELS == brick[axis];
            at[axis] = (uint8_t)(cells(i, axis) & inside);
            is_in_halo |= at[axis] < HALO || at[axis] > last;
        }
        if (!is_here) break;
        all.add(at, errors[i], is_visible[i]);
        if (!is_in_halo) continue;
        Summary node;
        node.add(at, errors[i], is_visible[i]);
        for (int k = 1 - (at[2] < HALO); k < 2 + (at[2] > last); k++)
            for (int j = 1 - (at[1] < HALO); j < 2 + (at[1] > last); j++)
                for (int h = 1 - (at[0] < HALO); h < 2 + (at[0] > last); h++) {
                    int neighbour = 9 * k + 3 * j + h;
                    node.join(largest_here[neighbour], bounds_here + 6 * neighbour);
                }
    }
    constexpr int centre = 13;
    all.join(largest_here[centre], bounds_here + 6 * centre);
    return i;
}

// Add the nodes from `first` on that lie in one brick of the level below. Return the first node in another brick.
int64_t add_brick_below(const AddNodes& arguments, int64_t first) {
    const auto& [cells, sizes, errors, is_visible, largest, bounds, largest_below, squares_below] = arguments;
    auto place = [&](int64_t i, int axis) { return (int64_t)cells(i, axis) >> (BRICK_LEVELS - 1); };
    const int64_t brick[3] = {place(first, 0), place(first, 1), place(first, 2)};
    double& largest_here = largest_below(brick[2], brick[1], brick[0]);
    double& squares_here = squares_below(brick[2], brick[1], brick[0]);
    double greatest = largest_here, squares = squares_here;
    auto is_here = [&](int64_t i) {
        return place(i, 0) == brick[0] && place(i, 1) == brick[1] && place(i, 2) == brick[2];
    };
    int64_t end = first;
    for (; end < errors.shape[0] && is_here(end); end++) greatest = most(greatest, errors[end]);
    for (int64_t i = first; i < end; i++) {
        if (!(errors[i] > 0)) continue;
        double ratio = errors[i] / greatest;
        squares += (double)sizes[i] * (ratio * ratio);
    }
    largest_here = greatest, squares_here = squares;
    return end;
}

}  // namespace

// Add nodes to the statistics. The nodes of a brick of the level below come in one call, one after the other.
//
// A node also counts for the brick of the level below in which it lies: for the brick's largest error, and for its sum
// of squared errors, weighted by the nodes' numbers of voxels. The sum is divided by the square of the largest error,
// so that it neither overflows nor vanishes.
Status add_nodes(const AddNodes* arguments) {
    const auto& [cells, sizes, errors, is_visible, largest, bounds, largest_below, squares_below] = *arguments;
    int64_t num = errors.shape[0];
    if (!has_shape(cells, num, 3) || !has_shape(sizes, num) || !has_shape(is_visible, num)) return OUT_OF_BOUNDS;
    for (int axis = 0; axis < 3; axis++)
        if (largest.shape[axis] != bounds.shape[axis] || largest_below.shape[axis] != squares_below.shape[axis])
            return OUT_OF_BOUNDS;
    const auto& [num_z, num_y, num_x, of_z, of_y, of_x] = largest.shape;
    if (of_z != 3 || of_y != 3 || of_x != 3 || !has_shape(bounds, num_z, num_y, num_x, 3, 3, 3, 2, 3))
        return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < num;) i = add_brick(*arguments, i);
    for (int64_t i = 0; i < num;) i = add_brick_below(*arguments, i);
    return DONE;
}
