// Continue the field of a brick into voxels without data, which are NaN, as it is continued beyond the volume's border.
//
// A voxel covers the points that are nearest to it: points that a voxel without data covers are not drawn. For
// interpolation, a voxel without data takes the mean of the nearest of its 26 neighbours that have data. Beside a plane
// of voxels with data, this mean is the value of the neighbour in the plane, so that data look the same whether NaN or
// the volume's border is around them.
#pragma once
#include "base/lanes.h"
#include "bricks/brick_voxels.h"

namespace {

using Eight = Vector<double, 8>;

// For each of eight voxels, return the mean of the nearest of its 26 neighbours that have data; NaN if no neighbour has
// data. cells_at(number): a function that loads, for all eight, one of the 27 voxels around each. In the number from 0
// to 26, x is fastest.
template <class Load>
INLINE Eight means_of_nearest(const Load& cells_at) {
    constexpr double scale = 16;  // with this divisor, sums of up to twelve numbers do not overflow
    Eight means = in_all<Eight>(__builtin_nan(""));
#pragma clang loop unroll(full)
    for (int distance = 3; distance > 0; distance--) {  // the squared distance of neighbours; the nearest come last
        Eight totals = {}, nums = {};
#pragma clang loop unroll(full)
        for (int number = 0; number < 27; number++) {
            int k = number / 9 - 1, j = number / 3 % 3 - 1, i = number % 3 - 1;
            if (k * k + j * j + i * i != distance) continue;
            Eight values = cells_at(number);
            Vector<bool, 8> exist = mask_of(values == values);
            totals = where(exist, totals + values / scale, totals);
            nums = where(exist, nums + 1, nums);
        }
        means = where(mask_of(nums > 0), totals / nums * scale, means);
    }
    return means;
}

// Write the inside of a field [n + 2, n + 2, n + 2] to `filled` [n, n, n], continued into voxels without data; n is at
// least 8. A voxel without any neighbour with data stays NaN. Return whether all voxels inside have data.
inline bool fill_absent(const Field& field, const Field& filled) {
    int64_t side = filled.shape[0];
    bool is_whole = true;
    for (int64_t z = 0; z < side; z++)
        for (int64_t y = 0; y < side; y++)
            for (int64_t first = 0; first < side; first += 8) {
                int64_t x = least(first, side - 8);
                auto cells_at = [&](int number) {
                    return load<Eight>(&field(z + number / 9, y + number / 3 % 3, x + number % 3), 0);
                };
                Eight values = cells_at(13);  // the eight voxels themselves, each in the middle of 27
                Vector<bool, 8> are_absent = mask_of(values != values);
                if (any_of<8>(are_absent)) {
                    is_whole = false;
                    values = where(are_absent, means_of_nearest(cells_at), values);
                }
                store(&filled(z, y, x), 0, values);
            }
    return is_whole;
}

}  // namespace
