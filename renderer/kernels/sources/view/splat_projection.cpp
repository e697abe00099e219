// Find the splats that are visible in a view, and their depths.
#include "view/kernels.h"

// Write the depths of the splats' centres, and whether their footprints may meet the image. Depths are relative to the
// volume's centre: measured from a distant eye, they would lose their order in float32. A splat that the near plane
// clips is not drawn at its centre, and so always counts as a splat that meets the image.
Status cull_splats(const CullSplats* arguments) {
    const auto [vertices, sigmas, cutoff, min_sigma_px, clipped_sigmas, culled_sigmas, camera, along, depths,
                is_visible] = *arguments;
    const int64_t num = vertices.shape[0];
    if (!match(depths, is_visible, vertices)) return OUT_OF_BOUNDS;
    const auto& r = camera.view_from_model;
    const double scale = camera.scale_px, reach_px = cutoff * min_sigma_px + 1.0;
    const double half_width = 0.5 * camera.size[0] + reach_px, half_height = 0.5 * camera.size[1] + reach_px;
    // The position of the optical axis, to the right of the image's middle and up from it, in pixels.
    const double right_px = camera.center_px[0] - 0.5 * camera.size[0];
    const double up_px = 0.5 * camera.size[1] - camera.center_px[1];
    // The radii of the image of a ball of radius 1, across and down the image, in pixels times depth. The projection is
    // linearised at no more than the largest slopes.
    const double side = scale * __builtin_sqrt(1.0 + camera.slope_limit[0] * camera.slope_limit[0]);
    const double top = scale * __builtin_sqrt(1.0 + camera.slope_limit[1] * camera.slope_limit[1]);
    // The compiler's own vectors would use gather instructions, which take longer.
#pragma clang loop vectorize(disable)
    for (int64_t i = 0; i < num; i++) {
        double cx = vertices(i, 0), cy = vertices(i, 1), cz = vertices(i, 2);
        double depth = -(r[8] * cx + r[9] * cy + r[10] * cz) - r[11], per_px = camera.perspective ? depth : 1.0;
        // The distance of the centre from the middle of the image, in pixels; times depth in perspective.
        double x = __builtin_fabs((r[0] * cx + r[1] * cy + r[2] * cz + r[3]) * scale + per_px * right_px);
        double y = __builtin_fabs((r[4] * cx + r[5] * cy + r[6] * cz + r[7]) * scale + per_px * up_px);
        double sigma = sigmas[(int64_t)vertices(i, 7)], radius = cutoff * sigma;
        bool is_inside =
            camera.perspective
                ? (x - depth * half_width <= radius * side) & (y - depth * half_height <= radius * top)
                : (x - radius * scale <= half_width) & (y - radius * scale <= half_height);
        bool is_cut = depth - clipped_sigmas * sigma < camera.near;
        depths[i] = (float)(along[0] * cx + along[1] * cy + along[2] * cz);
        is_visible[i] = (is_inside | is_cut) & (depth + culled_sigmas * sigma > camera.near);
    }
    return DONE;
}
