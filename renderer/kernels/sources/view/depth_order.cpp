// Sort splats by depth, and nodes of the octree as boxes, back to front.
#include "view/kernels.h"

namespace {

template <class Key>
struct Numbered {
    Key key;
    uint32_t number;
};

// Write the numbers from 0 to n - 1 in the order of their keys, and numbers with equal keys in ascending order. It is a
// radix sort: it goes from the lowest digits of the keys to the highest, and each pass keeps the order of keys with the
// same digit.
template <class Key, class KeyOf>
Status sort_by_key(int num_bits, const Array<uint32_t, 1>& order, KeyOf key_of) {
    constexpr int digit_bits = 8, num_digits = 1 << digit_bits;
    const int64_t num = order.shape[0];
    Buffer<Numbered<Key>> one(num), other(num);
    if (!one || !other) return NO_MEMORY;
    for (int64_t i = 0; i < num; i++) one[i] = {key_of(i), (uint32_t)i};
    Buffer<Numbered<Key>>*from = &one, *to = &other;
    for (int shift = 0; shift < num_bits; shift += digit_bits) {
        auto digit_of = [&](int64_t i) { return (*from)[i].key >> shift & (num_digits - 1); };
        int64_t starts[num_digits + 1] = {};
        for (int64_t i = 0; i < num; i++) starts[digit_of(i) + 1]++;
        for (int digit = 1; digit < num_digits; digit++) starts[digit] += starts[digit - 1];
        for (int64_t i = 0; i < num; i++) (*to)[starts[digit_of(i)]++] = (*from)[i];
        auto* sorted = to;
        to = from, from = sorted;
    }
    for (int64_t i = 0; i < num; i++) order[i] = (*from)[i].number;
    return DONE;
}

// Write base-4 digits for each voxel index along an axis, one digit of two bits for each level: 1 if the level's
// splitting plane lies between the index and the eye, otherwise 0.
void fill_digits(double eye, int64_t num, int num_levels, uint64_t* digits) {
    for (int64_t index = 0; index < num; index++)
        for (int level = 0; level < num_levels; level++) {
            double plane = (double)((index >> (level + 1) << (level + 1)) + ((int64_t)1 << level)) - 0.5;
            bool is_upper = index >> level & 1;
            if (is_upper ? eye < plane : eye > plane) digits[index] |= (uint64_t)1 << 2 * level;
        }
}

}  // namespace

// Write the indices of depths, sorted by descending depth, and equal depths by ascending index.
Status depth_order(const DepthOrder* arguments) {
    const auto [depths, order] = *arguments;
    if (order.shape[0] != depths.shape[0]) return OUT_OF_BOUNDS;
    return sort_by_key<uint32_t>(32, order, [&](int64_t i) {
        // As integers, the bits of positive floats ascend with the float, and those of negative floats descend. The two
        // zeros are equal.
        constexpr uint32_t sign = (uint32_t)1 << 31;
        uint32_t bits = __builtin_bit_cast(uint32_t, depths[i]);
        return bits > sign ? bits : sign - 1 - (bits & ~sign);
    });
}

// Sort nodes of the octree back to front, as boxes (Laur and Hanrahan 1991).
//
// A child of a node may hide another child only if fewer of the node's three splitting planes lie between it and the
// eye. The number of these planes, 0 to 3, is one base-4 digit of a cell's key, with a digit for each node around the
// cell; the root's digit comes first. Cells are sorted by descending key. A key is a sum over the three axes, so that
// one table for each axis gives every key. The digits of splitting planes inside the cell are cleared.
Status box_order(const BoxOrder* arguments) {
    const auto [levels, cells, eye, shape, order] = *arguments;
    const int64_t num = order.shape[0];
    if (levels.shape[0] != num || cells.shape[0] != num || cells.shape[1] != 3) return OUT_OF_BOUNDS;
    int num_levels = 1;
    while ((int64_t)1 << num_levels < most(most(shape[0], shape[1]), shape[2])) num_levels++;
    Buffer<uint64_t> x(shape[0]), y(shape[1]), z(shape[2]);
    if (!x || !y || !z) return NO_MEMORY;
    fill_digits(eye[0], shape[0], num_levels, x.data);
    fill_digits(eye[1], shape[1], num_levels, y.data);
    fill_digits(eye[2], shape[2], num_levels, z.data);
    return sort_by_key<uint64_t>(2 * num_levels, order, [&](int64_t i) {
        const int level = levels[i];
        auto first = [&](int axis) { return (int64_t)cells(i, axis) << level; };
        uint64_t key = x[first(0)] + y[first(1)] + z[first(2)], inside = ((uint64_t)1 << 2 * level) - 1;
        return ~(key & ~inside);
    });
}
