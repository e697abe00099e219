// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// Place a splat at each cell of a cut.
struct PlaceSplats {
    // [n]: the octree level of each cell of the cut.
    Array<const uint8_t, 1> levels;
    // [n]: the number of each cell's shape. Cells of one level that the volume's border cuts alike have one shape.
    Array<const uint8_t, 1> shapes;
    // [n, 3]: the place (x, y, z) of each cell, in widths of the cell.
    Sized<const int32_t, 2, 3> cells;
    // [n, 4]: the mean (tau c, tau) of each cell, multiplied by the finest voxel spacing.
    Sized<const float, 2, 4> depths;
    // [shapes, 3]: the vector (x, y, z) in voxels that, added to the place of a cell's first voxel, gives the cell's
    // centre relative to the volume's centre.
    Sized<const double, 2, 3> shift_of_shape;
    // [shapes]: the optical area, the integral of a splat's footprint, of a cell whose mean depth is 1, in squared
    // model units (a model unit is half the volume's diagonal).
    Array<const double, 1> area_of_shape;
    // [3, 3]: the matrix from vectors in voxels to vectors in world axes, in model units (half the volume's diagonal).
    double model_from_index[9];
    // [n, 8]: the vertices of the splats, as in SplatBatch (renderer/splats/splats.py).
    Sized<float, 2, 8> vertices;
};
KERNEL(place_splats, PlaceSplats)
