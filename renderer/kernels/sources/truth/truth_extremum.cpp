// Find the most extreme scalar of a ray exactly, from cell to cell: the field along the ray in a cell is a cubic, whose
// extremes are known.
//
// A macrocell whose upper bound does not exceed the largest number found so far is skipped. The first ray that meets a
// macrocell computes its bound.
#include "truth/kernels.h"
#include "base/stopping.h"
#include "truth/truth_cells.h"

namespace truth {
namespace {

// The largest number found on a ray, and the position at which it was found.
struct Found {
    double number;
    double place;
};

// Return the largest value of a cubic in [0, 1], and the first position at which the cubic has this value.
INLINE Found largest(Cubic cubic) {
    Found best = {value_at(cubic, 0.0), 0.0};
    Point turns = turns_and_end(cubic);
    for (int turn = 0; turn < 3; turn++) {
        double t = turns[turn], value = value_at(cubic, t);
        if (0.0 < t && t <= 1.0 && value > best.number) best = {value, t};
    }
    return best;
}

// Return the largest value of a cubic in [0, 1] where the nearest voxel has data, and the first position of this
// value.
//
// The value is minus infinity if no voxel along the segment has data.
Found largest_of_data(Cubic cubic, int absent, Point entry, Point extent) {
    double memory[3], start = 0.0;
    const Array<double, 1> splits = {memory, {3}};
    int64_t count = add_middles(entry, extent, splits, 0);
    Found best = {-INFINITE, 0.0};
    for (int64_t part = 0; part <= count; part++) {
        double end = part < count ? splits[part] : 1.0;
        if (!is_octant_absent(absent, entry, extent, 0.5 * (start + end))) {
            auto [number, t] = largest(restrict_cubic(cubic, start, end - start));
            if (number > best.number) best = {number, start + t * (end - start)};
        }
        start = end;
    }
    return best;
}

}  // namespace
}  // namespace truth

// Write the largest `sign` times scalar along each ray, and the length along the ray at which it lies.
Status search_rays(const SearchRays* arguments) {
    using namespace truth;
    const auto& [voxels, tops, sign, least_rise, rays, found] = *arguments;
    int64_t num_rays = rays.parts.shape[0];
    if (!fit(rays) || !fit(voxels) || !fits_macrocells(tops, voxels) || !has_shape(found, num_rays, 2)) return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < num_rays; i++) {
        if (is_stopped()) return STOPPED;
        Found best = {-INFINITE, 0.0};
        auto search = [&](const Segment& segment) {
            auto [x, y, z] = segment.macrocell;
            double& top = tops(z, y, x);
            if (is_nan(top)) {  // several threads may write here, all of them the same value
                auto [low, high] = macrocell_range(voxels, segment.macrocell);
                top = low <= high ? most(sign * low, sign * high) : -INFINITE;
            }
            if (!(top > best.number + least_rise)) return;
            double corners[8];
            int absent = load_corners(voxels, segment.cell, sign, corners);
            if (absent == ALL_ABSENT) return;
            Cubic cubic = cubic_in_cell(corners, segment.entry, segment.extent);
            auto [number, t] =
                absent == 0 ? largest(cubic) : largest_of_data(cubic, absent, segment.entry, segment.extent);
            if (number > best.number + least_rise) best = {number, lerp(segment.start, segment.end, t)};
        };
        Point origin = point_of(&rays.origins(i, 0)), direction = point_of(&rays.directions(i, 0));
        for (int64_t k = 0; k < rays.parts.shape[1]; k++) {
            CellWalk walk(size_of(voxels), origin, direction, rays.parts(i, k, 0), rays.parts(i, k, 1));
            for (Segment segment; walk.next(segment);) search(segment);
        }
        found(i, 0) = best.number, found(i, 1) = best.place;
    }
    return DONE;
}
