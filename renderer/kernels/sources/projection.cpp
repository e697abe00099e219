// Colour one number of each ray.
#include "transfer.h"

// image: [h, w, 4], the colours of shares [h, w], opaque, times `brightness` [h, w, 1]; 0 where a chord is 0.
Status color_shares(const ColorShares* arguments) {
    const auto [curve, shares, chords, brightness, image] = *arguments;
    const int64_t height = shares.shape[0], width = shares.shape[1];
    if (chords.shape[0] != height || chords.shape[1] != width) return OUT_OF_BOUNDS;
    if (brightness.shape[0] != height || brightness.shape[1] != width || brightness.shape[2] != 1) return OUT_OF_BOUNDS;
    if (image.shape[0] != height || image.shape[1] != width || image.shape[2] != 4) return OUT_OF_BOUNDS;
    for (int64_t row = 0; row < height; row++)
        for (int64_t column = 0; column < width; column++) {
            auto pixel = image[row][column];
            pixel[0] = pixel[1] = pixel[2] = pixel[3] = 0.0f;
            if (!(chords(row, column) > 0.0f)) continue;
            auto [r, g, b, _] = evaluate(curve, shares(row, column));
            float factor = brightness(row, column, 0);
            pixel[0] = (float)r * factor, pixel[1] = (float)g * factor, pixel[2] = (float)b * factor, pixel[3] = 1.0f;
        }
    return DONE;
}
