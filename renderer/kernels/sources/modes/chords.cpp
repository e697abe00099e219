// Measure the lengths of rays inside the part of the volume's box that clipping leaves.
#include "modes/kernels.h"
#include "base/stopping.h"

namespace {

// After this many rays, a tenth of a millisecond, the kernel looks whether it is asked to stop.
constexpr int64_t RAYS_BETWEEN_LOOKS = 1024;

// A ray in index space, in voxels from the middle of the volume.
struct Ray {
    // The origin along x, y, z.
    double origin[3];
    // The direction along x, y, z.
    double direction[3];
};

// A range of positions along a ray, in lengths of its direction; it is empty unless start < end.
struct Range {
    double start, end;
};

// Clip a ray to the intersection of slabs. slabs: as in ClipRegion.
Range clip_to_slabs(const Array<const double, 2>& slabs, const Ray& ray, Range range) {
    const auto& [origin, direction] = ray;
    for (int64_t k = 0; k < slabs.shape[0]; k++) {
        double nx = slabs(k, 0), ny = slabs(k, 1), nz = slabs(k, 2), low = slabs(k, 3), high = slabs(k, 4);
        double height = nx * origin[0] + ny * origin[1] + nz * origin[2];
        double speed = nx * direction[0] + ny * direction[1] + nz * direction[2];
        if (speed == 0.0) {
            if (!(low <= height && height < high)) range.end = -__builtin_inf();
            continue;
        }
        double one = (low - height) / speed, other = (high - height) / speed;
        range = {most(range.start, least(one, other)), least(range.end, most(one, other))};
    }
    return range;
}

// Return the length of the parts of a range that lie in voxels with data. The range is inside the volume's box, and is
// followed from one voxel to the next.
double length_of_data(const Array<const bool, 3>& absent, const Ray& ray, Range range) {
    auto [start, end] = range;
    double corner[3], leave[3], length = 0.0;
    int64_t voxel[3];
    auto find_leave = [&](int axis) {
        double speed = ray.direction[axis], side = (double)(voxel[axis] + (speed > 0.0));
        leave[axis] = speed == 0.0 ? __builtin_inf() : (side - corner[axis]) / speed;
    };
    for (int axis = 0; axis < 3; axis++) {
        const int64_t num = absent.shape[2 - axis];
        corner[axis] = ray.origin[axis] + num / 2.0;
        double inside = __builtin_floor(corner[axis] + start * ray.direction[axis]);
        voxel[axis] = (int64_t)least(most(0.0, inside), num - 1.0);
        find_leave(axis);
    }
    auto step = [&](int axis) {
        voxel[axis] += ray.direction[axis] > 0.0 ? 1 : -1;
        find_leave(axis);
        return voxel[axis] >= 0 && voxel[axis] < absent.shape[2 - axis];
    };
    while (true) {
        double until = end;
        int across = -1;
        for (int axis = 0; axis < 3; axis++)
            if (leave[axis] < until) until = leave[axis], across = axis;
        until = most(until, start);
        length += absent(voxel[2], voxel[1], voxel[0]) ? 0.0 : until - start;
        start = until;
        // There is a case for each axis, because the processor predicts the case, while an array index would have to wait
        // for the division.
        if (across < 0 || !(across == 0 ? step(0) : across == 1 ? step(1) : step(2))) return length;
    }
}

// Return the length of the parts of a range that lie in none of the removed ranges, and not in voxels without data.
double length_without(const Buffer<Range>& removed, const Maybe<Array<const bool, 3>>& absent, const Ray& ray,
                      Range range) {
    auto [start, end] = range;
    double length = 0.0;
    while (start < end) {
        double until = end;
        for (int64_t k = 0; k < removed.shape[0]; k++)
            if (removed[k].start < removed[k].end && start < removed[k].end)
                until = least(until, most(removed[k].start, start));
        length += absent.exists ? length_of_data(absent.value, ray, {start, until}) : until - start;
        start = until;
        for (int64_t i = 0; i < removed.shape[0]; i++)
            for (int64_t k = 0; k < removed.shape[0]; k++)
                if (removed[k].start <= start && start < removed[k].end) start = removed[k].end;
    }
    return length;
}

}  // namespace

// Write the world lengths of the parts of rays that are inside the volume's box and its clip region.
Status measure_chords(const MeasureChords* arguments) {
    const auto [rays, shape, positions_px, absent, unit, lengths] = *arguments;
    const auto& [slabs, boxes] = rays.clip.value;  // both are empty if nothing clips the volume
    for (int axis = 0; axis < 3; axis++)
        if (absent.exists && absent.value.shape[2 - axis] != shape[axis]) return OUT_OF_BOUNDS;
    const double half[3] = {shape[0] / 2.0, shape[1] / 2.0, shape[2] / 2.0};
    const double of_box[15] = {1, 0, 0, -half[0], half[0], 0, 1, 0, -half[1], half[1], 0, 0, 1, -half[2], half[2]};
    Buffer<Range> removed(boxes.shape[0]);
    if (positions_px.shape[0] != lengths.shape[0]) return OUT_OF_BOUNDS;
    if (!removed) return NO_MEMORY;
    for (int64_t k = 0; k < lengths.shape[0]; k++) {
        if (k % RAYS_BETWEEN_LOOKS == 0 && is_stopped()) return STOPPED;
        const double x = positions_px(k, 0) - rays.center_px[0], y = positions_px(k, 1) - rays.center_px[1];
        Ray ray;
        for (int axis = 0; axis < 3; axis++) {
            const double *origins = &rays.origins[3 * axis], *directions = &rays.directions[3 * axis];
            ray.origin[axis] = origins[0] + origins[1] * x + origins[2] * y;
            ray.direction[axis] = directions[0] + directions[1] * x + directions[2] * y;
        }
        Range range = clip_to_slabs({of_box, {3, 5}}, ray, {rays.start, __builtin_inf()});
        range = clip_to_slabs(slabs, ray, range);
        for (int64_t box = 0; box < removed.shape[0]; box++) removed[box] = clip_to_slabs(boxes[box], ray, range);
        double per_depth = __builtin_sqrt(1.0 + rays.slope_per_px * rays.slope_per_px * (x * x + y * y));
        lengths[k] = (float)(length_without(removed, absent, ray, range) * per_depth * unit);
    }
    return DONE;
}
