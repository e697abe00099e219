// Interpolate images between the pixels of a subsampled grid.
#include "draw/kernels.h"
#include "draw/shown.h"

namespace {

INLINE Pixel pixel_at(const Array<const float, 3>& image, int64_t row, int64_t column) {
    return load<Pixel>(&image(row, column, 0), 0);
}

INLINE Pixel between(float share, Pixel one, Pixel other) { return one + share * (other - one); }

// Return the distance of a row or column of the image from the grid's row or column before it, as a share of the distance
// to the grid's next one.
INLINE float share_of(int64_t rest, int64_t factor) { return (float)((double)rest / (double)factor); }

INLINE bool is_more(Pixel difference, float threshold) { return any_of(mask_of(difference > threshold)); }

// Return whether the grid bends by more than the threshold at a pixel, along its row or column.
INLINE bool bends(const RefineRows& arguments, int64_t row, int64_t column) {
    const auto& grid = arguments.grid;
    auto at = [&](int64_t y, int64_t x) { return shown(pixel_at(grid, y, x), arguments.is_linear); };
    int64_t above = most<int64_t>(row - 1, 0), below = least(row + 1, grid.shape[0] - 1);
    int64_t left = most<int64_t>(column - 1, 0), right = least(column + 1, grid.shape[1] - 1);
    Pixel twice = 2.0f * at(row, column);
    Pixel across = at(row, left) - twice + at(row, right);
    Pixel down = at(above, column) - twice + at(below, column);
    return is_more(max_of(magnitude(across), magnitude(down)), arguments.threshold);
}

template <class Arguments>
bool fits(const Arguments& arguments) {
    const auto &grid = arguments.grid.shape, &image = arguments.image.shape;
    return arguments.factor > 0 && grid[0] * arguments.factor >= image[0] && grid[1] * arguments.factor >= image[1] &&
        0 <= arguments.first_row && arguments.end_row <= image[0];
}

}  // namespace

// Interpolate rows of an image, first between two rows of the grid, then along the row.
Status upsample_rows(const UpsampleRows* arguments) {
    if (!fits(*arguments)) return OUT_OF_BOUNDS;
    const auto [grid, image, factor, first_row, end_row] = *arguments;
    int64_t width = image.shape[1], last_row = grid.shape[0] - 1, last_column = grid.shape[1] - 1;
    for (int64_t row = first_row; row < end_row; row++) {
        int64_t above = row / factor, below = least(above + 1, last_row);
        float down = share_of(row % factor, factor);
        auto in_row = [&](int64_t column) {
            return between(down, pixel_at(grid, above, column), pixel_at(grid, below, column));
        };
        Pixel right = in_row(0);
        for (int64_t column = 0, next = 0; column < width;) {
            Pixel left = right;
            right = in_row(next = least(next + 1, last_column));
            for (int64_t rest = 0; rest < factor && column < width; rest++, column++)
                store(&image(row, column, 0), 0, between(share_of(rest, factor), left, right));
        }
    }
    return DONE;
}

// Interpolate rows of an image, first along rows, and find the pixels that must be drawn instead: pixels between four
// pixels of the grid that differ by more than a threshold, if the grid also bends by more than it at one of the four. Such
// a pixel gets its number in `places`, and 0 in the image; other pixels get -1 in `places`.
Status refine_rows(const RefineRows* arguments) {
    const auto [grid, image, factor, first_row, end_row, threshold, is_linear, places] = *arguments;
    if (!fits(*arguments) || !match(places, image)) return OUT_OF_BOUNDS;
    int64_t num_columns = image.shape[1], last_row = grid.shape[0] - 1, last_column = grid.shape[1] - 1;
    for (int64_t row = first_row; row < end_row; row++) {
        int64_t above = row / factor, below = least(above + 1, last_row);
        float down = share_of(row % factor, factor);
        for (int64_t left = 0, column = 0; column < num_columns; left++) {
            int64_t right = least(left + 1, last_column);
            Pixel upper = pixel_at(grid, above, left), lower = pixel_at(grid, below, left);
            Pixel upper_right = pixel_at(grid, above, right), lower_right = pixel_at(grid, below, right);
            Pixel largest = max_of(max_of(upper, upper_right), max_of(lower, lower_right));
            Pixel smallest = min_of(min_of(upper, upper_right), min_of(lower, lower_right));
            bool differ = is_more(shown(largest, is_linear) - shown(smallest, is_linear), threshold) &&
                (bends(*arguments, above, left) || bends(*arguments, above, right) ||
                 bends(*arguments, below, left) || bends(*arguments, below, right));
            for (int64_t rest = 0; rest < factor && column < num_columns; rest++, column++) {
                float share = share_of(rest, factor);
                bool drawn = differ && (rest > 0 || row % factor > 0);
                Pixel pixel = between(down, between(share, upper, upper_right), between(share, lower, lower_right));
                places(row, column) = drawn ? (int32_t)(row * num_columns + column) : -1;
                store(&image(row, column, 0), 0, drawn ? (Pixel)0.0f : pixel);
            }
        }
    }
    return DONE;
}
