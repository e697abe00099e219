// Voxels as scalars, of any dtype: those of at most 16 bits are unsigned bit patterns, which have tables.
#pragma once
#include "transfer.h"

namespace {

// A box of voxels: the first one, and the numbers of voxels, along x, y, z.
struct Box {
    int64_t first[3], extent[3];

    INLINE Box(const int64_t* start, const int64_t* size) {
        for (int axis = 0; axis < 3; axis++) first[axis] = start[axis], extent[axis] = size[axis];
    }
};

// Whether the scalars of bit patterns are whole.
inline bool fits(const Maybe<Array<const double, 1>>& by_pattern, const AnyArray<3>& raw) {
    if (raw.dtype >= 4) return !by_pattern.exists;
    return raw.dtype % 2 == 0 && by_pattern.exists && by_pattern.value.shape[0] == 1 << (raw.dtype == 0 ? 8 : 16);
}

// Whether a classifier is one of these voxels.
inline bool fits(const Classifier& classifier, const AnyArray<3>& raw) {
    const auto& [table, by_pattern, curve, is_opacity, lighting, breakpoints] = classifier;
    if (!fits(by_pattern, raw) || table.exists != by_pattern.exists || curve.exists == table.exists) return false;
    if (curve.exists) return fits(curve.value);
    return table.value.shape[0] == by_pattern.value.shape[0] && table.value.shape[1] == 4;
}

// Write the scalars of SIDE^3 voxels from `first` (x, y, z) on; beyond the box the nearest voxel is repeated.
template <int SIDE>
void load_scalars(const AnyArray<3>& raw, const Maybe<Array<const double, 1>>& by_pattern, const Box& box,
                  const int64_t* first, double* out) {
    auto nearest = [&](int axis, int64_t number) {
        return least(most(first[axis] + number, box.first[axis]), box.first[axis] + box.extent[axis] - 1);
    };
    bool is_inside = nearest(0, 0) == first[0] && nearest(0, SIDE - 1) == first[0] + SIDE - 1;
    with_array(raw, [&]<class T>(const Array<const T, 3>& voxels) {
        auto scalar_of = [&](T voxel) {
            if constexpr (sizeof(T) <= 2) return by_pattern.value[(int64_t)voxel];
            else return (double)voxel;
        };
        for (int64_t z = 0; z < SIDE; z++)
            for (int64_t y = 0; y < SIDE; y++, out += SIDE) {
                const T* row = &voxels(nearest(2, z), nearest(1, y), 0);
                if (is_inside)
                    for (int64_t x = 0; x < SIDE; x++) out[x] = scalar_of(row[first[0] + x]);
                else
                    for (int64_t x = 0; x < SIDE; x++) out[x] = scalar_of(row[nearest(0, x)]);
            }
        return DONE;
    });
}

}  // namespace
