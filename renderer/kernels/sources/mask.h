// Tell which points are in a mask: a volume of the labels 0 and 1 on a grid of its own, by the rule of labels.h.
#pragma once
#include "labels.h"

// What the eight voxels around a dual cell are: as in renderer/volume/mask.py.
enum : uint8_t { ALL_OUT, ALL_IN, MIXED };

inline bool fits(const MaskGrid& mask) {
    auto num = [&](int axis) { return mask.voxels.shape[axis] + 1; };
    return mask.voxels.size() > 0 && has_shape(mask.cells, num(0), num(1), num(2));
}

// Whether a point in a mixed dual cell is in. at: where it is in the mask's index space.
inline bool is_in_mixed_cell(const MaskGrid& mask, const float (&at)[3]) {
    Floats t = in_all<Floats>(0.0f);
    int64_t nearest[3];
    for (int axis = 0; axis < 3; axis++) {
        nearest[axis] = (int64_t)__builtin_floorf(at[axis] + 0.5f);
        t[axis] = at[axis] - (float)nearest[axis];
    }
    Three weights = label_weights(t);  // a lane for each axis
    const Floats* of_place = &weights.x;
    auto voxel = [&](int axis, int64_t at) {
        return least(most<int64_t>(nearest[axis] + at, 0), mask.voxels.shape[2 - axis] - 1);
    };
    float inside = 0.0f;
    for (int64_t z = 0; z < 3; z++)
        for (int64_t y = 0; y < 3; y++)
            for (int64_t x = 0; x < 3; x++)
                if (mask.voxels(voxel(2, z - 1), voxel(1, y - 1), voxel(0, x - 1)))
                    inside += of_place[z][2] * of_place[y][1] * of_place[x][0];
    return inside > 0.5f;
}

// Whether points are in a mask. at: where they are in its index space.
INLINE Mask are_in_mask(const MaskGrid& mask, const Three& at, Mask active) {
    const auto& [num_z, num_y, num_x] = mask.voxels.shape;
    auto is_between = [](Floats along, int64_t num) {
        return mask_of(along >= -0.5f) & mask_of(along < (float)num - 0.5f);
    };
    active &= is_between(at.x, num_x) & is_between(at.y, num_y) & is_between(at.z, num_z);
    if (!any_of(active)) return active;
    Ints inside = where(active, in_all<Ints>(1), in_all<Ints>(0));
    for (int lane = 0; lane < LANES; lane++) {
        if (!inside[lane]) continue;
        const float place[3] = {at.x[lane], at.y[lane], at.z[lane]};
        uint8_t state = mask.cells((int64_t)(place[2] + 1), (int64_t)(place[1] + 1), (int64_t)(place[0] + 1));
        inside[lane] = state == ALL_IN || (state == MIXED && is_in_mixed_cell(mask, place));
    }
    return mask_of(inside == 1);
}

// Whether samples in a brick of voxels are in a mask. texel: where they are in the brick.
INLINE Mask are_in_mask(const MaskGrid& mask, const Box& box, const Three& texel, Mask active) {
    const double* m = mask.from_index;
    auto along = [&](const double* row) {
        auto origin = [&](int axis) { return row[axis] * (box.corner[axis] - TEXEL_OFFSET); };
        float start = (float)(row[3] + origin(0) + origin(1) + origin(2));
        return fma(in_all<Floats>((float)row[0]), texel.x,
                   fma(in_all<Floats>((float)row[1]), texel.y, fma(in_all<Floats>((float)row[2]), texel.z,
                                                                 in_all<Floats>(start))));
    };
    return are_in_mask(mask, {along(m), along(m + 4), along(m + 8)}, active);
}
