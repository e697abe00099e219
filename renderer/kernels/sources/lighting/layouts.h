// Arrays of the cells of a grid in two layouts: [z, y, x] and [x, y, z]. Sweeps along z and y read the first, sweeps
// along x the second, so that the cells of a row lie side by side. The last axis is padded to a multiple of ROW_CELLS.
#pragma once
#include "base/arrays.h"

// The number that divides the length of a row, the largest number of lanes. It is the same in
// renderer/lighting/radiance_grid.py.
constexpr int64_t ROW_CELLS = 16;
// Up to this optical depth of a cell, the light in the middle stands for the light of the whole cell.
constexpr float LEAST_DEPTH = 1 / 64.0f;

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

// A square of cells at one y, from (z, x) on.
struct Tile {
    int64_t z;
    int64_t x;
    int64_t num_z;
    int64_t num_x;
};

// Call `function(y, tile)` for the squares of a block of slabs along z. The numbers of a square lie in few lines of the
// cache in both layouts: whoever reads one layout row by row, keeps them, and writes the other row by row, loads each
// line once.
template <class Function>
INLINE void for_tiles(const Shape& shape, int64_t block, Function function) {
    int64_t z = block * ROW_CELLS, num_z = least(ROW_CELLS, shape.num_z - z);
    for (int64_t y = 0; y < shape.num_y; y++)
        for (int64_t x = 0; x < shape.num_x; x += ROW_CELLS)
            function(y, Tile{z, x, num_z, least(ROW_CELLS, shape.num_x - x)});
}
