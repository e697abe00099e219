// Find the blocks of voxels that show nothing; they get no nodes.
//
// Voxels of at most 16 bits are looked up in a table, until one is visible. Blocks of wider voxels are tested by their
// smallest and largest scalar, so that a block may count as visible although none of its voxels is. No voxel is read
// in a brick whose known range of scalars is invisible.
#pragma once
#include "base/lanes.h"
#include "volume/voxels.h"
#include "pyramid/brick_ranges.h"
#include "transfer/transfer.h"

namespace {

// A test of whether a block of voxels may show anything.
class VisibilityTest {
    // The largest number of voxels along each axis of a block.
    static constexpr int64_t SIDE = 8;
    const AnyArray<3>& raw;
    const Classifier& classifier;
    // The ranges of scalars in bricks, if they are known, as in BuildBlocks.
    const Maybe<Array<const double, 4>> ranges;
    // Whether each bit pattern of a voxel is visible; empty for voxels of more than 16 bits.
    Buffer<bool> is_visible;

    template <class T>
    bool has_visible_voxel(const Array<const T, 3>& patterns, const VoxelBox& box) const {
        const auto& [first, extent] = box;
        for (int64_t z = 0; z < extent[2]; z++)
            for (int64_t y = 0; y < extent[1]; y++) {
                const T* row = &patterns(first[2] + z, first[1] + y, first[0]);
                bool found = false;
                if (extent[0] == SIDE)  // a fixed number of voxels, so that the compiler unrolls the loop
                    for (int64_t x = 0; x < SIDE; x++) found |= is_visible[row[x]];
                else
                    for (int64_t x = 0; x < extent[0]; x++) found |= is_visible[row[x]];
                if (found) return true;
            }
        return false;
    }

    template <class T>
    bool has_visible_range(const Array<const T, 3>& voxels, const VoxelBox& box) const {
        using Row = Vector<T, SIDE>;
        const auto& [first, extent] = box;
        T one = voxels(first[2], first[1], first[0]);
        if (is_range_visible(classifier.breakpoints, (double)one, (double)one)) return true;
        Row low = in_all<Row>(one == one ? one : (T)__builtin_inf()), high = one == one ? low : -low;
        for (int64_t z = 0; z < extent[2]; z++)
            for (int64_t y = 0; y < extent[1]; y++) {
                const T* row = &voxels(first[2] + z, first[1] + y, first[0]);
                Row values;
                if (extent[0] == SIDE) values = load<Row>(row, 0);
                else
                    for (int64_t x = 0; x < SIDE; x++) values[x] = row[least(x, extent[0] - 1)];
                low = min_of(low, values), high = max_of(high, values);  // NaN in `values` has no effect
            }
        T lowest = low[0], highest = high[0];
        for (int lane = 1; lane < SIDE; lane++) lowest = least(lowest, low[lane]), highest = most(highest, high[lane]);
        return lowest <= highest && is_range_visible(classifier.breakpoints, (double)lowest, (double)highest);
    }

  public:
    VisibilityTest(const AnyArray<3>& voxels, const Classifier& by, const Maybe<Array<const double, 4>>& known = {})
        : raw(voxels), classifier(by), ranges(known), is_visible(by.table.value.shape[0]) {
        if (is_visible)
            for (int64_t pattern = 0; pattern < is_visible.shape[0]; pattern++)
                is_visible[pattern] = by.table.value(pattern, 3) > 0;
    }

    // Return false if there was no memory for the test.
    explicit operator bool() const { return (bool)is_visible; }

    // Return whether a block of at most SIDE voxels along each axis, all in one brick if there are ranges, may show
    // anything.
    bool operator()(const VoxelBox& box) const {
        const auto& first = box.first;
        if (!may_show_brick(ranges, classifier.breakpoints, first[0], first[1], first[2])) return false;
        bool found = false;
        with_array(raw, [&]<class T>(const Array<const T, 3>& voxels) {
            if constexpr (sizeof(T) <= 2) found = has_visible_voxel(voxels, box);
            else found = has_visible_range(voxels, box);
            return DONE;
        });
        return found;
    }
};

}  // namespace
