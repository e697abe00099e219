// Find the points that are in a mask, which is a volume of the labels 0 and 1 on a grid of its own, by the label rule of
// labels.h.
#pragma once
#include "draw/labels.h"

// Return which of the active points are in a mask. at: the points' positions in the mask's index space.
INLINE Mask are_in_mask(const MaskGrid& mask, const Three& at, Mask active) {
    const auto& [num_z, num_y, num_x] = mask.planes.shape;
    const Array<const uint16_t, 1> planes = {mask.planes.data, {mask.planes.size()}};
    Three weights[3];
    auto nearest_along = [&](Floats along, int64_t num, int axis) {
        Ints nearest = to_int32(along + 0.5f);
        active &= mask_of(along >= -0.5f) & mask_of(nearest < (int32_t)num);
        weights[axis] = label_weights(along - to_float32(nearest));
        return nearest;
    };
    Ints x = nearest_along(at.x, num_x, 0), y = nearest_along(at.y, num_y, 1), z = nearest_along(at.z, num_z, 2);
    if (!any_of(active)) return active;
    auto plane = [&](int32_t offset) {
        Ints k = min_of(max_of(z + offset, in_all<Ints>(0)), in_all<Ints>((int32_t)num_z - 1));
        Ints place = where(active, (k * (int32_t)num_y + y) * (int32_t)num_x + x, in_all<Ints>(0));
        return __builtin_convertvector(gather(planes, place), Ints);
    };
    const Ints bits[3] = {plane(-1), plane(0), plane(1)};
    constexpr int32_t whole = 511;
    Mask inside = mask_of((bits[0] & bits[1] & bits[2]) == whole);
    Mask are_mixed = active & ~inside & mask_of((bits[0] | bits[1] | bits[2]) != 0);
    if (!any_of(are_mixed)) return active & inside;
    Floats zero = in_all<Floats>(0.0f), sum = zero;
    const auto& [of_x, of_y, of_z] = weights;
    const Floats xs[3] = {of_x.x, of_x.y, of_x.z}, ys[3] = {of_y.x, of_y.y, of_y.z}, zs[3] = {of_z.x, of_z.y, of_z.z};
    for (int row = 0; row < 9; row++) {
        Floats of_row = zero;
        for (int k = 0; k < 3; k++)
            of_row += where(mask_of((bits[row / 3] & (1 << (row % 3 * 3 + k))) != 0), xs[k], zero);
        sum = fma(zs[row / 3] * ys[row % 3], of_row, sum);
    }
    return active & (inside | (are_mixed & mask_of(sum > 0.5f)));
}

// Return which of the active samples in a brick of voxels are in a mask. texel: the samples' positions in the brick, in
// texels.
INLINE Mask are_in_mask(const MaskGrid& mask, const Box& box, const Three& texel, Mask active) {
    auto along = [&](const double* row) {
        auto origin = [&](int axis) { return row[axis] * (box.corner[axis] - TEXEL_OFFSET); };
        Floats start = in_all<Floats>((float)(row[3] + origin(0) + origin(1) + origin(2)));
        return fma(in_all<Floats>((float)row[0]), texel.x,
                   fma(in_all<Floats>((float)row[1]), texel.y, fma(in_all<Floats>((float)row[2]), texel.z, start)));
    };
    const double* m = mask.from_index;
    return are_in_mask(mask, {along(m), along(m + 4), along(m + 8)}, active);
}
