// Read voxels for exact rays (truth_cells.h), in any of the dtypes of volumes.
#include "truth/truth_cells.h"

namespace truth {
namespace {

// The value of `axis` that asks for a voxel's value, and not for a difference along an axis.
constexpr int VALUE = -1;

// The voxels at the corners of a cell, and the voxels around them up to a margin.
struct Surroundings {
    // The number of voxels (x, y, z) of the volume.
    Cell size;
    // The cell whose corners are read.
    Cell cell;
    // The first voxel of the cube that is read.
    Cell first;
    // The number of voxels along each axis of the cube.
    int64_t side;
    // The values of the voxels of the cube, x fastest.
    double numbers[6 * 6 * 6];

    Surroundings(const PlacedVoxels& voxels, Cell at, int64_t margin)
        : size(size_of(voxels)), cell(at), first(at - margin), side(2 + 2 * margin) {
        load_cube(voxels, first, side, numbers);
    }

    INLINE const double* address(Cell voxel) const {
        auto [x, y, z] = voxel - first;
        return numbers + (z * side + y) * side + x;
    }

    // Return a term for a voxel that has data: the scaled central difference at the voxel along an axis, or the voxel's
    // scaled value if the axis is VALUE.
    INLINE double term(Cell voxel, int axis, double scale) const {
        const double* here = address(voxel);
        if (axis == VALUE) return *here * scale;
        int64_t step = axis == 0 ? 1 : axis == 1 ? side : side * side;
        int64_t before = voxel[axis] > 0 && !is_nan(here[-step]);
        int64_t after = voxel[axis] < size[axis] - 1 && !is_nan(here[step]);
        if (before + after == 0) return 0.0;
        return (here[after * step] * scale - here[-before * step] * scale) / (double)(before + after);
    }

    // Return the mean term (scaled difference or value) of the nearest of the 26 neighbours inside the volume that have
    // data; NaN if none has.
    double nearest_term(Cell voxel, int axis, double scale) const {
        auto [x, y, z] = voxel;
        int64_t nearest = 4;  // the squared distance of the nearest voxels so far; no neighbour is as far as 4
        double total = 0.0, num = 0.0;
        for (int64_t k = most<int64_t>(z - 1, 0); k < least(z + 2, size.z); k++)
            for (int64_t j = most<int64_t>(y - 1, 0); j < least(y + 2, size.y); j++)
                for (int64_t i = most<int64_t>(x - 1, 0); i < least(x + 2, size.x); i++) {
                    int64_t distance = (k - z) * (k - z) + (j - y) * (j - y) + (i - x) * (i - x);
                    if (distance > nearest || is_nan(*address({i, j, k}))) continue;
                    if (distance < nearest) nearest = distance, total = num = 0.0;
                    total += term({i, j, k}, axis, scale), num += 1.0;
                }
        return total / num;
    }

    // Return the term (scaled difference or value) of the voxel at a corner of the cell or, if the voxel has no data,
    // the mean term of the nearest voxels with data. k: the number of the corner, x fastest. absent: the corners
    // without data, one bit for each.
    INLINE double corner_term(int k, int absent, int axis, double scale) const {
        Cell at = cell + Cell{k & 1, k >> 1 & 1, k >> 2};
        for (int j = 0; j < 3; j++) at[j] = least(most<int64_t>(at[j], 0), size[j] - 1);
        return absent >> k & 1 ? nearest_term(at, axis, scale) : term(at, axis, scale);
    }
};

}  // namespace

void load_cube(const PlacedVoxels& voxels, Cell first, int64_t side, double* out) {
    int64_t places[3][LARGEST_CUBE];
    for (int64_t k = 0; k < side; k++) {
        auto [x, y, z] = nearest_inside(first + k, size_of(voxels));
        places[0][k] = voxels.x[x], places[1][k] = voxels.y[y], places[2][k] = voxels.z[z];
    }
    with_array(voxels.values, [&](const auto& values) {
        for (int64_t z = 0; z < side; z++)
            for (int64_t y = 0; y < side; y++)
                for (int64_t x = 0; x < side; x++) *out++ = (double)values[places[2][z] + places[1][y] + places[0][x]];
        return DONE;
    });
}

int load_corners(const PlacedVoxels& voxels, Cell cell, double scale, double* corners) {
    const Cell size = size_of(voxels), low = nearest_inside(cell, size), high = nearest_inside(cell + 1, size);
    const int64_t xs[2] = {voxels.x[low.x], voxels.x[high.x]};
    const int64_t ys[2] = {voxels.y[low.y], voxels.y[high.y]};
    const int64_t zs[2] = {voxels.z[low.z], voxels.z[high.z]};
    with_array(voxels.values, [&](const auto& values) {
        for (int k = 0; k < 8; k++) corners[k] = (double)values[zs[k >> 2] + ys[k >> 1 & 1] + xs[k & 1]];
        return DONE;
    });
    int absent = 0;
    for (int k = 0; k < 8; k++) absent |= is_nan(corners[k]) << k;
    if (absent == 0) {
        for (int k = 0; k < 8; k++) corners[k] *= scale;
    } else if (absent != ALL_ABSENT) {
        const Surroundings around(voxels, cell, 1);
        for (int k = 0; k < 8; k++) corners[k] = around.corner_term(k, absent, VALUE, scale);
    }
    return absent;
}

void load_differences(const PlacedVoxels& voxels, Cell cell, int absent, double scale, double (*corners)[8]) {
    const Surroundings around(voxels, cell, absent == 0 ? 1 : 2);
    for (int k = 0; k < 8; k++)
        for (int axis = 0; axis < 3; axis++) corners[axis][k] = around.corner_term(k, absent, axis, scale);
}

Range macrocell_range(const PlacedVoxels& voxels, Cell macrocell) {
    double numbers[LARGEST_CUBE * LARGEST_CUBE * LARGEST_CUBE];
    bool has_absent = false;
    auto range_around = [&](int64_t margin) {
        int64_t side = MACROCELL_SIZE + 1 + 2 * margin;
        load_cube(voxels, MACROCELL_SIZE * macrocell - 1 - margin, side, numbers);
        Range found = {INFINITE, -INFINITE};
        for (int64_t k = 0; k < side * side * side; k++) {
            has_absent |= is_nan(numbers[k]);
            found = {least(found.low, numbers[k]), most(found.high, numbers[k])};  // NaN has no effect
        }
        return found;
    };
    Range found = range_around(0);
    return has_absent ? range_around(1) : found;
}

}  // namespace truth
