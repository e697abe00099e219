// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

struct PlaceSplats {
    Array<const uint8_t, 1> levels, shapes;
    Sized<const int32_t, 2, 3> cells;
    Sized<const float, 2, 4> depths;
    Sized<const double, 2, 3> shift_of_shape;
    Array<const double, 1> area_of_shape;
    double model_from_index[9];
    Sized<float, 2, 8> vertices;
};
KERNEL(place_splats, PlaceSplats)
