// Find the label at a point, where it changes along a ray, and the gradient that gives labels light (truth_labels.h).
#include "truth_labels.h"

namespace truth {
namespace {

// How exactly changes are found, as a share of the part of a ray inside a cell; and how short may be what is missed.
constexpr double TOLERANCE = 1e-12, LEAST_WIDTH = 0x1p-8;
// The sum of the magnitudes of all weights' slopes, along one axis.
constexpr double LARGEST_SLOPE = 2.0;
// How much a weight has of a tent; the rest is of a quadratic B-spline.
constexpr double TENT = 0.2, SPLINE = 1.0 - TENT;

// Write the weights of the voxels before, at and after the nearest one, at a distance from it.
INLINE void write_weights(double t, double* weights) {
    weights[0] = TENT * most(-t, 0.0) + SPLINE * 0.5 * (0.5 - t) * (0.5 - t);
    weights[1] = TENT * (1.0 - absolute(t)) + SPLINE * (0.75 - t * t);
    weights[2] = TENT * most(t, 0.0) + SPLINE * 0.5 * (0.5 + t) * (0.5 + t);
}

// Smooth lines of 8 by (1, 4, 6, 4, 1) / 16: the 4 in the middle of each remain, the next axis is along the lines.
void smooth(const double* in, int64_t num_lines, double* out) {
    for (int k = 0; k < 4; k++)
        for (int64_t line = 0; line < num_lines; line++) {
            const double* from = in + 8 * line + k;
            *out++ = (from[0] + from[4] + 4.0 * (from[1] + from[3]) + 6.0 * from[2]) / 16.0;
        }
}

// A search for the places where another label wins. max_slope: of a lead.
struct ChangeSearch {
    const LabelCell& cell;
    Point entry, extent;
    double max_slope;
    Array<double, 1> splits;
    int64_t num_splits, num_found = 0;

    LabelPlace at(double t) const { return cell.winner_at(entry, extent, t); }

    void search(LabelPlace low, LabelPlace high) {
        const double width = high.t - low.t;
        const bool is_same = low.number == high.number;
        if (is_same && (low.lead + high.lead > max_slope * width || width < LEAST_WIDTH)) return;
        if (num_found == MAX_LABEL_CHANGES) return;
        if (width < TOLERANCE) {
            num_splits = insert_split(splits, num_splits, high.t), num_found++;
            return;
        }
        const LabelPlace middle = at(0.5 * (low.t + high.t));
        search(low, middle), search(middle, high);
    }
};

}  // namespace

void LabelCell::load(const AnyArray<3>& values, Cell cell) {
    load_cube(values, cell - 1, 4, numbers);
    for (int k = 0; k < 64; k++)
        for (first[k] = 0; numbers[first[k]] != numbers[k];) first[k]++;
}

LabelPlace LabelCell::winner_at(Point entry, Point extent, double t) const {
    const Point point = entry + t * extent;
    double weights[3][3], sums[64] = {};
    int before = 0;
    for (int axis = 0; axis < 3; axis++) {
        int nearest = point[axis] >= 0.5;
        write_weights(point[axis] - nearest, weights[axis]);
        before += nearest << 2 * axis;
    }
    auto for_all = [&](auto use) {
        for (int z = 0; z < 3; z++)
            for (int y = 0; y < 3; y++)
                for (int x = 0; x < 3; x++)
                    use(first[before + 16 * z + 4 * y + x], weights[2][z] * weights[1][y] * weights[0][x]);
    };
    for_all([&](int one, double weight) { sums[one] += weight; });
    int winner = first[before + 16 + 4 + 1];
    for_all([&](int one, double) {
        if (sums[one] > sums[winner]) winner = one;
    });
    double next = 0.0;
    for_all([&](int one, double) {
        if (one != winner) next = most(next, sums[one]);
    });
    return {t, numbers[winner], sums[winner] - next};
}

int64_t LabelCell::add_changes(Point entry, Point extent, const Array<double, 1>& splits) const {
    int64_t num_middles = add_middles(entry, extent, splits, 0);
    double ends[5] = {0.0, 1.0, 1.0, 1.0, 1.0};
    for (int64_t k = 0; k < num_middles; k++) ends[k + 1] = splits[k];
    const double along = absolute(extent.x) + absolute(extent.y) + absolute(extent.z);
    ChangeSearch found = {*this, entry, extent, LARGEST_SLOPE * along, splits, num_middles};
    for (int64_t part = 0; part <= num_middles; part++) {
        // Not at the very ends, where two often have the same sum.
        double low = ends[part] + TOLERANCE, high = ends[part + 1] - TOLERANCE;
        if (low < high) found.search(found.at(low), found.at(high));
    }
    return found.num_splits;
}

void load_label_differences(const AnyArray<3>& values, Cell cell, const Array<const double, 1>& opacities,
                            double (*corners)[8]) {
    double cube[8 * 8 * 8], along_x[4 * 8 * 8], along_y[4 * 4 * 8], smoothed[4 * 4 * 4];
    load_cube(values, cell - 3, 8, cube);
    const Cell size = size_of(values);
    for (int k = 0; k < 512; k++) {
        Cell voxel = cell - 3 + Cell{k & 7, k >> 3 & 7, k >> 6};
        bool is_inside = true;
        for (int axis = 0; axis < 3; axis++) is_inside &= 0 <= voxel[axis] && voxel[axis] < size[axis];
        cube[k] = is_inside ? opacities[least((int64_t)cube[k], opacities.shape[0] - 1)] : 0.0;
    }
    smooth(cube, 8 * 8, along_x), smooth(along_x, 4 * 8, along_y), smooth(along_y, 4 * 4, smoothed);
    for (int k = 0; k < 8; k++) {
        Cell at = {k & 1, k >> 1 & 1, k >> 2};
        for (int axis = 0; axis < 3; axis++) {
            // As beyond the border, where the nearest voxel counts; and one, as the first is before the cell.
            at[axis] = least(most<int64_t>(cell[axis] + at[axis], 0), size[axis] - 1) - cell[axis] + 1;
        }
        const double* here = smoothed + 16 * at.z + 4 * at.y + at.x;
        for (int axis = 0; axis < 3; axis++)
            corners[axis][k] = (here[1 << 2 * axis] - here[-(1 << 2 * axis)]) / 2.0;
    }
}

}  // namespace truth
