// Find the ends of the edges of cells, which overlays draw.
#include "draw/kernels.h"

// Write both ends of each edge, clamped to the volume, into the first six columns of vertices.
Status place_edges(const PlaceEdges* arguments) {
    const auto [starts, num_corners, axis, level, shape, model_from_index, vertices] = *arguments;
    const double* m = model_from_index;
    if (!match(starts, vertices)) return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < starts.shape[0]; i++) {
        int64_t rest = starts[i], first[3];
        for (int k = 0; k < 3; k++) first[k] = rest % num_corners[k], rest /= num_corners[k];
        for (int end = 0; end < 2; end++) {
            double corner[3];
            for (int k = 0; k < 3; k++)
                corner[k] = (double)least((first[k] + (end && k == axis)) << level, shape[k]) - 0.5 * (double)shape[k];
            for (int row = 0; row < 3; row++)
                vertices(i, 3 * end + row) =
                    (float)(m[3 * row] * corner[0] + m[3 * row + 1] * corner[1] + m[3 * row + 2] * corner[2]);
        }
    }
    return DONE;
}
