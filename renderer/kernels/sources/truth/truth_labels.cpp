// Find the label at a point, where it changes along a ray, and the gradient that gives labels light (truth_labels.h).
#include "truth/truth_labels.h"

namespace truth {
namespace {

// The largest error of a position at which the label changes, as a share of the length of a segment.
constexpr double TOLERANCE = 1e-12;
// A label that wins only on a part of a segment shorter than this, as a share of the segment's length, may be missed.
constexpr double LEAST_WIDTH = 0x1p-8;
// The largest sum of the magnitudes of the slopes of weights along an axis: one label's lead over another changes no
// faster. If the same label wins at two positions, and its leads there are too large to be lost in between, no other
// label wins between the positions.
constexpr double LARGEST_SLOPE = 2.0;

// Write the weights of the voxels before, at and after the nearest voxel, for a point at a distance of t from the
// nearest.
INLINE void write_weights(double t, double* weights) {
    weights[0] = 0.2 * most(-t, 0.0) + 0.4 * (0.5 - t) * (0.5 - t);
    weights[1] = 0.2 * (1.0 - absolute(t)) + 0.8 * (0.75 - t * t);
    weights[2] = 0.2 * most(t, 0.0) + 0.4 * (0.5 + t) * (0.5 + t);
}

// Smooth rows of 8 numbers by (1, 4, 6, 4, 1) / 16. Each row keeps 4 numbers, and the next axis comes to lie along the
// rows.
void smooth(const double* in, int64_t num_lines, double* out) {
    for (int k = 0; k < 4; k++)
        for (int64_t line = 0; line < num_lines; line++) {
            const double* from = in + 8 * line + k;
            *out++ = (from[0] + from[4] + 4.0 * (from[1] + from[3]) + 6.0 * from[2]) / 16.0;
        }
}

}  // namespace

LabelSegment::Winner LabelSegment::winner_at(double t) const {
    const Point point = entry + t * extent;
    double along[3][3], sums[64] = {}, next = 0.0;
    int before = 0, of[27];
    for (int axis = 0; axis < 3; axis++) {
        int nearest = point[axis] >= 0.5;
        write_weights(point[axis] - nearest, along[axis]);
        before += nearest << 2 * axis;
    }
    for (int k = 0; k < 27; k++) {
        int x = k % 3, y = k / 3 % 3, z = k / 9;
        of[k] = first[before + x + 4 * y + 16 * z];
        sums[of[k]] += along[0][x] * along[1][y] * along[2][z];
    }
    int winner = of[13];  // the voxel in the middle
    for (int one : of) winner = sums[one] > sums[winner] ? one : winner;
    for (int one : of) next = one == winner ? next : most(next, sums[one]);
    return {t, numbers[winner], sums[winner] - next};
}

void LabelSegment::read(const PlacedVoxels& voxels, const Segment& segment) {
    load_cube(voxels, segment.cell - 1, 4, numbers);
    for (int k = 0; k < 64; k++)
        for (first[k] = 0; numbers[first[k]] != numbers[k];) first[k]++;
    entry = segment.entry, extent = segment.extent;
}

int64_t LabelSegment::load(const PlacedVoxels& voxels, const Segment& segment, const Array<double, 1>& scratch) {
    read(voxels, segment);
    splits = scratch;
    num_splits = add_middles(entry, extent, splits, 0), num_changes = 0;
    double ends[5] = {0.0, 1.0, 1.0, 1.0, 1.0};
    for (int64_t k = 0; k < num_splits; k++) ends[k + 1] = splits[k];
    for (int k = 0; k < 4; k++) {
        // Positions at the very ends of a part are left out, because two labels often have the same sum of weights
        // there.
        double low = ends[k] + TOLERANCE, high = ends[k + 1] - TOLERANCE;
        if (low < high) find_changes(winner_at(low), winner_at(high));
    }
    return num_splits;
}

void LabelSegment::find_changes(Winner low, Winner high) {
    const double width = high.t - low.t;
    const double most_lost = LARGEST_SLOPE * width * (absolute(extent.x) + absolute(extent.y) + absolute(extent.z));
    const bool is_one = low.number == high.number && (low.lead + high.lead > most_lost || width < LEAST_WIDTH);
    if (is_one || num_changes == MAX_LABEL_CHANGES) return;
    if (width < TOLERANCE) num_splits = insert_split(splits, num_splits, high.t), num_changes++;
    else {
        const Winner middle = winner_at(0.5 * (low.t + high.t));
        find_changes(low, middle), find_changes(middle, high);
    }
}

void load_label_differences(const PlacedVoxels& voxels, Cell cell, const Array<const double, 1>& opacities,
                            double (*corners)[8]) {
    double cube[8 * 8 * 8], along_x[4 * 8 * 8], along_y[4 * 4 * 8], smoothed[4 * 4 * 4];
    load_cube(voxels, cell - 3, 8, cube);
    const Cell size = size_of(voxels);
    for (int k = 0; k < 512; k++) {
        const Cell voxel = cell - 3 + Cell{k & 7, k >> 3 & 7, k >> 6};
        const bool is_inside = __builtin_reduce_and(voxel == nearest_inside(voxel, size));
        cube[k] = is_inside ? opacities[least((int64_t)cube[k], opacities.shape[0] - 1)] : 0.0;
    }
    smooth(cube, 8 * 8, along_x), smooth(along_x, 4 * 8, along_y), smooth(along_y, 4 * 4, smoothed);
    for (int k = 0; k < 8; k++) {
        auto [x, y, z] = nearest_inside(cell + Cell{k & 1, k >> 1 & 1, k >> 2}, size) - cell + 1;
        const double* here = smoothed + 16 * z + 4 * y + x;
        for (int axis = 0; axis < 3; axis++) corners[axis][k] = (here[1 << 2 * axis] - here[-(1 << 2 * axis)]) / 2.0;
    }
}

}  // namespace truth
