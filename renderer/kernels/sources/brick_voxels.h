// Bricks of voxels and what is around them (renderer/bricks/layout.py).
#pragma once
#include "kernels.h"

constexpr int64_t BRICK_LEVELS = 4, BRICK_SIZE = 1 << BRICK_LEVELS, HALO = 1, PADDED_BRICK_SIZE = BRICK_SIZE + 2 * HALO;

namespace {

using Field = Array<double, 3>;

// Memory for a field.
struct Cube : Buffer<double> {
    Field field;
    explicit Cube(int64_t side) : Buffer(side * side * side), field{data, {side, side, side}} {}
};

inline bool is_nan(double x) {
    return x != x;
}

// Whether all cells [n, 3] are those of bricks of the volume, and each bit pattern has a scalar.
inline bool fit_together(const Voxels& voxels, const Array<const int32_t, 2>& cells) {
    const auto [raw, scalars, _] = voxels;
    int64_t num_patterns = raw.dtype < 2 ? 1 << 8 : raw.dtype < 4 ? 1 << 16 : 0;
    if (cells.shape[1] != 3 || (scalars.exists ? scalars.value.shape[0] : 0) != num_patterns) return false;
    for (int64_t i = 0; i < cells.shape[0]; i++)
        for (int axis = 0; axis < 3; axis++)
            if (cells(i, axis) < 0 || BRICK_SIZE * cells(i, axis) >= raw.shape[2 - axis]) return false;
    return true;
}

// Write the scalars of a brick and what is around it to `out` [n, n, n]. Beyond the volume's border the nearest voxel is
// repeated. cell: [3] (x, y, z).
inline void load_brick(const Voxels& voxels, const Array<const int32_t, 1>& cell, const Field& out) {
    int64_t side = out.shape[0], margin = (side - BRICK_SIZE) / 2;
    int64_t x0 = BRICK_SIZE * cell[0] - margin, y0 = BRICK_SIZE * cell[1] - margin, z0 = BRICK_SIZE * cell[2] - margin;
    with_array(voxels.raw, [&]<class T>(const Array<const T, 3>& raw) {
        auto [num_z, num_y, num_x] = raw.shape;
        int64_t begin = most<int64_t>(-x0, 0), end = least(num_x - x0, side);
        for (int64_t t = 0; t < side; t++)
            for (int64_t u = 0; u < side; u++) {
                int64_t z = least(most<int64_t>(z0 + t, 0), num_z - 1), y = least(most<int64_t>(y0 + u, 0), num_y - 1);
                const T* row = &raw(z, y, x0 + begin) - begin;
                double* to = &out(t, u, 0);
                for (int64_t v = begin; v < end; v++)
                    if constexpr (sizeof(T) <= 2) to[v] = voxels.scalars.value[row[v]];
                    else to[v] = (double)row[v];
                for (int64_t v = 0; v < begin; v++) to[v] = to[begin];
                for (int64_t v = end; v < side; v++) to[v] = to[end - 1];
            }
        return DONE;
    });
}

struct Range {
    double low, high;
};

// The smallest and the largest number of a field; infinity and minus infinity if all are NaN.
inline Range range_of(const Field& field) {
    Range range = {__builtin_inf(), -__builtin_inf()};
    for (int64_t k = 0; k < field.size(); k++)
        // NaN, being neither smaller nor larger, does not count as the second of two.
        range = {least(range.low, field.data[k]), most(range.high, field.data[k])};
    return range;
}

}  // namespace
