// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// Arrays for the visible nodes of several groups. A group is 64 nodes, their 8 parents, and one root (groups.h).
//
// Arrays have room for all nodes of all groups: first the lowest level of every group, then the middle level, then the
// roots. In the room of each level, its visible nodes come first, in Morton order.
struct VisibleNodes {
    // [n, 4]: the means of the four channels of each node.
    Array<float, 2> means;
    // [n]: the standard deviation of each node: the square root of the sum of its channels' variances.
    Array<float, 1> deviations;
    // [n]: the masks of visible children, as in Level (renderer/pyramid/pyramid.py); unused for nodes of level 1, whose
    // children are voxels.
    Array<uint8_t, 1> masks;
    // [3]: the number of visible nodes on each level, over all groups: of lowest nodes, of parents, and of roots.
    Array<int64_t, 1> counts;
    // [groups, 4]: the means of the channels of the root of each group of 73 nodes, visible or not.
    Array<float, 2> root_means;
    // [groups, channels]: the means of the root of each group of 73 nodes, in the channels that errors are measured on.
    Array<double, 2> root_error_means;
    // [groups, channels]: the variances of the root of each group of 73 nodes, in the channels that errors are measured
    // on.
    Array<double, 2> root_variances;
};

// Statistics of the nodes of one level, by brick (renderer/bricks/node_statistics.py), which kernels update.
struct BrickSums {
    // [z, y, x, 3, 3, 3]: for each brick and each neighbour at -1, 0 and 1 along z, y, x, the largest error of the
    // brick's nodes in the neighbour's halo. The middle entry is for all nodes of the brick.
    Array<double, 6> max_error_by_neighbour;
    // [z, y, x, 3, 3, 3, 2, 3]: the bounds of the visible ones among these nodes: the lowest place (x, y, z) in the
    // brick, and one above the highest place; BRICK_SIZE and 0 if no node is visible.
    Array<uint8_t, 8> bounds_by_neighbour;
    // [z, y, x]: the largest error of the nodes in each brick of the level below, half as wide.
    Array<double, 3> max_error_below;
    // [z, y, x]: for each brick of the level below, the sum of squared errors of its nodes, weighted by their numbers of
    // voxels, and divided by the square of the largest error.
    Array<double, 3> squared_errors_below;
};

// A level whose nodes are added to statistics, and not stored. The statistics are those of nodes as they would be
// stored: of rounded errors, and of means that are not rounded to 0.
struct StreamedLevel {
    // The statistics to which the visible nodes of the level are added.
    BrickSums sums;
    // The factor from the root of a variance to an error in stored units: a power of two.
    float error_factor;
    // Whether errors are rounded to float16.
    bool is_half;
    // [n + 1]: the factor from an error in stored units to an error in the measure's unit, for each number of voxels of
    // a node.
    Array<const double, 1> error_scales;
    // The largest mean extinction or opacity of a node that rounds to 0.
    double most_invisible;
};

// Build the nodes of blocks of 8^3 voxels: levels 1 to 3 of the pyramid.
struct BuildBlocks {
    // [z, y, x]: the voxels of the volume; those of at most 16 bits as unsigned bit patterns (`raw_voxels` in
    // renderer/transfer/classify.py).
    AnyArray<3> raw;
    // The classifier of the channels whose means are stored.
    Classifier classifier;
    // The classifier of the channels that errors are measured on; None if errors are measured on the stored channels or
    // on scalars.
    Maybe<Classifier> error_classifier;
    // [z, y, x, 2]: the smallest and the largest scalar of each brick of level 0 and its halo, or bounds of them, by
    // which voxels that show nothing are not read; None if they are unknown.
    Maybe<Array<const double, 4>> ranges;
    // [2]: an offset and a scale of the scalars that errors are measured on; None if errors are measured on channels.
    Maybe<Array<const double, 1>> normalization;
    // The limits of the variance for nodes of level 2, and of level 3: a node below the limit is drawn as one cell at
    // every tolerance, and the nodes inside it are not stored.
    double leaf_variance_limits[2];
    // [z, y, x]: whether each cell of `occupied_level` holds a visible node. The array is updated.
    Array<bool, 3> occupied;
    // The level of the cells of `occupied`, which are 2^level voxels wide.
    int64_t occupied_level;
    // The lowest levels, from level 1 on, if their nodes are not stored. A brick's nodes then come in one call.
    Array<const StreamedLevel, 1> streamed;
    // [n, 3]: the place (x, y, z) of the first voxel of each block, in Morton order.
    EACH_CALL Array<const int64_t, 2> starts;
    // [n, 3]: the number of voxels (x, y, z) of each block that are inside the volume.
    EACH_CALL Array<const int64_t, 2> extents;
    // [n]: whether each block may show something. Only these blocks have nodes.
    EACH_CALL Array<bool, 1> visible;
    // The visible nodes of the blocks, without streamed levels, which the kernel writes.
    VisibleNodes nodes;
};
LONG_KERNEL(build_blocks, BuildBlocks)

// Merge the roots of groups of 73 nodes into larger groups: two more levels of the pyramid.
struct MergeTier {
    // [n, 4]: the means of the four channels of each root that is merged.
    Array<const float, 2> means;
    // [n, channels]: the means of each root that is merged, in the channels that errors are measured on.
    Array<const double, 2> error_means;
    // [n, channels]: the variances of each root that is merged, in the channels that errors are measured on.
    Array<const double, 2> variances;
    // [n]: 64 times the index of the larger group that a root joins, plus the root's index in that group; ascending.
    Array<const int64_t, 1> places;
    // [groups, 3]: the number of voxels (x, y, z) of each larger group that are inside the volume.
    Array<const int64_t, 2> extents;
    // The width of each root that is merged, in voxels.
    int64_t side;
    // The visible nodes of the larger groups, which the kernel writes.
    VisibleNodes nodes;
};
KERNEL(merge_tier, MergeTier)

// Average voxels over cells of level 0, 1 or 2.
struct AverageCells {
    // [z, y, x]: the voxels of the volume; those of at most 16 bits as unsigned bit patterns (`raw_voxels` in
    // renderer/transfer/classify.py).
    AnyArray<3> raw;
    // The classifier of the channels that are averaged.
    Classifier classifier;
    // The level of the cells: 0, 1 or 2.
    int64_t level;
    // [n, 3]: the place (x, y, z) of the lowest cell of each brick, in widths of a cell. It may lie beyond the border.
    Array<const int64_t, 2> corners;
    // [n, z, y, x, 4]: the means of the cells; the caller must zero the array.
    Array<float, 5> means;
};
KERNEL(average_cells, AverageCells)

// Store numbers as float16.
struct StoreFloat16 {
    // [n]: the numbers that are stored.
    Array<const float, 1> values;
    // A power of two by which the numbers are multiplied; the products are from 0 to 2^15.
    float factor;
    // [n]: the bits of the products as float16.
    Array<uint16_t, 1> out;
};
KERNEL(store_float16, StoreFloat16)

// List the visible children of some nodes of a level.
struct ListChildren {
    // [n]: the nodes whose children are listed, as indices among the nodes of their level.
    Array<const int64_t, 1> nodes;
    // [all]: the index of the first visible child of each node of the level, as in Level (renderer/pyramid/pyramid.py).
    Array<const int64_t, 1> first_children;
    // [n, 3]: the place (x, y, z) of each node, in widths of a node.
    Array<const int32_t, 2> cells;
    // [all]: the mask of visible children of each node of the level, as in Level (renderer/pyramid/pyramid.py).
    Array<const uint8_t, 1> masks;
    // [m]: the visible children, as indices among the nodes of the level below.
    Array<int64_t, 1> child_nodes;
    // [m, 3]: the place (x, y, z) of each visible child, in widths of a child.
    Array<int32_t, 2> child_cells;
};
KERNEL(list_children, ListChildren)

// Count the visible voxels in cells of level 1, and list them.
struct FindVoxels {
    // [z, y, x]: the voxels of the volume; those of at most 16 bits as unsigned bit patterns (`raw_voxels` in
    // renderer/transfer/classify.py).
    AnyArray<3> raw;
    // The classifier of the channels (tau c, tau), by which voxels are visible.
    Classifier classifier;
    // [n, 3]: the place (x, y, z) of each cell of level 1, in widths of a cell.
    Array<const int32_t, 2> parents;
    // [n]: the number of visible voxels in each cell of level 1.
    Array<uint8_t, 1> counts;
    // [m, 3]: the place (x, y, z) of each visible voxel; empty if the caller only counts voxels.
    Array<int32_t, 2> cells;
    // [m, 4]: the channels (tau c, tau) of each visible voxel; empty if the caller only counts voxels.
    Array<float, 2> depths;
};
KERNEL(find_voxels, FindVoxels)
