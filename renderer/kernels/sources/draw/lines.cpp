// Draw the lines of an overlay over a picture.
//
// A line is one pixel wide: its opacity falls linearly to 0 at one pixel from its centre, round at the ends.
#include "draw/kernels.h"
#include "base/lanes.h"

namespace {

// The end of a line on the image: column, row, and the number of pixels in a model unit there.
struct End {
    double x, y, scale;
};

// A range of rows or columns of pixels, without its end.
struct Range {
    int64_t first, end;
};

INLINE double clamped(double share) { return least(most(share, 0.0), 1.0); }

// Return the range of pixels, among `size` in a row or column, that a line between two positions may touch.
INLINE Range pixels_near(double one_end, double other_end, int64_t size) {
    double low = __builtin_floor(least(one_end, other_end) - 1.0);
    double high = __builtin_ceil(most(one_end, other_end) + 1.0);
    return {(int64_t)least(most(low, 0.0), (double)size), (int64_t)most(least(high, (double)size), 0.0)};
}

// Draw a line over the image. side: the side of the line's cell, in model units. color: RGBA of the line.
void draw_line(const DrawLines& arguments, End from, End to, double side, const double* color) {
    const auto& image = arguments.image;
    int64_t height = image.shape[0], width = image.shape[1];
    double along_x = to.x - from.x, along_y = to.y - from.y, square = along_x * along_x + along_y * along_y;
    Range rows = pixels_near(from.y, from.y + along_y, height);
    for (int64_t row = rows.first; row < rows.end; row++) {
        double offset_y = row + 0.5 - from.y;
        // The part of the line that is less than a pixel above or below the middle of the row.
        double begin = 0.0, end = 1.0;
        if (along_y != 0.0) begin = clamped((offset_y - 1.0) / along_y), end = clamped((offset_y + 1.0) / along_y);
        Range columns = pixels_near(from.x + begin * along_x, from.x + end * along_x, width);
        for (int64_t column = columns.first; column < columns.end; column++) {
            double offset_x = column + 0.5 - from.x;
            double share = square > 0.0 ? clamped((offset_x * along_x + offset_y * along_y) / square) : 0.0;
            double away_x = offset_x - share * along_x, away_y = offset_y - share * along_y;
            double coverage = 1.0 - __builtin_sqrt(away_x * away_x + away_y * away_y);
            // Scales are interpolated linearly, because inverse depth is linear on the image.
            double side_px = side * (from.scale + share * (to.scale - from.scale));
            if (!(coverage > 0.0 && side_px >= arguments.min_side_px)) continue;
            double alpha = coverage * least(arguments.cover * side * side_px, arguments.opacity);
            float* pixel = &image(row, column, 0);
            for (int channel = 0; channel < 4; channel++)
                pixel[channel] = (float)(pixel[channel] + alpha * (color[channel] - pixel[channel]));
        }
    }
}

}  // namespace

// Project lines, cut off at the near plane, and draw them.
Status draw_lines(const DrawLines* arguments) {
    const auto [vertices, voxel_side, colors, camera, cover, opacity, min_side_px, image] = *arguments;
    for (int64_t i = 0; i < vertices.shape[0]; i++) {
        double ends[2][3], beyond[2];
        for (int k = 0; k < 2; k++) {
            const float* point = &vertices(i, 3 * k);
            for (int row = 0; row < 3; row++) {
                const double* m = camera.view_from_model + 4 * row;
                ends[k][row] = m[0] * point[0] + m[1] * point[1] + m[2] * point[2] + m[3];
            }
            beyond[k] = -ends[k][2] - camera.near;
        }
        if (most(beyond[0], beyond[1]) <= 0.0) continue;
        End ends_px[2];
        for (int k = 0; k < 2; k++) {
            double* end = ends[k];
            if (beyond[k] < 0.0) {
                double share = beyond[k] / (beyond[k] - beyond[1 - k]);
                for (int row = 0; row < 3; row++) end[row] += (ends[1 - k][row] - end[row]) * share;
            }
            double scale = camera.perspective ? camera.scale_px / -end[2] : camera.scale_px;
            ends_px[k] = {camera.center_px[0] + scale * end[0], camera.center_px[1] - scale * end[1], scale};
        }
        int64_t level = (int64_t)vertices(i, 6);
        double side = voxel_side * (double)((int64_t)1 << level);
        if (!(side * most(ends_px[0].scale, ends_px[1].scale) >= min_side_px)) continue;
        draw_line(*arguments, ends_px[0], ends_px[1], side, &colors(least(level, colors.shape[0] - 1), 0));
    }
    return DONE;
}
