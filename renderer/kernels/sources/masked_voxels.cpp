// Find the voxels that a mask shows.
#include "mask.h"

// Write to `out` [z, y, x] whether the centre of each voxel of a volume is in a mask.
Status mark_voxels(const MarkVoxels* arguments) {
    const auto& [mask, out] = *arguments;
    if (mask.planes.size() == 0) return OUT_OF_BOUNDS;
    const double* m = mask.from_index;
    for (int64_t z = 0; z < out.shape[0]; z++)
        for (int64_t y = 0; y < out.shape[1]; y++)
            for (int64_t first = 0; first < out.shape[2]; first += LANES) {
                Floats x = to_float32(lane_numbers<Ints>()) + (float)first;
                auto along = [&](const double* row) {
                    double start = row[3] + row[1] * (double)y + row[2] * (double)z + row[0] * (double)first;
                    return fma(in_all<Floats>((float)row[0]), x - (float)first, in_all<Floats>((float)start));
                };
                Mask active = mask_of(x < (float)out.shape[2]);
                Ints inside = where(are_in_mask(mask, {along(m), along(m + 4), along(m + 8)}, active), in_all<Ints>(1),
                                    in_all<Ints>(0));
                for (int64_t k = 0; k < least((int64_t)LANES, out.shape[2] - first); k++)
                    out(z, y, first + k) = (uint8_t)inside[k];
            }
    return DONE;
}
