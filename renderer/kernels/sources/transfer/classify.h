// Classify the voxels of a box: apply the transfer function, Lambert's law on the gradient, and the voxels' own
// colours.
#pragma once
#include "base/lanes.h"
#include "volume/voxels.h"
#include "transfer/light_grid.h"
#include "transfer/transfer.h"

namespace {

// Return whether the tables of a classifier exist, and have the shapes, that the voxels need.
inline bool fits(const Classifier& classifier, const AnyArray<3>& raw) {
    const auto& [table, by_pattern, curve, is_opacity, lighting, breakpoints, colors, shown] = classifier;
    if (!fits(by_pattern, raw) || table.exists != by_pattern.exists || curve.exists == table.exists) return false;
    if (colors.exists && !has_shape(colors.value, raw.shape[0], raw.shape[1], raw.shape[2], 3)) return false;
    if (shown.exists && !has_shape(shown.value, raw.shape[0], raw.shape[1], raw.shape[2])) return false;
    if (curve.exists) return fits(curve.value);
    return table.value.shape[0] == by_pattern.value.shape[0] && table.value.shape[1] == 4;
}

// Return Lambert's factor `ambient + diffuse max(0, n . l)`, with the normal n against the world gradient (x, y, z),
// whose largest component is about 1, so that squares neither overflow nor vanish. light: the vector l towards the
// light, ambient, diffuse.
INLINE double lambert_factor(double x, double y, double z, const double* light) {
    double across = __builtin_fma(x, light[0], __builtin_fma(y, light[1], z * light[2]));
    double length = __builtin_sqrt(__builtin_fma(x, x, __builtin_fma(y, y, z * z)));
    return __builtin_fma(light[4], most(0.0, -across / length), light[3]);
}

// Return the factor on the colour of a visible voxel, by Lambert's law; it is `ambient` if the gradient is 0.
//
// Derivatives along the index axes are central, one-sided at the border and beside voxels without data, 0 across one
// voxel. here: a pointer to the voxel's scalar. The scalars of its neighbours along x, y and z are at distances of 1,
// `row` and `row` squared before and after it.
inline double lighting_factor(const VoxelLighting& lighting, const AnyArray<3>& raw, const double* here, int64_t row,
                              const int64_t* voxel) {
    bool is_float32 = raw.dtype == 8;  // small differences of float32 are exact in float32
    const int64_t steps[3] = {1, row, row * row};
    double before[3], after[3], share[3], g[3], light[5];
    for (int axis = 0; axis < 3; axis++) {
        before[axis] = here[-steps[axis]], after[axis] = here[steps[axis]];
        bool has_before = voxel[axis] > 0 && !is_nan(before[axis]);
        bool has_after = voxel[axis] < raw.shape[2 - axis] - 1 && !is_nan(after[axis]);
        if (is_nan(before[axis])) before[axis] = *here;
        if (is_nan(after[axis])) after[axis] = *here;
        share[axis] = has_before && has_after ? 0.5 : 1.0;
    }
    // Only the gradient's direction counts. Differences of halved scalars do not overflow. If these differences are
    // small, the differences of full scalars do not overflow either, while halves would round denormal numbers.
    auto largest = [&] { return most(most(__builtin_fabs(g[0]), __builtin_fabs(g[1])), __builtin_fabs(g[2])); };
    for (int axis = 0; axis < 3; axis++) g[axis] = 0.5 * after[axis] - 0.5 * before[axis];
    if (largest() < 1.0)
        for (int axis = 0; axis < 3; axis++) {
            double rise = after[axis] - before[axis];
            g[axis] = 2.0 * (is_float32 ? (double)(float)rise : rise);
        }
    for (int axis = 0; axis < 3; axis++) g[axis] *= share[axis];
    __builtin_memcpy(light, lighting.light, sizeof light);
    shade(lighting.grid, voxel, light);
    double steepest = largest();
    if (steepest == 0.0) return light[3];
    for (double& each : g) each /= steepest;
    const double* m = lighting.world_from_gradient;
    return lambert_factor(m[0] * g[0] + m[1] * g[1] + m[2] * g[2], m[3] * g[0] + m[4] * g[1] + m[5] * g[2],
                          m[6] * g[0] + m[7] * g[1] + m[8] * g[2], light);
}

using FourChannels = Vector<float, 4>;

// Call `take` as `classify_box` does, for a classifier with a table and without light.
template <class T, int SIDE, class Take>
INLINE void look_up_box(const AnyArray<3>& raw, const Array<const float, 2>& table, const VoxelBox& box, Take take) {
    Array<const T, 3> patterns = {(const T*)raw.data, {raw.shape[0], raw.shape[1], raw.shape[2]}};
    for_voxels<SIDE>(box, [&](int64_t x, int64_t y, int64_t z) {
        int64_t pattern = patterns(box.first[2] + z, box.first[1] + y, box.first[0] + x);
        take(x, y, z, load<FourChannels>(&table(pattern, 0), 0));
    });
}

// Call `take` as `classify_box` does, without the voxels' own colours and without a mask.
template <int SIDE, class Take>
INLINE void classify_scalars(const AnyArray<3>& raw, const Classifier& classifier, const VoxelBox& box, Take take) {
    const auto& [table, by_pattern, curve, is_opacity, lighting, breakpoints, colors, shown] = classifier;
    if (table.exists && !lighting.exists) {
        if (raw.dtype == 0) look_up_box<uint8_t, SIDE>(raw, table.value, box, take);
        else look_up_box<uint16_t, SIDE>(raw, table.value, box, take);
        return;
    }
    constexpr int64_t padded = SIDE + 2;
    double scalars[padded * padded * padded];
    int64_t side = lighting.exists ? padded : SIDE, halo = lighting.exists;
    const int64_t first[3] = {box.first[0] - halo, box.first[1] - halo, box.first[2] - halo};
    load_scalars(raw, by_pattern, halo ? box_of(raw) : box, first, side, scalars);
    for (int64_t z = 0; z < box.extent[2]; z++)
        for (int64_t y = 0; y < box.extent[1]; y++)
            for (int64_t x = 0; x < box.extent[0]; x++) {
                const int64_t voxel[3] = {box.first[0] + x, box.first[1] + y, box.first[2] + z};
                const double* here = scalars + ((z + halo) * side + y + halo) * side + x + halo;
                Channels channels;
                if (table.exists) {
                    int64_t place = (voxel[2] * raw.shape[1] + voxel[1]) * raw.shape[2] + voxel[0];
                    bool is_byte = raw.dtype == 0;
                    int64_t pattern = is_byte ? ((const uint8_t*)raw.data)[place] : ((const uint16_t*)raw.data)[place];
                    channels = __builtin_convertvector(load<FourChannels>(&table.value(pattern, 0), 0), Channels);
                } else {
                    channels = classify_scalar(curve.value, is_opacity, *here);
                }
                if (lighting.exists && channels.a > 0)
                    channels.rgb *= lighting_factor(lighting.value, raw, here, side, voxel);
                take(x, y, z, __builtin_convertvector(channels, FourChannels));
            }
}

// Call `take(x, y, z, channels)` for each voxel of a box of at most SIDE voxels along each axis, x fastest.
template <int SIDE, class Take>
INLINE void classify_box(const AnyArray<3>& raw, const Classifier& classifier, const VoxelBox& box, Take take) {
    const auto& colors = classifier.colors;
    const auto& shown = classifier.shown;
    if (!colors.exists && !shown.exists) return classify_scalars<SIDE>(raw, classifier, box, take);
    classify_scalars<SIDE>(raw, classifier, box, [&](int64_t x, int64_t y, int64_t z, FourChannels channels) {
        int64_t voxel[3] = {box.first[2] + z, box.first[1] + y, box.first[0] + x};
        if (colors.exists) {
            const uint8_t* color = &colors.value(voxel[0], voxel[1], voxel[2], 0);
            channels *= FourChannels{(float)color[0], (float)color[1], (float)color[2], 255.0f} / 255.0f;
        }
        if (shown.exists && !shown.value(voxel[0], voxel[1], voxel[2])) channels = {};
        take(x, y, z, channels);
    });
}

}  // namespace
