// Find the blocks of voxels that show nothing, which are left out.
//
// Voxels with a table are looked up until one is visible. Wider voxels take the min-max test, so that a block may count
// as visible although no voxel in it is.
#pragma once
#include "lanes.h"
#include "voxels.h"

namespace {

class VisibilityTest {
    static constexpr int64_t SIDE = 8;
    const AnyArray<3>& raw;
    const Classifier& classifier;
    Buffer<bool> is_visible;  // by pattern

    template <class T>
    bool has_visible_voxel(const Array<const T, 3>& patterns, const Box& box) const {
        const auto& [first, extent] = box;
        for (int64_t z = 0; z < extent[2]; z++)
            for (int64_t y = 0; y < extent[1]; y++) {
                const T* row = &patterns(first[2] + z, first[1] + y, first[0]);
                bool found = false;
                if (extent[0] == SIDE)  // a fixed number, which the compiler unrolls
                    for (int64_t x = 0; x < SIDE; x++) found |= is_visible[row[x]];
                else
                    for (int64_t x = 0; x < extent[0]; x++) found |= is_visible[row[x]];
                if (found) return true;
            }
        return false;
    }

    bool has_visible_range(const Box& box) const {
        using Row = Vector<double, SIDE>;
        double scalars[SIDE * SIDE * SIDE], lowest = __builtin_inf(), highest = -lowest;
        load_scalars<1>(raw, classifier.scalars, box, box.first, scalars);
        if (is_range_visible(classifier.breakpoints, scalars[0], scalars[0])) return scalars[0] == scalars[0];
        load_scalars<SIDE>(raw, classifier.scalars, box, box.first, scalars);
        Row low = in_all<Row>(lowest), high = -low;
        for (int64_t row = 0; row < SIDE * SIDE; row++) {
            Row values = load<Row>(scalars, SIDE * row);
            low = min_of(low, values), high = max_of(high, values);  // of a second number NaN, the first
        }
        for (int lane = 0; lane < SIDE; lane++)
            lowest = least(lowest, low[lane]), highest = most(highest, high[lane]);
        return lowest <= highest && is_range_visible(classifier.breakpoints, lowest, highest);
    }

  public:
    VisibilityTest(const AnyArray<3>& voxels, const Classifier& by)
        : raw(voxels), classifier(by), is_visible(by.table.value.shape[0]) {
        if (is_visible)
            for (int64_t pattern = 0; pattern < is_visible.num; pattern++)
                is_visible[pattern] = by.table.value(pattern, 3) > 0;
    }

    // False where there was no memory.
    explicit operator bool() const { return (bool)is_visible; }

    // Whether a block of at most SIDE voxels along each axis may show something.
    bool operator()(const Box& box) const {
        const auto& [z, y, x] = raw.shape;
        if (raw.dtype == 0) return has_visible_voxel(Array<const uint8_t, 3>{(const uint8_t*)raw.data, {z, y, x}}, box);
        if (raw.dtype == 2) return has_visible_voxel(Array<const uint16_t, 3>{(const uint16_t*)raw.data, {z, y, x}}, box);
        return has_visible_range(box);
    }
};

}  // namespace
