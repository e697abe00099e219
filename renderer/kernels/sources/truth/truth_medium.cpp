// Evaluate a layer at a point (truth_medium.h).
#include "truth/truth_medium.h"

namespace truth {
namespace {

// Return the number of the label at a point in index space.
double label_at(const PlacedVoxels& voxels, Cell cell, Point entry) {
    LabelSegment labels;
    labels.read(voxels, {cell, {}, 0.0, 0.0, entry, {}});
    return labels.winner_at(0.0).number;
}

// Return the first corner of the cell that holds a point of the volume.
INLINE Cell cell_of(Cell size, Point index) {
    Cell cell;
    for (int axis = 0; axis < 3; axis++)
        cell[axis] = least(most<int64_t>((int64_t)__builtin_floor(index[axis]), -1), size[axis] - 1);
    return cell;
}

bool is_removed(const RemovedSet& removed, Point index) {
    const Point own = transformed(removed.own_from_index, index);
    bool is_inside = true;
    for (int axis = 0; axis < 3; axis++) is_inside &= removed.low[axis] < own[axis] && own[axis] < removed.high[axis];
    return is_inside;
}

bool is_masked(const PathMask& mask, Point world) {
    const Cell size = size_of(mask.voxels);
    const Point index = transformed(mask.index_from_world, world);
    for (int axis = 0; axis < 3; axis++)
        if (!(-0.5 <= index[axis] && index[axis] < (double)size[axis] - 0.5)) return true;
    const Cell cell = cell_of(size, index);
    return label_at(mask.voxels, cell, index - __builtin_convertvector(cell, Point)) == 0.0;
}

}  // namespace

Matter Medium::matter_at(Point world, Point index) const {
    for (int64_t k = 0; k < removed.shape[0]; k++)
        if (is_removed(removed[k], index)) return {};
    if (place->mask.exists && is_masked(place->mask.value, world)) return {};
    const auto& [knots, rows, scale] = optics->intervals;
    const Cell cell = cell_of(size_of(optics->voxels), index);
    const Point entry = index - __builtin_convertvector(cell, Point);
    double corners[8], low, high;
    int absent = load_corners(optics->voxels, cell, scale, corners);
    if (absent != 0 && is_octant_absent(absent, entry, {}, 0.0)) return {};
    low = high = corners[0];
    for (double corner : corners) low = least(low, corner), high = most(high, corner);
    double value = least(most(cubic_in_cell(corners, entry, {})[0], low), high);
    if (optics->label_opacities.exists && low != high) value = label_at(optics->voxels, cell, entry) * scale;
    const Interval in = interval(num_below(knots, value));
    return {extinction_at(in, value), in, value};
}

}  // namespace truth
