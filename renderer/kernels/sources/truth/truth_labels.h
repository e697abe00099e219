// Find the label at any point: that with the largest sum of weights among the 27 voxels around.
//
// The weight of a voxel is a product over the axes: of its distance along each, 0.2 times a tent and 0.8 times a
// quadratic B-spline. A voxel alone thus keeps its centre, with more than half of the weight. In every cell, one of the
// corners has more weight than all voxels that are no corners together: one of the corners' labels wins.
#pragma once
#include "truth/truth_cells.h"

namespace truth {

// As many changes are found in a segment. There are far fewer, unless rounding makes them.
constexpr int64_t MAX_LABEL_CHANGES = 64;

// The labels along a segment. splits: where another one wins, or another voxel becomes the nearest; num_changes: of the
// former.
//
// numbers: of 4^3 voxels from the one before the cell on, x fastest. first: for each of them the first voxel with its
// number.
struct LabelSegment {
    double numbers[64];
    uint8_t first[64];
    Point entry, extent;
    Array<double, 1> splits;
    int64_t num_splits, num_changes;

    // The number that wins at t along the segment, and by how much its sum exceeds the next one.
    struct Winner {
        double t, number, lead;
    };

    // Load the labels of a segment, and find all splits; return how many there are.
    int64_t load(const AnyArray<3>& values, const Segment& segment, const Array<double, 1>& scratch);

    Winner winner_at(double t) const;

    // Add the places between two others where another label wins to the splits.
    void find_changes(Winner low, Winner high);
};

// How far normals turn to a fixed light, so that the faces of labels that are cut open, far from a surface, are lit.
constexpr double LABEL_TILT = 0.05;

// Write the differences along x, y, z of the smoothed opacity of voxels, at the corners of a cell.
void load_label_differences(const AnyArray<3>& values, Cell cell, const Array<const double, 1>& opacities,
                            double (*corners)[8]);

}  // namespace truth
