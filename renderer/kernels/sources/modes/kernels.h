// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"
#include "view/kernels.h"

struct MeasureChords {
    RaySetup rays;
    int64_t shape[3], first_row;
    Maybe<Array<const bool, 3>> absent;
    double unit;
    Array<float, 2> lengths;
};
LONG_KERNEL(measure_chords, MeasureChords)

struct ColorShares {
    TransferTable curve;
    Array<const float, 2> shares, chords;
    Sized<const float, 3, 1> brightness;
    Sized<float, 3, 4> image;
};
KERNEL(color_shares, ColorShares)
