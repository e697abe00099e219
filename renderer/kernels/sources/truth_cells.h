// Find the cells along a ray, and the voxels at their corners.
//
// A *cell* is the box between eight voxel centres, or its outward extension over the outer half voxel, where the field
// takes the nearest value. Each octant of a cell belongs to the voxel at its corner: that of a voxel without data, NaN,
// is empty. At such a corner the field takes the mean of the nearest of its 26 neighbours with data, as beyond the
// border.
#pragma once
#include "kernels.h"
#include "truth_cubic.h"

namespace truth {

// Cells along each axis of a macrocell, as in renderer/truth/optics.py. Of the cells that rays met in visible
// macrocells of two CT scans, 0.70 and 0.75 were visible; in macrocells of 8^3, 0.51 and 0.60.
constexpr int64_t MACROCELL_SIZE = 4;
// All corners of a cell, a bit each, x fastest.
constexpr int ALL_ABSENT = 255;
// In place of an axis: the voxel itself, and not a difference.
constexpr int VALUE = -1;

struct Cell {
    int64_t x, y, z;
};

struct Range {
    double low, high;
};

INLINE bool is_nan(double x) {
    return x != x;
}

// A voxel's value, or the central difference at it along an axis; both scaled. Of a voxel that has data.
//
// Differences are one-sided at the border and beside voxels without data, and 0 along an axis of one voxel.
template <class T>
INLINE double voxel_term(const Array<const T, 3>& values, Cell at, int axis, double scale) {
    auto [x, y, z] = at;
    if (axis == VALUE) return (double)values(z, y, x) * scale;
    auto [num_z, num_y, num_x] = values.shape;
    int64_t dx = axis == 0, dy = axis == 1, dz = axis == 2;
    Cell from = {most<int64_t>(x - dx, 0), most<int64_t>(y - dy, 0), most<int64_t>(z - dz, 0)};
    Cell to = {least(x + dx, num_x - 1), least(y + dy, num_y - 1), least(z + dz, num_z - 1)};
    if (is_nan((double)values(from.z, from.y, from.x))) from = at;
    if (is_nan((double)values(to.z, to.y, to.x))) to = at;
    int64_t steps = (to.x - from.x) + (to.y - from.y) + (to.z - from.z);
    if (steps == 0) return 0.0;
    double first = (double)values(from.z, from.y, from.x) * scale, last = (double)values(to.z, to.y, to.x) * scale;
    return (last - first) / (double)steps;
}

// The mean term of the nearest voxels with data, of 26 neighbours inside the volume; NaN for none.
template <class T>
double nearest_term(const Array<const T, 3>& values, Cell at, int axis, double scale) {
    auto [num_z, num_y, num_x] = values.shape;
    int64_t nearest = 4;  // the squared distance
    double total = 0.0, num = 0.0;
    for (int64_t k = most<int64_t>(at.z - 1, 0); k < least(at.z + 2, num_z); k++)
        for (int64_t j = most<int64_t>(at.y - 1, 0); j < least(at.y + 2, num_y); j++)
            for (int64_t i = most<int64_t>(at.x - 1, 0); i < least(at.x + 2, num_x); i++) {
                int64_t distance = (k - at.z) * (k - at.z) + (j - at.y) * (j - at.y) + (i - at.x) * (i - at.x);
                if (distance > nearest || is_nan((double)values(k, j, i))) continue;
                if (distance < nearest) nearest = distance, total = num = 0.0;
                total += voxel_term(values, {i, j, k}, axis, scale), num += 1.0;
            }
    return total / num;
}

// A volume of some dtype, of which cells are read by functions for that dtype.
struct Voxels {
    AnyArray<3> any;
    int (*load)(const AnyArray<3>& any, Cell cell, int axis, double scale, double* corners);
    Range (*range)(const AnyArray<3>& any, Cell macrocell);

    INLINE Cell size() const { return {any.shape[2], any.shape[1], any.shape[0]}; }

    // Write the terms of the voxels at the corners of a cell, clamped to the volume, or of the nearest ones of those
    // without data, and return which have no data: the bit x + 2 y + 4 z of each is set. If all, nothing is written.
    INLINE int load_corners(Cell cell, int axis, double scale, double* corners) const {
        return load(any, cell, axis, scale, corners);
    }

    // The range of the voxels around macrocell (x, y, z), from cell MACROCELL_SIZE * x - 1; empty if none has data.
    // With voxels without data, their neighbours count, too.
    INLINE Range macrocell_range(Cell macrocell) const { return range(any, macrocell); }
};

template <class T>
Array<const T, 3> array_of(const AnyArray<3>& any) {
    return {(const T*)any.data, {any.shape[0], any.shape[1], any.shape[2]}};
}

template <class T>
int load_corners_of(const AnyArray<3>& any, Cell cell, int axis, double scale, double* corners) {
    const auto values = array_of<T>(any);
    int64_t x[2] = {most<int64_t>(cell.x, 0), least(cell.x + 1, values.shape[2] - 1)};
    int64_t y[2] = {most<int64_t>(cell.y, 0), least(cell.y + 1, values.shape[1] - 1)};
    int64_t z[2] = {most<int64_t>(cell.z, 0), least(cell.z + 1, values.shape[0] - 1)};
    int absent = 0;
    for (int k = 0; k < 8; k++) absent |= is_nan((double)values(z[k >> 2], y[k >> 1 & 1], x[k & 1])) << k;
    if (absent == ALL_ABSENT) return absent;
    for (int k = 0; k < 8; k++) {
        Cell at = {x[k & 1], y[k >> 1 & 1], z[k >> 2]};
        bool is_absent = absent >> k & 1;
        corners[k] = is_absent ? nearest_term(values, at, axis, scale) : voxel_term(values, at, axis, scale);
    }
    return absent;
}

template <class T>
Range macrocell_range_of(const AnyArray<3>& any, Cell macrocell) {
    const auto values = array_of<T>(any);
    bool has_absent = false;
    auto range_around = [&](int64_t margin) {
        auto first = [&](int64_t at) { return most<int64_t>(at * MACROCELL_SIZE - 1 - margin, 0); };
        auto end = [&](int64_t at, int axis) { return least((at + 1) * MACROCELL_SIZE + margin, values.shape[axis]); };
        Range found = {__builtin_inf(), -__builtin_inf()};
        for (int64_t z = first(macrocell.z); z < end(macrocell.z, 0); z++)
            for (int64_t y = first(macrocell.y); y < end(macrocell.y, 1); y++)
                for (int64_t x = first(macrocell.x); x < end(macrocell.x, 2); x++) {
                    double value = (double)values(z, y, x);
                    has_absent |= is_nan(value);
                    found = {least(found.low, value), most(found.high, value)};  // which NaN leaves
                }
        return found;
    };
    Range found = range_around(0);
    return has_absent ? range_around(1) : found;
}

// Call a function with the Voxels of a volume.
template <class Function>
Status with_voxels(const AnyArray<3>& any, Function function) {
    Voxels voxels = {any, nullptr, nullptr};
    Status known = with_array(any, [&]<class T>(const Array<const T, 3>&) {
        voxels.load = load_corners_of<T>, voxels.range = macrocell_range_of<T>;
        return DONE;
    });
    return known == DONE ? function(voxels) : known;
}

// Whether the voxel nearest to entry + extent * t, in cell coordinates, has no data.
INLINE bool is_octant_absent(int absent, Point entry, Point extent, double t) {
    double x = entry.x + t * extent.x, y = entry.y + t * extent.y, z = entry.z + t * extent.z;
    return absent >> ((x >= 0.5) + 2 * (y >= 0.5) + 4 * (z >= 0.5)) & 1;
}

// Add where another corner becomes the nearest to the first `count` splits, which ascend; return the new count.
inline int64_t add_middles(Point entry, Point extent, const Array<double, 1>& splits, int64_t count) {
    if (extent.x != 0.0) count = insert_split(splits, count, (0.5 - entry.x) / extent.x);
    if (extent.y != 0.0) count = insert_split(splits, count, (0.5 - entry.y) / extent.y);
    if (extent.z != 0.0) count = insert_split(splits, count, (0.5 - entry.z) / extent.z);
    return count;
}

inline bool fit(const IndexRays& rays) {
    const auto& [origins, directions, parts] = rays;
    return origins.shape[0] == parts.shape[0] && origins.shape[1] == 3 && directions.shape[0] == parts.shape[0] &&
        directions.shape[1] == 3 && parts.shape[2] == 2;
}

INLINE Point point_of(const Array<const double, 1>& row) {
    return {row[0], row[1], row[2]};
}

// The part of a ray inside a cell, between two lengths along it: entry + extent * t in cell coordinates.
struct Segment {
    Cell cell, macrocell;
    double start, end;
    Point entry, extent;
};

// Where a ray leaves a cell along one axis, from the cell's number, so that rounding does not add up.
INLINE double distance_to_plane(int64_t cell, double origin, double direction) {
    if (direction == 0.0) return __builtin_inf();
    return ((double)(cell + (direction > 0.0)) - origin) / direction;
}

// The part from `start` to `end` of a ray inside [-1/2, n - 1/2] on each axis; empty unless low < high.
INLINE Range clip_to_volume(Cell size, Point origin, Point direction, double start, double end) {
    auto clip = [&](double from, double towards, int64_t num) {
        double low = -0.5 - from, high = (double)num - 0.5 - from;
        if (towards == 0.0) {
            if (!(low <= 0.0 && 0.0 < high)) start = 0.0, end = -__builtin_inf();
            return;
        }
        double one = low / towards, two = high / towards;
        start = most(start, least(one, two)), end = least(end, most(one, two));
    };
    clip(origin.x, direction.x, size.x), clip(origin.y, direction.y, size.y), clip(origin.z, direction.z, size.z);
    return {start, end};
}

// Visit the cells of a part of a ray one behind the other, until `visit` returns false.
template <class Visit>
INLINE void walk_cells(Cell size, Point origin, Point direction, double start, double end, Visit visit) {
    auto [s, last] = clip_to_volume(size, origin, direction, start, end);
    if (!(s < last)) return;
    auto [ox, oy, oz] = origin;
    auto [dx, dy, dz] = direction;
    auto first_cell = [](double at, int64_t num) {
        return least(most<int64_t>((int64_t)__builtin_floor(at), -1), num - 1);
    };
    auto [x, y, z] = Cell{first_cell(ox + s * dx, size.x), first_cell(oy + s * dy, size.y),
                          first_cell(oz + s * dz, size.z)};
    double to_x = distance_to_plane(x, ox, dx), to_y = distance_to_plane(y, oy, dy);
    double to_z = distance_to_plane(z, oz, dz);
    while (s < last) {
        double s_exit = least(most(least(least(to_x, to_y), to_z), s), last);
        double length = s_exit - s;
        Cell macrocell = {(x + 1) / MACROCELL_SIZE, (y + 1) / MACROCELL_SIZE, (z + 1) / MACROCELL_SIZE};
        Point entry = {ox + s * dx - (double)x, oy + s * dy - (double)y, oz + s * dz - (double)z};
        if (!visit(Segment{{x, y, z}, macrocell, s, s_exit, entry, {length * dx, length * dy, length * dz}})) return;
        s = s_exit;
        if (to_x <= to_y && to_x <= to_z) x += dx > 0.0 ? 1 : -1, to_x = distance_to_plane(x, ox, dx);
        else if (to_y <= to_z) y += dy > 0.0 ? 1 : -1, to_y = distance_to_plane(y, oy, dy);
        else z += dz > 0.0 ? 1 : -1, to_z = distance_to_plane(z, oz, dz);
    }
}

// Whether an array has a number for each macrocell.
template <class T>
bool fits_macrocells(const Array<T, 3>& array, const AnyArray<3>& values) {
    bool fits = true;
    for (int axis = 0; axis < 3; axis++) fits &= array.shape[axis] == values.shape[axis] / MACROCELL_SIZE + 1;
    return fits;
}

}  // namespace truth
