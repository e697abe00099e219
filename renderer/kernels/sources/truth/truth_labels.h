// Find the label at any point: the label with the largest sum of weights among the 27 voxels around the point.
//
// The weight of a voxel is a product over the axes. Each factor is a function of the voxel's distance along the axis:
// 0.2 times a tent plus 0.8 times a quadratic B-spline. A single voxel with a label thus keeps its centre, where it has
// more than half of the weight. In every cell, one of the corners has more weight than all voxels together that are no
// corners: one of the corners' labels wins.
#pragma once
#include "truth/truth_cells.h"

namespace truth {

// The most changes of label that are found in a segment. There are far fewer, unless rounding makes more.
constexpr int64_t MAX_LABEL_CHANGES = 64;

// The labels along a segment. splits: the positions where another label wins, or where another voxel becomes the
// nearest. num_changes: the number of positions where another label wins.
//
// numbers: the label numbers of 4^3 voxels, from the voxel before the cell on, x fastest. first: for each of these
// voxels, the first voxel with the same number.
struct LabelSegment {
    double numbers[64];
    uint8_t first[64];
    Point entry, extent;
    Array<double, 1> splits;
    int64_t num_splits, num_changes;

    // Return the number that wins at t along the segment, and by how much its sum exceeds the next largest sum.
    struct Winner {
        double t, number, lead;
    };

    // Load the labels of a segment, and find all splits. Return the number of splits.
    int64_t load(const AnyArray<3>& values, const Segment& segment, const Array<double, 1>& scratch);

    Winner winner_at(double t) const;

    // Add to the splits the positions between two positions where another label wins.
    void find_changes(Winner low, Winner high);
};

// The length of the vector towards a fixed light by which normals turn, so that the faces of cut labels are lit far
// from a surface.
constexpr double LABEL_TILT = 0.05;

// Write the differences along x, y, z of the smoothed opacity of voxels, at the corners of a cell.
void load_label_differences(const AnyArray<3>& values, Cell cell, const Array<const double, 1>& opacities,
                            double (*corners)[8]);

}  // namespace truth
