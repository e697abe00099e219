// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

struct Quantize {
    Sized<const float, 3, 4> image;
    Sized<const float, 2, 3> background;  // of each row
    Array<uint8_t, 3> result;
};
KERNEL(quantize, Quantize)
