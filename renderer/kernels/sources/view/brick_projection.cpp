// Project the bounds of bricks into a view.
#include "view/kernels.h"

// In perspective, a box with a corner at this depth or less, in model units (half the volume's diagonal), gets the
// rectangle of the whole image: the position of such a corner on the image would be a division by almost 0.
constexpr double MIN_DEPTH = 1e-6;

// Write the image rectangle of each brick's bounds, clipped to the image enlarged by `beyond` pixels on each side.
Status project_bounds(const ProjectBounds* arguments) {
    const auto [bounds, camera, beyond, rectangles] = *arguments;
    const int64_t num = bounds.shape[0];
    if (rectangles.shape[0] != num) return OUT_OF_BOUNDS;
    const auto& r = camera.view_from_model;
    const double middle_x = camera.center_px[0], middle_y = camera.center_px[1];
    const double width = camera.size[0] + beyond, height = camera.size[1] + beyond, scale = camera.scale_px;
    auto project = [&](int64_t i, bool perspective) __attribute__((always_inline)) {
        double left = __builtin_inf(), top = left, right = -left, bottom = -left;
        int num_behind = 0;
        bool is_cut = false;
#pragma clang loop unroll(full)
        for (int corner = 0; corner < 8; corner++) {
            double x = bounds(i, corner & 1, 0), y = bounds(i, corner >> 1 & 1, 1), z = bounds(i, corner >> 2, 2);
            double depth = -(r[11] + r[8] * x + r[9] * y + r[10] * z);
            num_behind += depth <= camera.near;
            is_cut |= perspective & (depth <= MIN_DEPTH);
            double view_x = r[3] + r[0] * x + r[1] * y + r[2] * z;
            double view_y = r[7] + r[4] * x + r[5] * y + r[6] * z;
            if (perspective) view_x /= depth, view_y /= depth;
            double column = middle_x + scale * view_x, row = middle_y - scale * view_y;
            left = least(left, column), right = most(right, column);
            top = least(top, row), bottom = most(bottom, row);
        }
        if (num_behind == 8) left = right = top = bottom = 0.0;
        else if (is_cut) left = top = 0.0, right = width, bottom = height;
        rectangles(i, 0) = most(left, 0.0), rectangles(i, 1) = most(top, 0.0);
        rectangles(i, 2) = least(right, width), rectangles(i, 3) = least(bottom, height);
    };
    // There are two loops, because a choice of the projection inside one loop takes up to a quarter longer.
    if (camera.perspective)
        for (int64_t i = 0; i < num; i++) project(i, true);
    else
        for (int64_t i = 0; i < num; i++) project(i, false);
    return DONE;
}
