// The share of the light that reaches each position (LightGrid in kernels.h).
#pragma once
#include "transfer/kernels.h"

// Return the value of a grid at a position inside the volume, interpolated in float32. x, y, z: the position in cells;
// the centre of cell i is at i + 1 along each axis.
INLINE float interpolate_cells(const Array<const float, 3>& grid, float x, float y, float z) {
    int64_t i = (int64_t)x, j = (int64_t)y, k = (int64_t)z;
    float a = x - (float)i, b = y - (float)j, c = z - (float)k;
    auto along_x = [&](int64_t row, int64_t slab) {
        float first = grid(slab, row, i);
        return first + a * (grid(slab, row, i + 1) - first);
    };
    float near = along_x(j, k), below = along_x(j + 1, k), far = along_x(j, k + 1), beyond = along_x(j + 1, k + 1);
    near += b * (below - near), far += b * (beyond - far);
    return near + c * (far - near);
}

// Multiply the ambient and the diffuse light, the last two numbers of `light`, by the shares that reach a voxel.
INLINE void shade(const LightGrid& grids, const int64_t* voxel, double* light) {
    bool is_occluded = grids.occlusion.size() > 0, is_shadowed = grids.shadow.size() > 0;
    if (!is_occluded && !is_shadowed) return;
    double scale = 1.0 / grids.cell_size, shift = 0.5 / grids.cell_size + 0.5;
    const auto& shape = is_occluded ? grids.occlusion.shape : grids.shadow.shape;
    float place[3];
    for (int axis = 0; axis < 3; axis++)
        place[axis] = (float)least(most((double)voxel[axis] * scale + shift, 0.5), (double)shape[2 - axis] - 1.5);
    auto share = [&](const Array<const float, 3>& grid, double strength) {
        return 1.0 - strength + strength * (double)interpolate_cells(grid, place[0], place[1], place[2]);
    };
    if (is_occluded) light[3] *= share(grids.occlusion, grids.occlusion_strength);
    if (is_shadowed) light[4] *= share(grids.shadow, grids.shadow_strength);
}
