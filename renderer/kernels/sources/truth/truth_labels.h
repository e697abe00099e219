// Find the label at any point: the label with the largest sum of weights among the 27 voxels around the point.
//
// The weight of a voxel is a product over the axes. Each factor is a function of the voxel's distance along the axis:
// 0.2 times a tent plus 0.8 times a quadratic B-spline. A single voxel with a label thus keeps its centre, where it has
// more than half of the weight. In every cell, one of the corners has more weight than all voxels together that are no
// corners: one of the corners' labels wins.
#pragma once
#include "truth/truth_cells.h"

namespace truth {

// The largest number of changes of the label that are found in a segment. There are far fewer, unless rounding makes
// more.
constexpr int64_t MAX_LABEL_CHANGES = 64;

// The labels along a segment of a ray.
struct LabelSegment {
    // The label numbers of the 4^3 voxels around the cell, x fastest.
    double numbers[64];
    // For each voxel in `numbers`, the index of the first voxel with the same label number.
    uint8_t first[64];
    // The point at which the ray enters the cell, as in Segment.
    Point entry;
    // The vector from the segment's start to its end, as in Segment.
    Point extent;
    // The positions t at which another label wins, or another voxel becomes the nearest, ascending.
    Array<double, 1> splits;
    // The number of positions in `splits`.
    int64_t num_splits;
    // The number of positions in `splits` at which the label of the segment changes.
    int64_t num_changes;

    // The label that wins at a position along the segment.
    struct Winner {
        // The position along the segment, from 0 to 1.
        double t;
        // The number of the label that wins at the position.
        double number;
        // By how much the sum of weights of the label that wins exceeds the next largest sum.
        double lead;
    };

    // Load the labels around a segment.
    void read(const PlacedVoxels& voxels, const Segment& segment);

    // Load the labels around a segment, and find all splits. Return the number of splits. scratch: room for the splits.
    int64_t load(const PlacedVoxels& voxels, const Segment& segment, const Array<double, 1>& scratch);

    // Return the label that wins at t along the segment.
    Winner winner_at(double t) const;

    // Find the positions between `low` and `high` at which another label wins, and add them to the splits.
    void find_changes(Winner low, Winner high);
};

// The length of a vector towards a fixed light that is added to the normals of labels, which are slopes of smoothed
// opacities. With it, a face that clipping cuts through a label is lit also far from the label's surface, where the
// slope is 0.
constexpr double LABEL_TILT = 0.05;

// Write the central differences along x, y, z of the smoothed opacities of voxels, at the corners of a cell. opacities:
// the opacity of each label, by its number.
void load_label_differences(const PlacedVoxels& voxels, Cell cell, const Array<const double, 1>& opacities,
                            double (*corners)[8]);

}  // namespace truth
