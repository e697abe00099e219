// Read bricks of voxels and their surroundings (renderer/bricks/layout.py).
#pragma once
#include "bricks/kernels.h"
#include "pyramid/brick_layout.h"
#include "volume/voxels.h"

namespace {

using Field = Array<double, 3>;

// A field with its own memory: a cube of numbers.
struct Cube : Buffer<double> {
    Field field;
    explicit Cube(int64_t side) : Buffer(side * side * side), field{data, {side, side, side}} {}
};

// Return whether a cell, [3] (x, y, z), is a brick of the volume.
INLINE bool is_brick(const Voxels& voxels, const Array<const int32_t, 1>& cell) {
    for (int axis = 0; axis < 3; axis++)
        if (cell[axis] < 0 || BRICK_SIZE * cell[axis] >= voxels.raw.shape[2 - axis]) return false;
    return true;
}

// Return whether all `cells` [n, 3] are bricks of the volume, and each bit pattern has a scalar.
inline bool fit_together(const Voxels& voxels, const Array<const int32_t, 2>& cells) {
    if (cells.shape[1] != 3 || !fits(voxels.scalars, voxels.raw)) return false;
    for (int64_t i = 0; i < cells.shape[0]; i++)
        if (!is_brick(voxels, cells[i])) return false;
    return true;
}

// Write the scalars in a brick and around it to `out` [n, n, n]. Beyond the volume's border the nearest voxel is
// repeated. cell: the brick, [3] (x, y, z).
inline void load_brick(const Voxels& voxels, const Array<const int32_t, 1>& cell, const Field& out) {
    int64_t side = out.shape[0], margin = (side - BRICK_SIZE) / 2;
    int64_t first[3];
    for (int axis = 0; axis < 3; axis++) first[axis] = BRICK_SIZE * cell[axis] - margin;
    load_scalars(voxels.raw, voxels.scalars, box_of(voxels.raw), first, side, out.data);
}

// Put 0, no label, beyond the volume's border in a field from `load_brick`, so that lit labels end at the border.
inline void clear_beyond_border(const Voxels& voxels, const Array<const int32_t, 1>& cell, const Field& field) {
    auto is_beyond = [&](int axis, int64_t at) {
        int64_t voxel = BRICK_SIZE * cell[axis] - (field.shape[0] - BRICK_SIZE) / 2 + at;
        return voxel < 0 || voxel >= voxels.raw.shape[2 - axis];
    };
    for (int64_t z = 0; z < field.shape[0]; z++)
        for (int64_t y = 0; y < field.shape[1]; y++)
            for (int64_t x = 0; x < field.shape[2]; x++)
                if (is_beyond(2, z) || is_beyond(1, y) || is_beyond(0, x)) field(z, y, x) = 0;
}

// A range of scalars, from `low` to `high`; empty if `low` is above `high`.
struct Range {
    double low;
    double high;
};

// Return the smallest and the largest number of a field; infinity and minus infinity if all numbers are NaN.
inline Range range_of(const Field& field) {
    Range range = {INFINITE, -INFINITE};
    for (int64_t k = 0; k < field.size(); k++)
        // NaN as the second number has no effect, because it is neither smaller nor larger.
        range = {least(range.low, field.data[k]), most(range.high, field.data[k])};
    return range;
}

}  // namespace
