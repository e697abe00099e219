// Turn one number of each ray into a colour.
#include "modes/kernels.h"
#include "transfer/transfer.h"

// Write the colour of each ray's number, opaque, times `brightness`. A pixel whose ray misses the volume's box stays 0.
Status color_shares(const ColorShares* arguments) {
    const auto [curve, shares, chords, brightness, image] = *arguments;
    if (!match(shares, chords, brightness, image)) return OUT_OF_BOUNDS;
    for (int64_t row = 0; row < shares.shape[0]; row++)
        for (int64_t column = 0; column < shares.shape[1]; column++) {
            auto pixel = image[row][column];
            pixel[0] = pixel[1] = pixel[2] = pixel[3] = 0.0f;
            if (!(chords(row, column) > 0.0f)) continue;
            auto [r, g, b, _] = evaluate(curve, shares(row, column));
            float factor = brightness(row, column, 0);
            pixel[0] = (float)r * factor, pixel[1] = (float)g * factor, pixel[2] = (float)b * factor, pixel[3] = 1.0f;
        }
    return DONE;
}
