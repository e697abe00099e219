// Put float images over their background, and round them to 8 bits.
#include "film/kernels.h"

namespace {

// Return floor(scaled + 1/2), clamped to [0, 255]; the conversion to an integer rounds down.
INLINE uint8_t to_8_bits(float scaled) { return (uint8_t)(int32_t)least(most(scaled + 0.5f, 0.0f), 255.0f); }

// Rounds colours to 8 bits.
struct Rounding {
    // As in Quantize; null for levels at even distances.
    const float* thresholds;

    // Return the level of a colour; of a colour that is no number, the lowest level.
    INLINE uint8_t operator()(float color) const {
        if (thresholds == nullptr) return to_8_bits(color * 255.0f);
        int level = 0;
        for (int step = 128; step > 0; step /= 2)
            if (color >= thresholds[level + step - 1]) level += step;
        return (uint8_t)level;
    }
};

}  // namespace

// Write an image with three or four channels. With three channels, premultiplied colours c with alpha a are composited
// over the background b of their row: `c + (1 - a) b`. With four, colours are converted to straight alpha: `c / a`.
Status quantize(const Quantize* arguments) {
    const auto [image, background, thresholds, result] = *arguments;
    int64_t num = image.shape[0] * image.shape[1], channels = result.shape[2];
    if (channels < 3 || channels > 4 || result.size() != num * channels) return OUT_OF_BOUNDS;
    if (background.shape[0] != image.shape[0]) return OUT_OF_BOUNDS;
    if (thresholds.exists && thresholds.value.shape[0] != 255) return OUT_OF_BOUNDS;
    const Rounding rounded = {thresholds.exists ? thresholds.value.data : nullptr};
    const float* pixel = image.data;
    uint8_t* to = result.data;
    if (channels == 3) {
        for (int64_t row = 0; row < image.shape[0]; row++) {
            const float red = background(row, 0), green = background(row, 1), blue = background(row, 2);
            for (int64_t k = 0; k < image.shape[1]; k++, pixel += 4, to += 3) {
                float transparency = 1.0f - pixel[3];
                to[0] = rounded(pixel[0] + transparency * red);
                to[1] = rounded(pixel[1] + transparency * green);
                to[2] = rounded(pixel[2] + transparency * blue);
            }
        }
    } else {
        for (int64_t k = 0; k < num; k++, pixel += 4, to += 4) {
            to[3] = to_8_bits(pixel[3] * 255.0f);
            float factor = 255.0f / pixel[3];
            for (int channel = 0; channel < 3; channel++) {
                uint8_t level = rounded.thresholds ? rounded(pixel[channel] / pixel[3]) : to_8_bits(pixel[channel] * factor);
                to[channel] = to[3] > 0 ? level : 0;
            }
        }
    }
    return DONE;
}
