// Merge voxels into nodes, and nodes into larger nodes.
//
// Two neighbours a and b, of which b holds the share h of the voxels, are merged into
//
//     mean = a + h (b - a)        variance = va + h (vb - va) + h (1 - h) (b - a)^2
//
// along x, then y, then z. This is the merge of Chan, Golub, LeVeque 1979 ("Updating formulae and a pairwise algorithm
// for computing sample variances") divided by the count. It takes no difference of large squares, so a variance is
// never negative, holds for large offsets, and is exactly 0 for equal voxels. Inside the volume h is 1/2. If the border
// cuts a node, the shares of voxels inside the volume differ along the three axes; if b has no voxels, h is 0.
//
// Nodes come in groups: 64 nodes, their 8 parents, and the root. The levels 1, 2, 3 of a block of 8^3 voxels are a
// group; the roots of up to 64 groups are the 64 nodes of a larger group. On each level of a group, and among the 512
// voxels, the child k = x + 2 y + 4 z of node i is at k n + i, with n the number of nodes: children are merged as eight
// contiguous rows, which becomes vector code. The 64 are then in Morton order with the two octal digits exchanged, the
// 8 in Morton order. The channels of a node lie together; each has its own variance.
#pragma once
#include "base/arrays.h"

namespace {

// The number of voxels along each side of a block.
constexpr int64_t BLOCK_SIZE = 8;
// The number of voxels in a block.
constexpr int64_t BLOCK_VOXELS = 512;
// The number of levels of nodes in a group.
constexpr int64_t NUM_LEVELS = 3;
// The largest number of levels that are streamed: the levels of a block below its root.
constexpr int64_t NUM_STREAMED = 2;
// The number of nodes on each level of a group, from the lowest level up.
constexpr int64_t NUM_NODES[NUM_LEVELS] = {64, 8, 1};
// The index in a group of the first node of each level: the nodes of lower levels come before it.
constexpr int64_t FIRST_NODE[NUM_LEVELS] = {0, 64, 72};
// The number of nodes on all levels of a group.
constexpr int64_t NODES_OF_GROUP = 73;

// The number of channels of a node: four channels in float32 (T is float), or one scalar in float64 (T is double).
template <class T>
constexpr int64_t NUM_CHANNELS = sizeof(T) == sizeof(float) ? 4 : 1;

// Return the part that a voxel's coordinate in its block adds to the voxel's index among the block's 512 voxels: the
// lowest bit of the coordinate selects the child of a node, the highest bit the largest parent.
INLINE int64_t voxel_offset(int64_t x) { return 64 * (x & 1) + 8 * (x >> 1 & 1) + (x >> 2); }

INLINE int64_t voxel_offset(int64_t x, int64_t y, int64_t z) {
    return voxel_offset(x) + 2 * voxel_offset(y) + 4 * voxel_offset(z);
}

// Return the index, on its level, of the node that is n-th in Morton order.
INLINE int64_t node_in_order(int64_t n, int64_t num_nodes) { return num_nodes == 64 ? (n & 7) << 3 | n >> 3 : n; }

// Return the index, along an axis, of the node on its level that is n-th in Morton order. axis: 0 for x, 1 for y, 2 for z.
INLINE int64_t place_in_group(int64_t n, int axis) { return (n >> axis & 1) | (n >> (axis + 2) & 2); }

// The mean and the variance of one channel over the voxels of a node.
template <class T>
struct Moments {
    T mean;
    T variance;
};

// Return the mean and the variance over two neighbours together. h: the share of their voxels that `b` holds.
template <class T>
INLINE Moments<T> merge_two(Moments<T> a, Moments<T> b, T h) {
    T d = b.mean - a.mean;
    return {a.mean + h * d, a.variance + h * (b.variance - a.variance) + (h - h * h) * (d * d)};
}

// The shares h by which the children of the NUM nodes of a level are merged along x, y and z, repeated for each channel
// of a node. h is the share of the voxels that the second of two neighbours holds.
template <class T, int64_t NUM>
struct Shares {
    // The number of channels of all nodes of the level.
    static constexpr int64_t WIDTH = NUM * NUM_CHANNELS<T>;
    // The shares h along x, y and z, for each channel of each node.
    T along[3][WIDTH];

    // extent: the number of voxels of the group inside the volume, along x, y, z. child: the width of the nodes'
    // children, in voxels.
    void set(const int64_t* extent, int64_t child) {
        for (int64_t axis = 0; axis < 3; axis++)
            for (int64_t j = 0; j < WIDTH; j++) {
                int64_t node = j / NUM_CHANNELS<T>, first = node >> axis & 1;
                // On the lowest level, the lower octal digit of an index stands for the parent, the higher digit for
                // the node in it.
                if (NUM == 64) first = first << 1 | (node >> (3 + axis) & 1);
                int64_t rest = extent[axis] - first * 2 * child;
                int64_t low = least(most(rest, (int64_t)0), child), high = least(most(rest - child, (int64_t)0), child);
                along[axis][j] = (T)((double)high / (double)most(low + high, (int64_t)1));
            }
    }
};

// Merge the children of the NUM nodes of one level, and write the means and variances of the nodes. pair(k, j, h): a
// function that returns children 2 k and 2 k + 1 merged along x, for j, the index of a node and its channel.
template <class T, int64_t NUM, class Pair>
INLINE void merge_rows(const Shares<T, NUM>& shares, T* __restrict mean, T* __restrict variance, Pair pair) {
    const auto& [along_x, along_y, along_z] = shares.along;
    for (int64_t j = 0; j < shares.WIDTH; j++) {
        T h = along_x[j];
        Moments<T> low = merge_two(pair(0, j, h), pair(1, j, h), along_y[j]);
        Moments<T> high = merge_two(pair(2, j, h), pair(3, j, h), along_y[j]);
        Moments<T> whole = merge_two(low, high, along_z[j]);
        mean[j] = whole.mean, variance[j] = whole.variance;
    }
}

// The nodes of one group, in memory that is used for one group after the other. T is float for channels, and double for
// scalars.
template <class T>
class Group {
    // The number of channels of a node.
    static constexpr int64_t C = NUM_CHANNELS<T>;
    // The shares h by which children are merged into the 64 nodes on the lowest level.
    Shares<T, 64> node_shares;
    // The shares h by which nodes are merged into the 8 parents.
    Shares<T, 8> parent_shares;
    // The shares h by which parents are merged into the root.
    Shares<T, 1> root_shares;
    // The number of voxels (x, y, z) of the group inside the volume, for which the shares were computed.
    int64_t cut[3] = {};

    template <int64_t NUM>
    INLINE void merge_level(const Shares<T, NUM>& shares, int64_t level) {
        constexpr int64_t width = NUM * C;
        const T *mean = means + FIRST_NODE[level - 1] * C, *variance = variances + FIRST_NODE[level - 1] * C;
        merge_rows(shares, means + FIRST_NODE[level] * C, variances + FIRST_NODE[level] * C,
                   [=](int64_t k, int64_t j, T h) {
                       int64_t one = 2 * k * width + j, other = one + width;
                       return merge_two(Moments<T>{mean[one], variance[one]}, {mean[other], variance[other]}, h);
                   });
    }

  public:
    // The means of the channels of all nodes, level by level.
    alignas(64) T means[NODES_OF_GROUP * C];
    // The variances of the channels of all nodes, level by level.
    alignas(64) T variances[NODES_OF_GROUP * C];
    // The channels of the voxels of a block.
    alignas(64) T voxels[BLOCK_VOXELS * C];

    // Begin a group of nodes that are `side` voxels wide; `extent` voxels of the group along x, y, z are inside the
    // volume.
    void begin(const int64_t* extent, int64_t side) {
        if (extent[0] == cut[0] && extent[1] == cut[1] && extent[2] == cut[2]) return;
        node_shares.set(extent, side / 2), parent_shares.set(extent, side), root_shares.set(extent, 2 * side);
        for (int axis = 0; axis < 3; axis++) cut[axis] = extent[axis];
        for (T& each : voxels) each = 0;  // voxels outside the volume stay 0
    }

    // Merge voxels into nodes, up to the root.
    void merge_voxels() {
        constexpr int64_t width = 64 * C;
        merge_rows(node_shares, means, variances, [this](int64_t k, int64_t j, T h) {
            T a = voxels[2 * k * width + j], d = voxels[(2 * k + 1) * width + j] - a;
            return Moments<T>{a + h * d, (h - h * h) * (d * d)};
        });
        merge_nodes();
    }

    void merge_nodes() {
        merge_level(parent_shares, 1);
        merge_level(root_shares, 2);
    }

    // Return the variance of a node, summed over its channels.
    INLINE T total_variance(int64_t level, int64_t node) const {
        const T* first = variances + (FIRST_NODE[level] + node) * C;
        T sum = first[0];
        for (int64_t channel = 1; channel < C; channel++) sum += first[channel];
        return sum;
    }

    // Return the standard deviation of a node: the square root of its total variance. The root is taken before rounding
    // to float32, which might not hold the variance.
    INLINE float deviation(int64_t level, int64_t node) const {
        if constexpr (sizeof(T) == sizeof(float)) return __builtin_sqrtf(total_variance(level, node));
        else return (float)__builtin_sqrt(total_variance(level, node));
    }
};

// Return the last channel of a node: the node is visible if the channel is above 0.
INLINE float& visibility(Group<float>& group, int64_t level, int64_t node) {
    return group.means[(FIRST_NODE[level] + node) * 4 + 3];
}

}  // namespace
