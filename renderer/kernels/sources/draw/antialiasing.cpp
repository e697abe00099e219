// Find the pixels that need several rays, by their differences from neighbours, and average the rays of pixels.
#include "draw/kernels.h"
#include "draw/shown.h"

namespace {

// The marks of pixels, as in renderer/draw/bricks/antialiasing.py. A pixel without a mark has one ray.
constexpr uint8_t NOT_MARKED = 0;
// The mark of a pixel that is to get 4 rays.
constexpr uint8_t MARKED_FOR_FEW = 2;
// The mark of a pixel that has its 16 rays.
constexpr uint8_t HAS_MANY = 3;
// The mark of a pixel that is to get 16 rays.
constexpr uint8_t MARKED_FOR_MANY = 4;

INLINE Pixel pixel_at(const Array<const float, 3>& image, int64_t row, int64_t column) {
    return load<Pixel>(&image(row, column, 0), 0);
}

INLINE bool is_more(Pixel difference, float threshold) { return any_of(mask_of(difference > threshold)); }

// Return the colour of a ray, limited to 1 as a display limits it: light that adds up may exceed 1.
INLINE Pixel ray_at(const Array<const float, 2>& rays, int64_t ray) {
    return min_of(load<Pixel>(&rays(ray, 0), 0), Pixel{1, 1, 1, 1});
}

// The least and the largest number of each channel.
struct Extent {
    Pixel low, high;
};

INLINE Extent join_extents(Extent one, Extent other) {
    return {min_of(one.low, other.low), max_of(one.high, other.high)};
}

}  // namespace

// Mark the pixels of some rows that differ by more than a threshold, in a channel, from one of their eight neighbours.
Status mark_contrasts(const MarkContrasts* arguments) {
    const auto [image, threshold, is_linear, first_row, end_row, marks] = *arguments;
    int64_t last_row = image.shape[0] - 1, last_column = image.shape[1] - 1;
    if (!match(marks, image) || first_row < 0 || end_row > image.shape[0]) return OUT_OF_BOUNDS;
    auto shown_at = [&](int64_t row, int64_t column) { return shown(pixel_at(image, row, column), is_linear); };
    for (int64_t row = first_row; row < end_row; row++) {
        auto extent_of_column = [&](int64_t column) {
            Pixel here = shown_at(row, column);
            Pixel above = shown_at(most<int64_t>(row - 1, 0), column);
            Pixel below = shown_at(least(row + 1, last_row), column);
            return Extent{min_of(here, min_of(above, below)), max_of(here, max_of(above, below))};
        };
        Extent left = extent_of_column(0), middle = left;
        for (int64_t column = 0; column <= last_column; column++) {
            Extent right = extent_of_column(least(column + 1, last_column));
            Extent around = join_extents(left, join_extents(middle, right));
            Pixel here = shown_at(row, column);
            if (is_more(max_of(around.high - here, here - around.low), threshold)) marks(row, column) = MARKED_FOR_FEW;
            left = middle, middle = right;
        }
    }
    return DONE;
}

// Mark each neighbour of some pixels that has no mark, and differs from the pixel by more than a threshold in a channel.
Status spread_contrasts(const SpreadContrasts* arguments) {
    const auto [image, threshold, is_linear, pixels, marks] = *arguments;
    int64_t num_rows = image.shape[0], num_columns = image.shape[1];
    if (!match(marks, image)) return OUT_OF_BOUNDS;
    auto shown_at = [&](int64_t row, int64_t column) { return shown(pixel_at(image, row, column), is_linear); };
    for (int64_t k = 0; k < pixels.shape[0]; k++) {
        if (pixels[k] < 0 || pixels[k] >= num_rows * num_columns) return OUT_OF_BOUNDS;
        int64_t row = pixels[k] / num_columns, column = pixels[k] % num_columns;
        Pixel here = shown_at(row, column);
        for (int64_t y = most<int64_t>(row - 1, 0); y <= least(row + 1, num_rows - 1); y++)
            for (int64_t x = most<int64_t>(column - 1, 0); x <= least(column + 1, num_columns - 1); x++)
                if (marks(y, x) == NOT_MARKED && is_more(magnitude(shown_at(y, x) - here), threshold))
                    marks(y, x) = MARKED_FOR_FEW;
    }
    return DONE;
}

// Find the pixels, among some, that lie on a thin line, and mark their neighbours for 16 rays: the line may go on in the
// neighbours, between their few rays. A pixel lies on a line if a channel is larger than in both pixels on opposite sides,
// or smaller than in both, by more than a threshold.
Status follow_lines(const FollowLines* arguments) {
    const auto [image, threshold, is_linear, pixels, marks] = *arguments;
    int64_t num_rows = image.shape[0], num_columns = image.shape[1];
    if (!match(marks, image)) return OUT_OF_BOUNDS;
    auto shown_at = [&](int64_t row, int64_t column) { return shown(pixel_at(image, row, column), is_linear); };
    constexpr int64_t ACROSS[4][2] = {{0, 1}, {1, 0}, {1, 1}, {1, -1}};
    for (int64_t k = 0; k < pixels.shape[0]; k++) {
        if (pixels[k] < 0 || pixels[k] >= num_rows * num_columns) return OUT_OF_BOUNDS;
        int64_t row = pixels[k] / num_columns, column = pixels[k] % num_columns;
        if (row == 0 || column == 0 || row == num_rows - 1 || column == num_columns - 1) continue;
        Pixel here = shown_at(row, column);
        bool is_on_line = false;
        for (auto [down, right] : ACROSS) {
            Pixel one = here - shown_at(row - down, column - right);
            Pixel other = here - shown_at(row + down, column + right);
            is_on_line |= is_more(max_of(min_of(one, other), -max_of(one, other)), threshold);
        }
        if (!is_on_line) continue;
        for (int64_t y = row - 1; y <= row + 1; y++)
            for (int64_t x = column - 1; x <= column + 1; x++)
                if (marks(y, x) < HAS_MANY) marks(y, x) = MARKED_FOR_MANY;
    }
    return DONE;
}

// Write the mean of each pixel's rays, as they are displayed, into a picture, and whether the rays and the colour that the
// pixel had before differ by more than a threshold in a channel: a line may lie under the one ray that gave the pixel its
// colour, and between all rays that follow.
Status average_rays(const AverageRays* arguments) {
    const auto [rays, num_rays, pixels, threshold, is_linear, image, differ] = *arguments;
    if (num_rays < 1 || rays.shape[0] != pixels.shape[0] * num_rays || !match(differ, pixels)) return OUT_OF_BOUNDS;
    for (int64_t k = 0; k < pixels.shape[0]; k++) {
        if (pixels[k] < 0 || pixels[k] >= image.shape[0]) return OUT_OF_BOUNDS;
        Pixel before = min_of(load<Pixel>(&image(pixels[k], 0), 0), Pixel{1, 1, 1, 1});
        Pixel sum = {};
        before = shown(before, is_linear);
        Extent extent = {before, before};
        for (int64_t ray = 0; ray < num_rays; ray++) {
            Pixel one = ray_at(rays, k * num_rays + ray);
            sum += one;
            one = shown(one, is_linear);
            extent = join_extents(extent, {one, one});
        }
        store(&image(pixels[k], 0), 0, sum * (1.0f / (float)num_rays));
        differ[k] = is_more(extent.high - extent.low, threshold);
    }
    return DONE;
}
