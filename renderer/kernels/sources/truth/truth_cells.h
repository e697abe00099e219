// Find the cells along a ray, and the voxels at their corners.
//
// A *cell* is the box between eight voxel centres, or its outward extension over the outer half voxel, where the field
// takes the nearest value. Each octant of a cell belongs to the voxel at its corner. The octant of a voxel without
// data, NaN, is empty; at its corner, the field takes the mean of the nearest of the voxel's 26 neighbours that have
// data.
#pragma once
#include "truth/kernels.h"
#include "truth/truth_cubic.h"

namespace truth {

// The number of cells along each axis of a macrocell, as in renderer/truth/optics.py. Of the cells that rays met in
// visible macrocells of two CT scans, 0.70 and 0.75 were visible; in macrocells of 8^3 cells, 0.51 and 0.60.
constexpr int64_t MACROCELL_SIZE = 4;
// The largest number of voxels along each axis of a cube of voxels that is read at once.
constexpr int64_t LARGEST_CUBE = 8;
// The set of a cell's corners without data if no corner has data. There is one bit for each corner, x fastest.
constexpr int ALL_ABSENT = 255;

// The number of a cell, or of a voxel, along x, y, z.
using Cell = int64_t __attribute__((ext_vector_type(3)));

// A range of numbers, from `low` to `high`; empty if `low` is above `high`.
struct Range {
    double low;
    double high;
};

INLINE Cell size_of(const PlacedVoxels& voxels) {
    return {voxels.x.shape[0], voxels.y.shape[0], voxels.z.shape[0]};
}

// Return whether the places of all voxels are inside of the array.
INLINE bool fit(const PlacedVoxels& voxels) {
    auto [x, y, z] = size_of(voxels) - 1;
    return least(least(x, y), z) >= 0 && voxels.z[z] + voxels.y[y] + voxels.x[x] < voxels.values.shape[0];
}

INLINE Cell nearest_inside(Cell voxel, Cell size) {
    return __builtin_elementwise_min(__builtin_elementwise_max(voxel, Cell{0, 0, 0}), size - 1);
}

// Write the values of side^3 voxels from `first` on, x fastest; beyond the border the nearest voxel is repeated.
//
// side: at most LARGEST_CUBE.
void load_cube(const PlacedVoxels& voxels, Cell first, int64_t side, double* out);

// Write the scaled values at the corners of a cell, clamped to the volume; a corner without data takes the mean of the
// nearest voxels with data. Return the corners without data: the bit x + 2 y + 4 z of each is set. If all bits are set,
// no value has a meaning.
int load_corners(const PlacedVoxels& voxels, Cell cell, double scale, double* corners);

// Write the scaled central differences of the voxels along x, y, z at the corners of a cell. absent: the corners
// without data, one bit for each, x fastest.
//
// Differences are one-sided at the border and beside voxels without data, and 0 along an axis of one voxel.
void load_differences(const PlacedVoxels& voxels, Cell cell, int absent, double scale, double (*corners)[8]);

// Return the range of the values of the voxels at the corners of a macrocell's cells, the first of which is the cell
// MACROCELL_SIZE * macrocell - 1. The range is empty if no voxel has data. If any voxel has no data, the voxels around
// the macrocell count, too, because the field takes their mean.
Range macrocell_range(const PlacedVoxels& voxels, Cell macrocell);

// Return whether the voxel nearest to entry + extent * t, in cell coordinates, has no data.
INLINE bool is_octant_absent(int absent, Point entry, Point extent, double t) {
    auto [x, y, z] = entry + t * extent;
    return absent >> ((x >= 0.5) + 2 * (y >= 0.5) + 4 * (z >= 0.5)) & 1;
}

// Add to the first `count` splits, which ascend, the positions at which another corner becomes the nearest. Return the
// new number of splits.
inline int64_t add_middles(Point entry, Point extent, const Array<double, 1>& splits, int64_t count) {
    for (int axis = 0; axis < 3; axis++)
        if (extent[axis] != 0.0) count = insert_split(splits, count, (0.5 - entry[axis]) / extent[axis]);
    return count;
}

inline bool fit(const IndexRays& rays) {
    const auto& [origins, directions, parts, removed] = rays;
    int64_t num = parts.shape[0];
    return has_shape(origins, num, 3) && has_shape(directions, num, 3) && parts.shape[2] == 2;
}

// The part of a ray inside a cell: the points entry + extent * t in cell coordinates, with t from 0 to 1.
struct Segment {
    // The cell in which the segment lies.
    Cell cell;
    // The macrocell (a block of 4^3 cells) in which the cell lies.
    Cell macrocell;
    // The length along the ray at which the segment starts.
    double start;
    // The length along the ray at which the segment ends.
    double end;
    // The point at which the ray enters the cell, relative to the cell's lowest corner, in voxels.
    Point entry;
    // The vector from the segment's start to its end, in voxels.
    Point extent;
};

// Return the length along a ray at which it leaves a cell along one axis. It is computed from the cell's number, so
// that rounding errors do not add up from cell to cell.
INLINE double distance_to_plane(int64_t cell, double origin, double direction) {
    if (direction == 0.0) return INFINITE;
    return ((double)(cell + (direction > 0.0)) - origin) / direction;
}

// Return the part of a ray, between the lengths `start` and `end`, that lies inside the volume: inside [-1/2, n - 1/2]
// on each axis. The part is empty unless low < high.
INLINE Range clip_to_volume(Cell size, Point origin, Point direction, double start, double end) {
    for (int axis = 0; axis < 3; axis++) {
        double low = -0.5 - origin[axis], high = (double)size[axis] - 0.5 - origin[axis];
        if (direction[axis] == 0.0) {
            if (!(low <= 0.0 && 0.0 < high)) start = 0.0, end = -INFINITE;
            continue;
        }
        double one = low / direction[axis], two = high / direction[axis];
        start = most(start, least(one, two)), end = least(end, most(one, two));
    }
    return {start, end};
}

// A walk from cell to cell along a part of a ray.
struct CellWalk {
    // The origin of the ray, in index space.
    Point origin;
    // The direction of the ray, in index space, of unit length in the world.
    Point direction;
    // The length along the ray at which the next cell begins.
    double s;
    // The length along the ray at which the walk ends.
    double last;
    // The lengths along the ray at which the ray leaves the next cell along x, y and z.
    double to_x, to_y, to_z;
    // The number of the next cell on the ray, along x, y and z.
    int64_t x, y, z;

    INLINE CellWalk(Cell size, Point from, Point along, double start, double end) : origin(from), direction(along) {
        auto part = clip_to_volume(size, origin, direction, start, end);
        s = part.low, last = part.high;
        if (!(s < last)) return;
        auto first_cell = [&](int axis) __attribute__((always_inline)) {
            double at = origin[axis] + s * direction[axis];
            return least(most<int64_t>((int64_t)__builtin_floor(at), -1), size[axis] - 1);
        };
        x = first_cell(0), y = first_cell(1), z = first_cell(2);
        to_x = exit(0, x), to_y = exit(1, y), to_z = exit(2, z);
    }

    INLINE double exit(int axis, int64_t cell) const { return distance_to_plane(cell, origin[axis], direction[axis]); }

    // Return whether there is a further cell on the ray. If so, write the part of the ray inside it to `segment`.
    INLINE bool next(Segment& segment) {
        if (!(s < last)) return false;
        double s_exit = least(most(least(least(to_x, to_y), to_z), s), last);
        Point entry = origin + s * direction - Point{(double)x, (double)y, (double)z};
        Cell macrocell = {(x + 1) / MACROCELL_SIZE, (y + 1) / MACROCELL_SIZE, (z + 1) / MACROCELL_SIZE};
        segment = {{x, y, z}, macrocell, s, s_exit, entry, (s_exit - s) * direction};
        s = s_exit;
        if (to_x <= to_y && to_x <= to_z) x += direction.x > 0.0 ? 1 : -1, to_x = exit(0, x);
        else if (to_y <= to_z) y += direction.y > 0.0 ? 1 : -1, to_y = exit(1, y);
        else z += direction.z > 0.0 ? 1 : -1, to_z = exit(2, z);
        return true;
    }
};

// Return whether an array has one number for each macrocell.
template <class T>
bool fits_macrocells(const Array<T, 3>& array, const PlacedVoxels& voxels) {
    auto [x, y, z] = size_of(voxels) / MACROCELL_SIZE + 1;
    return has_shape(array, z, y, x);
}

}  // namespace truth
