// Read voxels of any dtype as scalars.
#include "volume/voxels.h"

void load_scalars(const AnyArray<3>& raw, const Maybe<Array<const double, 1>>& by_pattern, const VoxelBox& box,
                  const int64_t* first, int64_t side, double* out) {
    with_array(raw, [&]<class T>(const Array<const T, 3>& voxels) {
        load_values(voxels, box, first, side, out, [&](T voxel) {
            if constexpr (sizeof(T) <= 2) return by_pattern.value[(int64_t)voxel];
            else return (double)voxel;
        });
        return DONE;
    });
}
