// List the children of nodes, and visible voxels, on the way down a pyramid to a cut (renderer/pyramid/cut.py).
#include "pyramid/kernels.h"
#include "transfer/classify.h"

// Write the visible children of nodes, by the nodes' masks of visible children.
Status list_children(const ListChildren* arguments) {
    const auto [nodes, first_children, cells, masks, child_nodes, child_cells] = *arguments;
    if (!has_shape(cells, nodes.shape[0], 3) || !has_shape(first_children, masks.shape[0]) ||
        !has_shape(child_cells, child_nodes.shape[0], 3))
        return OUT_OF_BOUNDS;
    int64_t num = 0;
    for (int64_t i = 0; i < nodes.shape[0]; i++) {
        int64_t child = first_children[nodes[i]];
        for (int mask = masks[nodes[i]]; mask != 0; mask &= mask - 1) {
            int k = __builtin_ctz(mask);
            if (num == child_nodes.shape[0]) return OUT_OF_BOUNDS;
            child_nodes[num] = child++;
            for (int axis = 0; axis < 3; axis++) child_cells(num, axis) = 2 * cells(i, axis) + (k >> axis & 1);
            num++;
        }
    }
    return DONE;
}

// Count the visible voxels in each cell of level 1. If output arrays are given (not empty), also write the voxels'
// cells and channels.
Status find_voxels(const FindVoxels* arguments) {
    const auto [raw, classifier, parents, counts, cells, depths] = *arguments;
    int64_t num = 0, num_most = cells.shape[0];
    if (!fits(classifier, raw) || !has_shape(parents, counts.shape[0], 3) || !has_shape(cells, num_most, 3) ||
        !has_shape(depths, num_most, 4))
        return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < parents.shape[0]; i++) {
        VoxelBox box;
        auto& [first, extent] = box;
        for (int axis = 0; axis < 3; axis++) {
            first[axis] = 2 * (int64_t)parents(i, axis);
            extent[axis] = least(raw.shape[2 - axis] - first[axis], (int64_t)2);
        }
        int64_t num_before = num;
        classify_box<2>(raw, classifier, box, [&](int64_t x, int64_t y, int64_t z, FourChannels channels) {
            if (!(channels[3] > 0)) return;
            if (num < num_most) {
                cells(num, 0) = (int32_t)(first[0] + x), cells(num, 1) = (int32_t)(first[1] + y);
                cells(num, 2) = (int32_t)(first[2] + z);
                store(&depths(num, 0), 0, channels);
            }
            num++;
        });
        counts[i] = (uint8_t)(num - num_before);
    }
    return num_most > 0 && num > num_most ? OUT_OF_BOUNDS : DONE;
}
