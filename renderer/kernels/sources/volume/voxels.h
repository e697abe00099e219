// Read voxels of any dtype as scalars. Values of at most 16 bits are unsigned bit patterns, which are looked up in
// tables.
#pragma once
#include "base/arrays.h"

// A box of voxels.
struct VoxelBox {
    // The place (x, y, z) of the first voxel of the box.
    int64_t first[3];
    // The number of voxels of the box along x, y, z.
    int64_t extent[3];
};

// Return the box of all voxels of a volume.
INLINE VoxelBox box_of(const AnyArray<3>& raw) { return {{}, {raw.shape[2], raw.shape[1], raw.shape[0]}}; }

// Write the scalars of side^3 voxels from `first` (x, y, z) on. Beyond the box, the nearest voxel is repeated.
// by_pattern: the scalar of each bit pattern, for voxels of at most 16 bits.
void load_scalars(const AnyArray<3>& raw, const Maybe<Array<const double, 1>>& by_pattern, const VoxelBox& box,
                  const int64_t* first, int64_t side, double* out);

namespace {

// Write `convert(voxel)` for side^3 voxels from `first` (x, y, z) on. Beyond the box, the nearest voxel is repeated.
template <class T, class Out, class Convert>
INLINE void load_values(const Array<const T, 3>& voxels, const VoxelBox& box, const int64_t* first, int64_t side,
                        Out* out, Convert convert) {
    auto nearest = [&](int axis, int64_t number) {
        return least(most(first[axis] + number, box.first[axis]), box.first[axis] + box.extent[axis] - 1);
    };
    // The range of voxels inside the box, along x.
    int64_t begin = nearest(0, 0) - first[0], end = nearest(0, side - 1) - first[0] + 1;
    for (int64_t z = 0; z < side; z++)
        for (int64_t y = 0; y < side; y++, out += side) {
            const T* row = &voxels(nearest(2, z), nearest(1, y), first[0] + begin) - begin;
            if (end - begin == side) {  // of a side that the caller fixes, the compiler unrolls this loop
                for (int64_t x = 0; x < side; x++) out[x] = convert(row[x]);
                continue;
            }
            for (int64_t x = begin; x < end; x++) out[x] = convert(row[x]);
            for (int64_t x = 0; x < begin; x++) out[x] = out[begin];
            for (int64_t x = end; x < side; x++) out[x] = out[end - 1];
        }
}

// Call `function(x, y, z)` for each voxel of a box of at most SIDE voxels along each axis, x fastest.
template <int64_t SIDE, class Function>
INLINE void for_voxels(const VoxelBox& box, Function function) {
    auto call = [&](int64_t num_x, int64_t num_y, int64_t num_z) __attribute__((always_inline)) {
        for (int64_t z = 0; z < num_z; z++)
            for (int64_t y = 0; y < num_y; y++)
                for (int64_t x = 0; x < num_x; x++) function(x, y, z);
    };
    const auto& [num_x, num_y, num_z] = box.extent;
    if (num_x * num_y * num_z == SIDE * SIDE * SIDE) call(SIDE, SIDE, SIDE);  // constants, so that loops are unrolled
    else call(num_x, num_y, num_z);
}

// Return whether a table of scalars fits the voxels: it has a scalar for each bit pattern of voxels of at most 16 bits,
// and does not exist for wider voxels.
inline bool fits(const Maybe<Array<const double, 1>>& by_pattern, const AnyArray<3>& raw) {
    if (raw.dtype >= 4) return !by_pattern.exists;
    return raw.dtype % 2 == 0 && by_pattern.exists && by_pattern.value.shape[0] == 1 << (raw.dtype == 0 ? 8 : 16);
}

}  // namespace
