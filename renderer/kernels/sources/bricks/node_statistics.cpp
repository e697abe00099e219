// Add nodes to the statistics of bricks (renderer/bricks/node_statistics.py).
#include "bricks/kernels.h"
#include "pyramid/brick_sums.h"

// Add nodes to the statistics. The nodes of a brick come in one call, one after the other.
Status add_nodes(const AddNodes* arguments) {
    const auto& [cells, sizes, errors, is_visible, sums] = *arguments;
    int64_t num = errors.shape[0];
    if (!has_shape(cells, num, 3) || !has_shape(sizes, num) || !has_shape(is_visible, num) || !fits(sums))
        return OUT_OF_BOUNDS;
    NodeAdder adder(sums);
    for (int64_t i = 0; i < num; i++) {
        const int64_t cell[3] = {cells(i, 0), cells(i, 1), cells(i, 2)};
        adder.enter(cell);
        adder.add(cell, sizes[i], errors[i], is_visible[i]);
    }
    adder.finish();
    return DONE;
}
