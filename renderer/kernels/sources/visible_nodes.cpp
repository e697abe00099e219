// List, mark, hide and store the visible nodes of groups (renderer/pyramid/nodes.py).
#include "kernels.h"

namespace {

// The index in a group of the node that is n-th in Morton order.
INLINE int64_t node_in_order(int64_t n, int64_t num_nodes) {
    return num_nodes == 64 ? (n & 7) << 3 | n >> 3 : n;
}

// The sum over the channels of a node, of float32 or float64, in that precision.
INLINE double total_variance(const AnyArray<3>& variances, int64_t group, int64_t node) {
    auto total = [&]<class T>(const T* data) {
        const T* first = data + (group * variances.shape[1] + node) * variances.shape[2];
        T sum = first[0];
        for (int64_t channel = 1; channel < variances.shape[2]; channel++) sum += first[channel];
        return (double)sum;
    };
    return variances.dtype == 8 ? total((const float*)variances.data) : total((const double*)variances.data);
}

bool fits(const AnyArray<3>& variances, int64_t num_groups, int64_t num_nodes) {
    const auto& [num, num_of_group, num_channels] = variances.shape;
    return (variances.dtype == 8 || variances.dtype == 9) && num == num_groups && num_of_group == num_nodes &&
           num_channels > 0;
}

template <class T>
bool fits(const Array<T, 3>& means, int64_t num_groups, int64_t num_nodes) {
    return means.shape[0] == num_groups && means.shape[1] == num_nodes && means.shape[2] == 4;
}

}  // namespace

// Negate the last channel of nodes and of their parents below a leaf of every cut.
//
// Such a leaf has a total variance below the limit of its level. What is negated is not stored.
Status hide_below_leaves(const HideBelowLeaves* arguments) {
    const auto& [means, parent_means, parent_variances, root_variances, limits] = *arguments;
    int64_t num = means.shape[0];
    if (!fits(means, num, 64) || !fits(parent_means, num, 8) || !fits(parent_variances, num, 8) ||
        !fits(root_variances, num, 1))
        return OUT_OF_BOUNDS;
    for (int64_t g = 0; g < num; g++) {
        bool is_root_leaf = total_variance(root_variances, g, 0) < limits[1];
        for (int64_t parent = 0; parent < 8; parent++) {
            if (is_root_leaf) parent_means(g, parent, 3) *= -1.0f;
            if (is_root_leaf || total_variance(parent_variances, g, parent) < limits[0])
                for (int64_t k = 0; k < 8; k++) means(g, 8 * k + parent, 3) *= -1.0f;
        }
    }
    return DONE;
}

// Write the cells (x, y, z) of visible nodes of groups, in Morton order, and their numbers of voxels, unless there is
// room for none. Mark them in the grid `occupied` of cells 2^shift times as wide, unless `shift` is below 0.
//
// Nodes below a leaf of every cut, whose last channel is negative, count as visible. groups: the groups' cells.
// width: of a node, in voxels, where the border does not cut it. shape: of the volume, z, y, x.
Status list_visible_cells(const ListVisibleCells* arguments) {
    const auto [means, groups, width, shape, shift, occupied, cells, sizes] = *arguments;
    int64_t num_nodes = means.shape[1], num = 0, digits = num_nodes == 64 ? 2 : num_nodes == 8 ? 1 : 0;
    if (groups.shape[0] != means.shape[0] || groups.shape[1] != 3 || means.shape[2] != 4 || cells.shape[1] != 3 ||
        cells.shape[0] != sizes.shape[0])
        return OUT_OF_BOUNDS;
    for (int64_t g = 0; g < means.shape[0]; g++)
        for (int64_t n = 0; n < num_nodes; n++) {
            if (means(g, node_in_order(n, num_nodes), 3) == 0) continue;
            int64_t cell[3], size = 1;
            for (int64_t axis = 0; axis < 3; axis++) {
                cell[axis] = groups(g, axis) << digits;
                for (int64_t digit = 0; digit < digits; digit++) cell[axis] |= (n >> (3 * digit + axis) & 1) << digit;
                size *= least(shape[2 - axis] - cell[axis] * width, width);
            }
            if (shift >= 0) occupied(cell[2] >> shift, cell[1] >> shift, cell[0] >> shift) = true;
            if (sizes.shape[0] == 0) continue;
            if (num == sizes.shape[0]) return OUT_OF_BOUNDS;
            for (int64_t axis = 0; axis < 3; axis++) cells(num, axis) = (int32_t)cell[axis];
            sizes[num++] = size;
        }
    return DONE;
}

// Write the visible nodes of groups, in Morton order, and how many they are.
//
// variances: the roots of their sums over the channels become deviations. The root is taken before rounding to float32,
// which might not hold the square. children: of the nodes; their visibility becomes masks. None where they are voxels.
Status append_visible(const AppendVisible* arguments) {
    const auto [means, variances, children, visible, deviations, masks, num_visible] = *arguments;
    int64_t num_groups = means.shape[0], num_nodes = means.shape[1], num_most = num_groups * num_nodes, num = 0;
    bool has_children = children.shape[0] > 0;
    if (!fits(means, num_groups, num_nodes) || !fits(variances, num_groups, num_nodes) ||
        (has_children && (!fits(children, num_groups, 8 * num_nodes) || masks.shape[0] < num_most)) ||
        visible.shape[0] < num_most || visible.shape[1] != 4 || deviations.shape[0] < num_most ||
        num_visible.shape[0] != 1)
        return OUT_OF_BOUNDS;
    for (int64_t g = 0; g < num_groups; g++)
        for (int64_t n = 0; n < num_nodes; n++) {
            int64_t node = node_in_order(n, num_nodes);
            if (!(means(g, node, 3) > 0)) continue;
            __builtin_memcpy(&visible(num, 0), &means(g, node, 0), 4 * sizeof(float));
            deviations[num] = (float)__builtin_sqrt(total_variance(variances, g, node));
            if (has_children) {
                int mask = 0;
                for (int64_t k = 0; k < 8; k++) mask |= (children(g, k * num_nodes + node, 3) > 0) << k;
                masks[num] = (uint8_t)mask;
            }
            num++;
        }
    num_visible[0] = num;
    return DONE;
}

// Write the float16 bits of `values * factor` (a power of two; products from 0 to 2^15), rounded to nearest.
//
// Normal numbers are rounded to 11 bits by Veltkamp's splitting (Dekker 1971, "A floating-point technique for extending
// the available precision"); then only the bias of the exponent differs. Below 2^-14 the unit of float16 is 2^-24, as is
// that of the mantissa of float32 in [1/2, 1).
Status store_float16(const StoreFloat16* arguments) {
    const auto [values, factor, out] = *arguments;
    if (out.shape[0] != values.shape[0]) return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < values.shape[0]; i++) {
        float value = values[i] * factor, scaled = value * (float)((1 << 13) + 1);
        float rounded = scaled - (scaled - value);
        uint32_t normal = (__builtin_bit_cast(uint32_t, rounded) >> 13) - ((127 - 15) << 10);
        uint32_t tiny = __builtin_bit_cast(uint32_t, value + 0.5f);
        out[i] = (uint16_t)(value >= 0x1p-14f ? normal : tiny);
    }
    return DONE;
}
