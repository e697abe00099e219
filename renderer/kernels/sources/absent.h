// Continue the field of a brick into voxels without data, which are NaN, as it is continued beyond the volume's border.
//
// A voxel covers the points that are nearest to it: what a voxel without data covers is not drawn. Between a voxel and
// one without data, the field is interpolated to the mean of the nearest of the latter's 26 neighbours that have data.
// Beside a plane of voxels that is the voxel itself, so that data surrounded by NaN look as they do alone.
#pragma once
#include "brick_voxels.h"

namespace {

// The mean of the nearest data among the 26 neighbours of a voxel at [z + 1, y + 1, x + 1]; NaN without any.
inline double mean_of_nearest(const Field& field, int64_t z, int64_t y, int64_t x) {
    constexpr double scale = 16;  // means of up to twelve numbers do not overflow
    for (int distance = 1; distance < 4; distance++) {  // squared
        double total = 0;
        int num = 0;
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++)
                for (int i = 0; i < 3; i++) {
                    if ((k - 1) * (k - 1) + (j - 1) * (j - 1) + (i - 1) * (i - 1) != distance) continue;
                    double value = field(z + k, y + j, x + i);
                    if (!is_nan(value)) total += value / scale, num++;
                }
        if (num > 0) return total / num * scale;
    }
    return __builtin_nan("");
}

// Write the inside of a field [n + 2, n + 2, n + 2] to `filled` [n, n, n], continued into voxels without data. What has
// no neighbour with data stays NaN. Return whether all voxels inside have data.
inline bool fill_absent(const Field& field, const Field& filled) {
    bool is_whole = true;
    for (int64_t z = 0; z < filled.shape[0]; z++)
        for (int64_t y = 0; y < filled.shape[1]; y++)
            for (int64_t x = 0; x < filled.shape[2]; x++) {
                double value = field(z + 1, y + 1, x + 1);
                if (is_nan(value)) is_whole = false, value = mean_of_nearest(field, z, y, x);
                filled(z, y, x) = value;
            }
    return is_whole;
}

}  // namespace
