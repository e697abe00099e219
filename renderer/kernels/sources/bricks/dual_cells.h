// The dual cells of a brick, each between eight voxel centres (subvoxel.cpp), and the range of values at their corners.
#pragma once
#include "base/lanes.h"
#include "bricks/brick_voxels.h"
#include "pyramid/brick_layout.h"

namespace {

// The number that no value of a type is above: infinity, or the largest integer.
template <class T>
constexpr T TOP = (T)-1;
template <>
constexpr double TOP<double> = INFINITE;
// The number that no value of a type is below: minus infinity, or 0.
template <class T>
constexpr T BOTTOM = 0;
template <>
constexpr double BOTTOM<double> = -INFINITE;

// The dual cells of a brick. Dual cell k along an axis lies between the centres of the cells k - 1 and k.
//
// T: double for scalars, an unsigned integer for bit patterns in the order of their scalars.
template <class T>
struct DualCells {
    // The smallest value at the corners of each dual cell.
    Array<T, 3> low;
    // The largest value at the corners of each dual cell.
    Array<T, 3> high;
    // The number of voxels of the brick along z, y, x; there is one dual cell more along each axis.
    int64_t nums[3];

    template <class Function>
    INLINE void for_places(Function function) const {
        for (int64_t z = 0; z <= nums[0]; z++)
            for (int64_t y = 0; y <= nums[1]; y++)
                for (int64_t x = 0; x <= nums[2]; x++) function(z, y, x);
    }

    template <class Function>
    INLINE void for_each(Function function) const {
        for_places([&](int64_t z, int64_t y, int64_t x) { function(z, y, x, low(z, y, x), high(z, y, x)); });
    }

    // Return the share of a dual cell that lies in the brick.
    INLINE double share(int64_t z, int64_t y, int64_t x) const {
        return share_along(0, z) * share_along(1, y) * share_along(2, x);
    }

    // Return the share along one axis, 0 for z, of a dual cell at a place on it.
    INLINE double share_along(int axis, int64_t at) const { return at == 0 || at == nums[axis] ? 0.5 : 1.0; }

    double size() const { return (double)(nums[0] * nums[1] * nums[2]); }
};

// Write the smaller of two numbers (or the larger, if TAKES_LARGER) to `out` [num], 16 numbers at a time; `num` is at
// most 32. As both rows are read before `out` is written, it may be one of them. A number that is NaN has no effect.
template <bool TAKES_LARGER, class T>
INLINE void choose_in_row(const T* one, const T* other, int64_t num, T* out) {
    constexpr int64_t width = 16;
    using Row = Vector<T, width>;
    auto chosen_at = [&](int64_t x) __attribute__((always_inline)) {
        Row a = load<Row>(one, x), b = load<Row>(other, x);
        if constexpr (TAKES_LARGER) return max_of(max_of(in_all<Row>(BOTTOM<T>), a), b);
        else return min_of(min_of(in_all<Row>(TOP<T>), a), b);
    };
    if (num >= width) {
        Row first = chosen_at(0), last = chosen_at(num - width);
        store(out, 0, first), store(out, num - width, last);
        return;
    }
    for (int64_t x = 0; x < num; x++)
        if constexpr (TAKES_LARGER) out[x] = most(most(BOTTOM<T>, one[x]), other[x]);
        else out[x] = least(least(TOP<T>, one[x]), other[x]);
}

// Turn values at voxel centres, in `cells.low`, into the smallest and largest value of each dual cell. NaN have no
// effect.
template <class T>
void to_ranges(const DualCells<T>& cells) {
    const auto [low, high, nums] = cells;
    const int64_t num_x = nums[2] + 1;
    for (int64_t z = 0; z < nums[0] + 2; z++)
        for (int64_t y = 0; y < nums[1] + 2; y++) {
            T* row = &low(z, y, 0);
            choose_in_row<true>(row, row + 1, num_x, &high(z, y, 0));
            choose_in_row<false>(row, row + 1, num_x, row);
        }
    for (int axis = 1; axis >= 0; axis--)
        for (int64_t z = 0; z < nums[0] + 1 + axis; z++)
            for (int64_t y = 0; y < nums[1] + 1; y++) {
                int64_t next_z = z + (axis == 0), next_y = y + (axis == 1);
                choose_in_row<false>(&low(z, y, 0), &low(next_z, next_y, 0), num_x, &low(z, y, 0));
                choose_in_row<true>(&high(z, y, 0), &high(next_z, next_y, 0), num_x, &high(z, y, 0));
            }
}

// Write the lowest and the highest corner (x, y, z) of the visible dual cells to `bounds` [2, 3]. At least one is
// visible. may_show(low, high): tells whether a value from `low` to `high` is visible.
template <class T, class MayShow>
void find_visible_bounds(const DualCells<T>& cells, const MayShow& may_show, const Array<float, 2>& bounds) {
    int64_t lowest[3] = {BRICK_SIZE, BRICK_SIZE, BRICK_SIZE}, highest[3] = {};
    for (int64_t z = 0; z <= cells.nums[0]; z++)
        for (int64_t y = 0; y <= cells.nums[1]; y++) {
            auto is_visible = [&](int64_t x) {
                T low = cells.low(z, y, x), high = cells.high(z, y, x);
                return low <= high && may_show(low, high);
            };
            // Search from both ends of the row, and only outside the bounds found so far.
            bool is_between = lowest[2] <= z && z <= highest[2] && lowest[1] <= y && y <= highest[1];
            int64_t first = 0, end = cells.nums[2] + 1;
            while (first < (is_between ? lowest[0] : end) && !is_visible(first)) first++;
            while (end > (is_between ? highest[0] + 1 : first) && !is_visible(end - 1)) end--;
            const int64_t low[3] = {first, y, z}, high[3] = {end - 1, y, z};
            for (int axis = 0; axis < 3 && first < end; axis++)
                lowest[axis] = least(lowest[axis], low[axis]), highest[axis] = most(highest[axis], high[axis]);
        }
    for (int axis = 0; axis < 3; axis++) {
        bounds(0, axis) = (float)most((double)lowest[axis] - 0.5, 0.0);
        bounds(1, axis) = (float)least((double)highest[axis] + 0.5, (double)cells.nums[2 - axis]);
    }
}

}  // namespace
