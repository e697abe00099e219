// The colours of pixels as a display shows them.
#pragma once
#include "base/lanes.h"

// A pixel: premultiplied RGBA.
using Pixel = Vector<float, 4>;

// Return a pixel by whose differences pixels are compared. Of linear light it has the square roots, which are within 0.04
// of sRGB from black to white.
INLINE Pixel shown(Pixel pixel, bool is_linear) {
    if (!is_linear) return pixel;
    Pixel encoded = root(max_of(pixel, Pixel{}));
    encoded[3] = pixel[3];
    return encoded;
}
