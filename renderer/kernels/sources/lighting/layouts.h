// Arrays of the cells of a grid in two layouts: [z, y, x] and [x, y, z]. Sweeps along z and y read the first, sweeps
// along x the second, so that the cells of a row lie side by side. The last axis is padded to a multiple of ROW_CELLS.
#pragma once
#include "base/arrays.h"

// The number that divides the length of a row, the largest number of lanes. It is the same in
// renderer/lighting/radiance_grid.py.
constexpr int64_t ROW_CELLS = 16;

// The shape of a grid in both layouts.
struct Shape {
    // The number of cells of a row along x in the first layout, with the padding.
    int64_t row_x;
    // The number of cells along y.
    int64_t num_y;
    // The number of cells along z in the first layout, without padding.
    int64_t num_z;
    // The number of cells along x in the second layout, without padding.
    int64_t num_x;
    // The number of cells of a row along z in the second layout, with the padding.
    int64_t row_z;

    // Return whether the shape is possible, and has a block of ROW_CELLS slabs along z.
    INLINE bool has(int64_t block) const {
        return block >= 0 && block * ROW_CELLS < num_z && row_x % ROW_CELLS == 0 && row_z % ROW_CELLS == 0 &&
               num_x <= row_x && num_z <= row_z;
    }

    // Return whether an array has the first layout.
    template <class T>
    INLINE bool fits(const Array<T, 4>& array, int64_t channels) const {
        return has_shape(array, channels, num_z, num_y, row_x);
    }

    // Return whether an array has the second layout.
    template <class T>
    INLINE bool fits_turned(const Array<T, 4>& array, int64_t channels) const {
        return has_shape(array, channels, num_x, num_y, row_z);
    }
};

template <class A, class B>
INLINE Shape shape_of(const Array<A, 4>& along_x, const Array<B, 4>& along_z) {
    const auto& a = along_x.shape;
    const auto& b = along_z.shape;
    return {a[3], a[2], a[1], b[1], b[3]};
}

// Call `function(z, y, x)` for the cells of a block of slabs along z, in small cubes that stay in the cache in both
// layouts.
template <class Function>
INLINE void for_blocks(const Shape& shape, int64_t block, Function function) {
    int64_t z0 = block * ROW_CELLS, z1 = least(z0 + ROW_CELLS, shape.num_z);
    for (int64_t y = 0; y < shape.num_y; y++)
        for (int64_t x0 = 0; x0 < shape.num_x; x0 += ROW_CELLS)
            for (int64_t z = z0; z < z1; z++)
                for (int64_t x = x0; x < least(x0 + ROW_CELLS, shape.num_x); x++) function(z, y, x);
}
