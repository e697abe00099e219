// Place a splat at each cell of a cut.
#include "splats/kernels.h"

// Write the vertices of splats, as in SplatBatch (renderer/splats/splats.py).
Status place_splats(const PlaceSplats* arguments) {
    const auto [levels, shapes, cells, depths, shift_of_shape, area_of_shape, m, vertices] = *arguments;
    if (!match(levels, cells, depths, shapes, vertices) || !match(area_of_shape, shift_of_shape)) return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < vertices.shape[0]; i++) {
        const int shape = shapes[i], level = levels[i];
        auto centre = [&](int axis) {
            return (double)((int64_t)cells(i, axis) << level) + shift_of_shape(shape, axis);
        };
        const double x = centre(0), y = centre(1), z = centre(2);
        for (int k = 0; k < 3; k++) vertices(i, k) = (float)(m[3 * k] * x + m[3 * k + 1] * y + m[3 * k + 2] * z);
        for (int k = 0; k < 4; k++) vertices(i, 3 + k) = (float)(depths(i, k) * area_of_shape[shape]);
        vertices(i, 7) = (float)shape;
    }
    return DONE;
}
