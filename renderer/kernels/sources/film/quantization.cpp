// Put float images over their background, and round them to 8 bits.
#include "film/kernels.h"

namespace {

// Return floor(scaled + 1/2), clamped to [0, 255]; the conversion to an integer rounds down.
INLINE uint8_t to_8_bits(float scaled) { return (uint8_t)(int32_t)least(most(scaled + 0.5f, 0.0f), 255.0f); }

}  // namespace

// Write an image with three or four channels. With three channels, premultiplied colours c with alpha a are composited
// over the background b of their row: `c + (1 - a) b`. With four, colours are converted to straight alpha: `c / a`.
Status quantize(const Quantize* arguments) {
    const auto [image, background, result] = *arguments;
    int64_t num = image.shape[0] * image.shape[1], channels = result.shape[2];
    if (channels < 3 || channels > 4 || result.size() != num * channels) return OUT_OF_BOUNDS;
    if (background.shape[0] != image.shape[0]) return OUT_OF_BOUNDS;
    const float* pixel = image.data;
    uint8_t* to = result.data;
    if (channels == 3) {
        for (int64_t row = 0; row < image.shape[0]; row++) {
            const float red = background(row, 0), green = background(row, 1), blue = background(row, 2);
            for (int64_t k = 0; k < image.shape[1]; k++, pixel += 4, to += 3) {
                float transparency = 1.0f - pixel[3];
                to[0] = to_8_bits((pixel[0] + transparency * red) * 255.0f);
                to[1] = to_8_bits((pixel[1] + transparency * green) * 255.0f);
                to[2] = to_8_bits((pixel[2] + transparency * blue) * 255.0f);
            }
        }
    } else {
        for (int64_t k = 0; k < num; k++, pixel += 4, to += 4) {
            to[3] = to_8_bits(pixel[3] * 255.0f);
            float factor = 255.0f / pixel[3];
            for (int channel = 0; channel < 3; channel++)
                to[channel] = to[3] > 0 ? to_8_bits(pixel[channel] * factor) : 0;
        }
    }
    return DONE;
}
