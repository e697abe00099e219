// Find the label at any point: that with the largest sum of weights among the 27 voxels around.
//
// The weight of a voxel is a product over the axes: of its distance along each, 0.2 times a tent and 0.8 times a
// quadratic B-spline. A voxel alone thus keeps its centre, with more than half of the weight. In every cell, one of the
// corners has more weight than all voxels that are no corners together: one of the corners' labels wins.
#pragma once
#include "truth_cells.h"

namespace truth {

// As many changes are found along a ray inside one cell. There are far fewer, unless rounding makes them.
constexpr int64_t MAX_LABEL_CHANGES = 64;

// A place along a ray, the number that wins there, and by how much it exceeds the next one.
struct LabelPlace {
    double t, number, lead;
};

// The voxels that have a part in a cell.
//
// numbers: of 4^3 voxels from the one before the cell on, x fastest. first: which of them is the first of its number.
struct LabelCell {
    double numbers[64];
    uint8_t first[64];

    void load(const AnyArray<3>& values, Cell cell);

    // The winner at entry + extent * t, in cell coordinates.
    LabelPlace winner_at(Point entry, Point extent, double t) const;

    // Write where along entry + extent * t, in (0, 1), the winner or the nearest voxel changes; return how often.
    int64_t add_changes(Point entry, Point extent, const Array<double, 1>& splits) const;
};

// Write the differences along x, y, z of the smoothed opacity of voxels, at the corners of a cell.
void load_label_differences(const AnyArray<3>& values, Cell cell, const Array<const double, 1>& opacities,
                            double (*corners)[8]);

}  // namespace truth
