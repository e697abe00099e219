// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"
#include "view/kernels.h"

// Measure the lengths of rays inside the part of the volume's box that clipping leaves.
struct MeasureChords {
    RaySetup rays;
    // The number of voxels of the volume along x, y, z.
    int64_t shape[3];
    // [n, 2]: columns and rows of the rays in the picture, in pixels from its top left corner.
    EACH_CALL Sized<const double, 2, 2> positions_px;
    // [z, y, x]: the voxels without data, which do not count; None if all count.
    Maybe<Array<const bool, 3>> absent;
    // The world length of a model unit.
    double unit;
    // [n]: the world length of each ray inside the volume's box and its clip region; the kernel writes it.
    EACH_CALL Array<float, 1> lengths;
};
LONG_KERNEL(measure_chords, MeasureChords)

// Turn one number of each ray into a colour.
struct ColorShares {
    // The table of colours, as a function of the number of a ray.
    TransferTable curve;
    // [h, w]: the number of each ray.
    EACH_CALL Array<const float, 2> shares;
    // [h, w]: the length of each ray inside the volume's box; a pixel whose ray has length 0 stays empty.
    EACH_CALL Array<const float, 2> chords;
    // [h, w, 1]: a factor on each colour.
    EACH_CALL Sized<const float, 3, 1> brightness;
    // [h, w, 4]: the picture, opaque RGBA.
    EACH_CALL Sized<float, 3, 4> image;
};
KERNEL(color_shares, ColorShares)
