// Find the voxels that a mask shows.
#include "draw/kernels.h"
#include "draw/mask.h"

// Write to `out` [z, y, x] whether the centre of each voxel of a volume is in a mask.
Status mark_voxels(const MarkVoxels* arguments) {
    const auto& [mask, out] = *arguments;
    if (mask.planes.size() == 0) return OUT_OF_BOUNDS;
    for (int64_t z = 0; z < out.shape[0]; z++)
        for (int64_t y = 0; y < out.shape[1]; y++)
            for (int64_t first = 0; first < out.shape[2]; first += LANES) {
                Floats x = to_float32(lane_numbers<Ints>()), zero = in_all<Floats>(0.0f);
                Box box = {};  // a brick whose first texels are these voxels
                for (int axis = 0; axis < 3; axis++)
                    box.corner[axis] = TEXEL_OFFSET + (double)(axis == 0 ? first : axis == 1 ? y : z);
                Mask inside = are_in_mask(mask, box, {x, zero, zero}, mask_of(x < (float)(out.shape[2] - first)));
                for (int64_t k = 0; k < least((int64_t)LANES, out.shape[2] - first); k++)
                    out(z, y, first + k) = inside[k];
            }
    return DONE;
}
