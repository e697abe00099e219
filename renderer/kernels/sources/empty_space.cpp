// Find the blocks of voxels that may show something (renderer/pyramid/empty_space.py).
#include "lanes.h"
#include "voxels.h"

namespace {

constexpr int64_t BLOCK_SIZE = 8;

// Whether a block has a visible voxel.
template <class T>
bool has_visible_voxel(const Array<const T, 3>& patterns, const Buffer<uint8_t>& is_visible, const Box& box) {
    const auto& [first, extent] = box;
    for (int64_t z = 0; z < extent[2]; z++)
        for (int64_t y = 0; y < extent[1]; y++) {
            const T* row = &patterns(first[2] + z, first[1] + y, first[0]);
            uint8_t found = 0;
            if (extent[0] == BLOCK_SIZE)  // a fixed number, which the compiler unrolls
                for (int64_t x = 0; x < BLOCK_SIZE; x++) found |= is_visible[row[x]];
            else
                for (int64_t x = 0; x < extent[0]; x++) found |= is_visible[row[x]];
            if (found) return true;
        }
    return false;
}

// Whether a block shows something by the min-max test, which its first voxel may decide.
bool has_visible_range(const AnyArray<3>& raw, const Classifier& classifier, const Box& box) {
    using Row = Vector<double, BLOCK_SIZE>;
    double scalars[BLOCK_SIZE * BLOCK_SIZE * BLOCK_SIZE];
    load_scalars<1>(raw, classifier.scalars, box, box.first, scalars);
    if (is_range_visible(classifier.breakpoints, scalars[0], scalars[0])) return scalars[0] == scalars[0];
    load_scalars<BLOCK_SIZE>(raw, classifier.scalars, box, box.first, scalars);
    Row low = in_all<Row>(__builtin_inf()), high = -low;
    for (int64_t row = 0; row < BLOCK_SIZE * BLOCK_SIZE; row++) {
        Row values = load<Row>(scalars, BLOCK_SIZE * row);
        low = min_of(low, values), high = max_of(high, values);  // of a second number NaN, the first
    }
    double lowest = __builtin_inf(), highest = -lowest;
    for (int lane = 0; lane < BLOCK_SIZE; lane++)
        lowest = least(lowest, low[lane]), highest = most(highest, high[lane]);
    return lowest <= highest && is_range_visible(classifier.breakpoints, lowest, highest);
}

}  // namespace

// Exact with a table. Without one, a block may count although no voxel in it is visible.
Status test_blocks(const TestBlocks* arguments) {
    const auto [raw, classifier, starts, extents, visible] = *arguments;
    int64_t num = starts.shape[0];
    if (!fits(classifier, raw) || extents.shape[0] != num || starts.shape[1] != 3 || extents.shape[1] != 3 ||
        visible.shape[0] != num)
        return OUT_OF_BOUNDS;
    Buffer<uint8_t> is_visible(classifier.table.value.shape[0]);
    if (!is_visible) return NO_MEMORY;
    for (int64_t pattern = 0; pattern < is_visible.num; pattern++)
        is_visible[pattern] = classifier.table.value(pattern, 3) > 0;
    return with_array(raw, [&]<class T>(const Array<const T, 3>& voxels) {
        for (int64_t g = 0; g < num; g++) {
            Box box(&starts(g, 0), &extents(g, 0));
            if constexpr (sizeof(T) <= 2) visible[g] = has_visible_voxel(voxels, is_visible, box);
            else visible[g] = has_visible_range(raw, classifier, box);
        }
        return DONE;
    });
}
