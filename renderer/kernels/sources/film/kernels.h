// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// Put an image over its background, and round it to 8 bits.
struct Quantize {
    // [h, w, 4]: the image, premultiplied RGBA.
    Sized<const float, 3, 4> image;
    // [h, 3]: the background colour of each row.
    Sized<const float, 2, 3> background;
    // [255]: the colours from which on each level above 0 is shown, ascending; None for levels at even distances.
    Maybe<Array<const float, 1>> thresholds;
    // [h, w, 3]: the image over its background; or [h, w, 4]: the image without a background, with straight alpha.
    Array<uint8_t, 3> result;
};
KERNEL(quantize, Quantize)
