// Add nodes to statistics by brick: largest errors, visible bounds, and sums of squared errors
// (renderer/bricks/node_statistics.py).
#pragma once
#include "pyramid/brick_layout.h"
#include "pyramid/kernels.h"

namespace {

// Return whether the arrays of statistics have the shapes of one grid of bricks, and of one grid below.
inline bool fits(const BrickSums& sums) {
    const auto& [largest, bounds, largest_below, squares_below] = sums;
    const auto& [num_z, num_y, num_x, of_z, of_y, of_x] = largest.shape;
    return of_z == 3 && of_y == 3 && of_x == 3 && has_shape(bounds, num_z, num_y, num_x, 3, 3, 3, 2, 3) &&
           match(largest_below, squares_below);
}

// The largest error of some nodes of a brick, and the places of the visible ones among them.
struct Summary {
    // The largest error of a node.
    double error = 0;
    // The places of visible nodes along x, y and z: a bit for each place, BRICK_SIZE bits for each axis.
    uint64_t places = 0;

    INLINE void add(double node_error, uint64_t node_places) {
        error = most(error, node_error);
        places |= node_places;
    }

    // Join the nodes to others: to their largest error, and to their bounds [2, 3].
    void join(double& largest, uint8_t* others) const {
        largest = most(largest, error);
        if (places == 0) return;
        for (int axis = 0; axis < 3; axis++) {
            uint32_t along = places >> (axis * BRICK_SIZE) & ((1u << BRICK_SIZE) - 1);
            others[axis] = least(others[axis], (uint8_t)__builtin_ctz(along));
            others[3 + axis] = most(others[3 + axis], (uint8_t)(32 - __builtin_clz(along)));
        }
    }
};

// An adder of the nodes of one level to statistics. The nodes of a brick, and those of a brick of the level below, come
// one after the other.
//
// A node counts for all nodes of its brick, and for the nodes in the halo of each neighbour. It also counts for the
// brick of the level below in which it lies: for the brick's largest error, and for its sum of squared errors, weighted
// by the nodes' numbers of voxels. The sum is divided by the square of the largest error, so that it neither overflows
// nor vanishes.
class NodeAdder {
    // The largest number of nodes in a brick of the level below.
    static constexpr int64_t NODES_BELOW = (BRICK_SIZE / 2) * (BRICK_SIZE / 2) * (BRICK_SIZE / 2);
    // The statistics to which nodes are added.
    const BrickSums& sums;
    // The place (x, y, z) of the brick of the last nodes.
    int64_t brick[3] = {-1, -1, -1};
    // The place (x, y, z) of the brick of the level below of the last nodes.
    int64_t brick_below[3] = {-1, -1, -1};
    // The nodes of the brick that are in the halo of each neighbour [z, y, x]; in the middle, all its nodes.
    Summary by_neighbour[27];
    // The errors of nodes of the brick below that are not 0.
    double errors[NODES_BELOW];
    // The numbers of voxels of these nodes.
    double sizes[NODES_BELOW];
    // The number of these nodes.
    int64_t num = 0;

    void leave_brick() {
        if (brick[0] < 0) return;
        double* largest = &sums.max_error_by_neighbour(brick[2], brick[1], brick[0], 0, 0, 0);         // [27]
        uint8_t* bounds = &sums.bounds_by_neighbour(brick[2], brick[1], brick[0], 0, 0, 0, 0, 0);  // [27, 6]
        for (int neighbour = 0; neighbour < 27; neighbour++) {
            by_neighbour[neighbour].join(largest[neighbour], bounds + 6 * neighbour);
            by_neighbour[neighbour] = {};
        }
    }

    void leave_brick_below() {
        if (num == 0) return;
        double& largest = sums.max_error_below(brick_below[2], brick_below[1], brick_below[0]);
        double& squares = sums.squared_errors_below(brick_below[2], brick_below[1], brick_below[0]);
        for (int64_t i = 0; i < num; i++) largest = most(largest, errors[i]);
        for (int64_t i = 0; i < num; i++) errors[i] /= largest;
        for (int64_t i = 0; i < num; i++) squares += sizes[i] * (errors[i] * errors[i]);
        num = 0;
    }

  public:
    explicit NodeAdder(const BrickSums& to) : sums(to) {}

    // Begin nodes that lie in one brick, and in one brick of the level below. cell: the place (x, y, z) of one of them.
    INLINE void enter(const int64_t* cell) {
        bool is_other = false, is_other_below = false;
        for (int axis = 0; axis < 3; axis++) {
            is_other |= brick[axis] != cell[axis] >> BRICK_LEVELS;
            is_other_below |= brick_below[axis] != cell[axis] >> (BRICK_LEVELS - 1);
        }
        if (!is_other_below) return;
        leave_brick_below();
        if (is_other) leave_brick();
        for (int axis = 0; axis < 3; axis++) {
            brick[axis] = cell[axis] >> BRICK_LEVELS;
            brick_below[axis] = cell[axis] >> (BRICK_LEVELS - 1);
        }
    }

    // Add a node. cell: its place (x, y, z), in widths of a node. size: its number of voxels.
    INLINE void add(const int64_t* cell, int64_t size, double error, bool is_visible) {
        constexpr int64_t inside = BRICK_SIZE - 1, last = inside - HALO, centre = 13;
        int64_t x = cell[0] & inside, y = cell[1] & inside, z = cell[2] & inside;
        uint64_t places = (uint64_t)1 << x | (uint64_t)1 << (BRICK_SIZE + y) | (uint64_t)1 << (2 * BRICK_SIZE + z);
        if (!is_visible) places = 0;
        by_neighbour[centre].add(error, places);
        if (error > 0) {
            int64_t place = Array<double, 1>::checked(num++, NODES_BELOW);
            errors[place] = error, sizes[place] = (double)size;
        }
        if (x >= HALO && x <= last && y >= HALO && y <= last && z >= HALO && z <= last) return;
        for (int64_t k = 1 - (z < HALO); k < 2 + (z > last); k++)
            for (int64_t j = 1 - (y < HALO); j < 2 + (y > last); j++)
                for (int64_t h = 1 - (x < HALO); h < 2 + (x > last); h++)
                    by_neighbour[9 * k + 3 * j + h].add(error, places);
    }

    // Add the last nodes to the statistics.
    void finish() { leave_brick_below(), leave_brick(); }
};

}  // namespace
