// Read voxels of any dtype as scalars.
#include "volume/voxels.h"

void load_scalars(const AnyArray<3>& raw, const Maybe<Array<const double, 1>>& by_pattern, const VoxelBox& box,
                  const int64_t* first, int64_t side, double* out) {
    auto nearest = [&](int axis, int64_t number) {
        return least(most(first[axis] + number, box.first[axis]), box.first[axis] + box.extent[axis] - 1);
    };
    // The range of voxels inside the box, along x.
    int64_t begin = nearest(0, 0) - first[0], end = nearest(0, side - 1) - first[0] + 1;
    with_array(raw, [&]<class T>(const Array<const T, 3>& voxels) {
        for (int64_t z = 0; z < side; z++)
            for (int64_t y = 0; y < side; y++, out += side) {
                const T* row = &voxels(nearest(2, z), nearest(1, y), first[0] + begin) - begin;
                for (int64_t x = begin; x < end; x++)
                    if constexpr (sizeof(T) <= 2) out[x] = by_pattern.value[(int64_t)row[x]];
                    else out[x] = (double)row[x];
                for (int64_t x = 0; x < begin; x++) out[x] = out[begin];
                for (int64_t x = end; x < side; x++) out[x] = out[end - 1];
            }
        return DONE;
    });
}
