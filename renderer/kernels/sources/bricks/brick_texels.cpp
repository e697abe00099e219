// Make the texels of bricks of voxels (renderer/bricks/texels.py).
#include "bricks/brick_texels.h"
#include "transfer/transfer.h"
#include "bricks/absent.h"

namespace {

// Call `function(x)` for places x in a row of `side` numbers, at least eight, so that the eight numbers from each x on
// are all numbers of the row, some of them twice.
template <class Function>
INLINE void for_eights(int64_t side, Function function) {
    for (int64_t first = 0; first < side; first += 8) function(least(first, side - 8));
}

// Return the scaled differences of the voxels after and before eight voxels, times their weights. A difference is
// one-sided beside a voxel without data, and NaN at such a voxel.
template <bool HAS_ABSENT>
INLINE Eight difference(Eight before, Eight here, Eight after, double scale, Eight weight) {
    if constexpr (HAS_ABSENT) {
        auto are_nan = [](Eight values) { return mask_of(values != values); };
        weight = where(are_nan(before) | are_nan(after), in_all<Eight>(1.0), weight);
        before = where(are_nan(before), here, before);
        after = where(are_nan(after), here, after);
        return where(are_nan(here), here, (after * scale - before * scale) * weight);
    }
    return (after * scale - before * scale) * weight;
}

// The voxels of the volume that give the gradients of the texels along one axis of a brick.
struct Places {
    // For each texel, the nearest voxel of the volume, counted from the first texel on.
    int64_t nearest[PADDED_BRICK_SIZE + 2];
    // For each texel, the weight of the difference between the two voxels beside the nearest one.
    double weights[PADDED_BRICK_SIZE + 2];
    // Whether any texel is beyond the border of the volume.
    bool are_beyond = false;

    // num: the number of voxels of the volume along the axis. start: the voxel of the volume at the first texel. side:
    // the number of texels. weight: the weight of all differences; at 0, the weight of a difference is the reciprocal
    // of the distance of its two voxels.
    Places(int64_t num, int64_t start, int64_t side, double weight) {
        for (int64_t t = 0; t < side; t++) {
            int64_t voxel = least(most<int64_t>(start + t, 0), num - 1);
            int64_t distance = least(voxel + 1, num - 1) - most<int64_t>(voxel - 1, 0);
            weights[t] = weight > 0 ? weight : 1.0 / (double)most<int64_t>(distance, 1);
            nearest[t] = voxel - start;
            are_beyond |= nearest[t] != t;
        }
    }
};

// Write the gradients of a brick, in world axes, to `gradients` [3, n, n, n]; NaN without data.
//
// field: the scalars, [n + 2, n + 2, n + 2] or larger. shape: the volume's shape. m: the matrix from gradients along
// the index axes to the world. scale: a factor with which no difference of two scalars overflows. weight: the weight of
// differences along each axis; 0 for the reciprocal of their distance in voxels, as scalars need.
template <bool HAS_ABSENT>
void fill_gradients(const Field& field, const int64_t (&shape)[3], const Array<const int32_t, 1>& cell,
                    const double (&m)[9], double scale, const Array<double, 4>& gradients, double weight = 0) {
    int64_t side = gradients.shape[1];
    auto places = [&](int axis) {
        return Places(shape[2 - axis], BRICK_SIZE * cell[axis] - (side - BRICK_SIZE) / 2, side, weight);
    };
    Places along_x = places(0), along_y = places(1), along_z = places(2);
    for (int64_t t = 0; t < side; t++)
        for (int64_t u = 0; u < side; u++) {
            int64_t z = along_z.nearest[t], y = along_y.nearest[u];
            double wy = along_y.weights[u], wz = along_z.weights[t];
            const double *here = &field(z + 1, y + 1, 1), *below = &field(z, y + 1, 1), *above = &field(z + 2, y + 1, 1);
            const double *front = &field(z + 1, y, 1), *back = &field(z + 1, y + 2, 1);
            double* to[3] = {&gradients(0, t, u, 0), &gradients(1, t, u, 0), &gradients(2, t, u, 0)};
            for_eights(side, [&](int64_t x) __attribute__((always_inline)) {
                auto values = [&](const double* row) { return load<Eight>(row, x); };
                Eight middle = values(here);
                Eight gx = difference<HAS_ABSENT>(values(here - 1), middle, values(here + 1), scale,
                                                  load<Eight>(along_x.weights, x));
                Eight gy = difference<HAS_ABSENT>(values(front), middle, values(back), scale, in_all<Eight>(wy));
                Eight gz = difference<HAS_ABSENT>(values(below), middle, values(above), scale, in_all<Eight>(wz));
                store(to[0], x, m[0] * gx + m[1] * gy + m[2] * gz);
                store(to[1], x, m[3] * gx + m[4] * gy + m[5] * gz);
                store(to[2], x, m[6] * gx + m[7] * gy + m[8] * gz);
            });
            if (!along_x.are_beyond) continue;
            for (double* row : to)
                for (int64_t x = 0; x < side; x++) row[x] = row[along_x.nearest[x]];
        }
}

// Smooth a field by (1, 4, 6, 4, 1) / 16 along each axis, and move the numbers by two places towards index 0.
void smooth(const Field& field) {
    int64_t side = field.shape[0], steps[3] = {1, side, side * side};
    for (int64_t step : steps)
        for (int64_t k = 0; k + 4 * step < field.size(); k++) {
            const double* f = &field.data[k];
            field.data[k] = (f[0] + f[4 * step] + 4 * (f[step] + f[3 * step]) + 6 * f[2 * step]) / 16;
        }
}

// The length of a vector towards the light that is added to the normals of labels. A normal of a label is the slope of
// smoothed opacities, at most 3/8 long. Where a clip plane cuts a label far from its surface, the slope is 0, and
// without this vector the cut would be dark.
constexpr double TILT = 0.05;

// Write the gradients of the smoothed opacities of labels to `gradients` [3, n, n, n]; other parameters are as in
// `fill_gradients`.
//
// opacities: the opacity of each label, by its number; beyond the volume's border opacities are 0. field: scratch
// space, [n + 6, n + 6, n + 6].
void fill_label_gradients(const Voxels& voxels, const Array<const int32_t, 1>& cell, const double (&m)[9],
                          const Array<const double, 1>& opacities, const double (&toward_light)[3], const Field& field,
                          const Array<double, 4>& gradients) {
    load_brick(voxels, cell, field);
    clear_beyond_border(voxels, cell, field);
    for (int64_t k = 0; k < field.size(); k++) field.data[k] = opacities[(int64_t)field.data[k]];
    smooth(field);
    fill_gradients<false>(field, voxels.raw.shape, cell, m, 1.0, gradients, 0.5);
    int64_t num = gradients.size() / 3;
    for (int64_t k = 0; k < 3 * num; k++) gradients.data[k] -= TILT * toward_light[k / num];
}

// The parts of the memory in which the texels of a brick are made.
struct Scratch {
    // The scalars of the texels, and of the voxels around them if there is light.
    Field field;
    // The voxels of `field` and those around them, if there are voxels without data; otherwise empty.
    Field around;
    // The opacities of lit labels and of the labels around them; otherwise empty.
    Field smoothed;
    // The gradients of the texels, [3, 18, 18, 18]; empty without light.
    Array<double, 4> planes;
    // The gradients of the texels and around them, [3, 20, 20, 20], if there are voxels without data; otherwise empty.
    Array<double, 4> gradients;
    // The number of doubles of all parts.
    int64_t size = 0;

    Scratch(const TexelRules& rules, double* memory) {
        auto take = [&](int64_t num) {
            double* part = memory == nullptr ? nullptr : memory + size;
            size += num;
            return part;
        };
        auto cube = [&](int64_t side) { return Field{take(side * side * side), {side, side, side}}; };
        auto three = [&](int64_t side) {
            return Array<double, 4>{take(3 * side * side * side), {3, side, side, side}};
        };
        bool is_lit = rules.is_lit, has_absent = rules.voxels.has_absent;
        field = cube(PADDED_BRICK_SIZE + 2 * is_lit);
        around = cube(has_absent ? PADDED_BRICK_SIZE + 2 * is_lit + 2 : 0);
        smoothed = cube(is_lit && rules.voxels.is_labels ? PADDED_BRICK_SIZE + 6 : 0);
        planes = three(is_lit ? PADDED_BRICK_SIZE : 0);
        gradients = three(is_lit && has_absent ? PADDED_BRICK_SIZE + 2 : 0);
    }
};

// Write the gradients of a brick to `scratch.planes`; NaN at voxels far from any data.
void fill_planes(const TexelRules& rules, const Array<const int32_t, 1>& cell, const Scratch& scratch) {
    const auto& [voxels, first, width, factor, m, scale, toward_light, opacities, is_lit, voxel_texels] = rules;
    if (voxels.is_labels) {
        fill_label_gradients(voxels, cell, m, opacities, toward_light, scratch.smoothed, scratch.planes);
    } else if (voxels.has_absent) {
        fill_gradients<true>(scratch.around, voxels.raw.shape, cell, m, scale, scratch.gradients);
        for (int axis = 0; axis < 3; axis++) fill_absent(scratch.gradients[axis], scratch.planes[axis]);
    } else {
        fill_gradients<false>(scratch.field, voxels.raw.shape, cell, m, scale, scratch.planes);
    }
}
// Return the texels of eight scalars. scalars: NaN at voxels far from any data.
INLINE Eight normalized(const TexelRules& rules, Eight scalars) {
    scalars = where(mask_of(scalars != scalars), in_all<Eight>(rules.first), scalars);
    Eight inside = (scalars * rules.factor - rules.first * rules.factor) / rules.width;
    return min_of(max_of(inside, in_all<Eight>(-MAX_NORMALIZED_SCALAR)), in_all<Eight>(MAX_NORMALIZED_SCALAR));
}

// Write the voxels of a brick and its halo as its texels.
void copy_voxels(const TexelRules& rules, const Array<const int32_t, 1>& cell, void* texels) {
    const AnyArray<3>& raw = rules.voxels.raw;
    int64_t side = voxel_side(rules), first[3];
    for (int axis = 0; axis < 3; axis++) first[axis] = BRICK_SIZE * cell[axis] - (side - BRICK_SIZE) / 2;
    auto copy = [&]<class T>(T* out) {
        const Array<const T, 3> voxels = {(const T*)raw.data, {raw.shape[0], raw.shape[1], raw.shape[2]}};
        T turned = (T)rules.voxel_texels.value.sign_bit;
        auto convert = [turned](T voxel) { return (T)(voxel ^ turned); };
        if (rules.is_lit) load_values(voxels, box_of(raw), first, BRICK_SIZE + 4 * HALO, out, convert);
        else load_values(voxels, box_of(raw), first, PADDED_BRICK_SIZE, out, convert);
    };
    if (rules.voxel_texels.value.num_bytes == 1) copy((uint8_t*)texels);
    else copy((uint16_t*)texels);
}

// Write eight gradients to `out` [24], x, y and z of each side by side; 0 in place of NaN.
template <int... LANE>
INLINE void store_gradients(Eight x, Eight y, Eight z, float* out, Lanes<LANE...>) {
    auto rounded = [](Eight values) {
        values = where(mask_of(values != values), in_all<Eight>(0.0), values);
        return __builtin_convertvector(values, Vector<float, 8>);
    };
    auto two = join(rounded(x), rounded(y)), other = join(rounded(z), rounded(z));
    auto mixed = __builtin_shufflevector(two, other, (LANE / 3 + LANE % 3 * 8)...);
    __builtin_memcpy(out, &mixed, 24 * sizeof(float));
}

}  // namespace

int64_t scratch_size(const TexelRules& rules) { return rules.voxel_texels.exists ? 0 : Scratch(rules, nullptr).size; }

int64_t texel_floats(const TexelRules& rules) {
    int64_t side = voxel_side(rules);
    if (rules.voxel_texels.exists) return side * side * side * rules.voxel_texels.value.num_bytes / (int64_t)sizeof(float);
    return (rules.is_lit ? 4 : 1) * PADDED_BRICK_SIZE * PADDED_BRICK_SIZE * PADDED_BRICK_SIZE;
}

bool are_complete(const TexelRules& rules) {
    const AnyArray<3>& raw = rules.voxels.raw;
    const auto& [is_of_voxels, form] = rules.voxel_texels;
    bool has_form = raw.dtype == 0 ? form.num_bytes == 1 : raw.dtype == 2 && form.num_bytes == 2;
    return (!is_of_voxels || has_form) && fits(rules.voxels.scalars, raw);
}

bool is_brick_of(const TexelRules& rules, const Array<const int32_t, 1>& cell) { return is_brick(rules.voxels, cell); }

void make_texels(const TexelRules& rules, const Array<const int32_t, 1>& cell, double* memory, float* texels) {
    if (rules.voxel_texels.exists) {
        copy_voxels(rules, cell, texels);
        return;
    }
    constexpr int64_t size = PADDED_BRICK_SIZE, num = size * size * size;
    const bool is_lit = rules.is_lit, has_absent = rules.voxels.has_absent;
    const Scratch scratch(rules, memory);
    // Gradients need the voxels next to the texels, and so do the means that replace voxels without data.
    load_brick(rules.voxels, cell, has_absent ? scratch.around : scratch.field);
    if (has_absent) fill_absent(scratch.around, scratch.field);
    if (is_lit) fill_planes(rules, cell, scratch);
    for (int64_t z = 0; z < size; z++)
        for (int64_t y = 0; y < size; y++) {
            int64_t row = (z * size + y) * size;
            const double* scalars = &scratch.field(z + is_lit, y + is_lit, is_lit);
            for_eights(size, [&](int64_t x) __attribute__((always_inline)) {
                auto u = __builtin_convertvector(normalized(rules, load<Eight>(scalars, x)), Vector<float, 8>);
                if (has_absent) {
                    Eight voxels = load<Eight>(&scratch.around(z + is_lit + 1, y + is_lit + 1, is_lit + 1), x);
                    auto are_absent = __builtin_convertvector(mask_of(voxels != voxels), Vector<int32_t, 8>);
                    auto bits = __builtin_bit_cast(Vector<int32_t, 8>, u);
                    u = __builtin_bit_cast(Vector<float, 8>, (bits & ~1) | (are_absent & 1));
                }
                store(texels, row + x, u);
                if (!is_lit) return;
                auto of_axis = [&](int axis) { return load<Eight>(&scratch.planes(axis, z, y, 0), x); };
                store_gradients(of_axis(0), of_axis(1), of_axis(2), texels + num + 3 * (row + x), UpTo<32>());
            });
        }
}

Status fill_scalar_texels(const FillScalarTexels* arguments) {
    const auto& [rules, cells, slots, texels] = *arguments;
    if (!fit_together(rules.voxels, cells) || !match(slots, cells) || texels.shape[1] != texel_floats(rules) || !are_complete(rules))
        return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < cells.shape[0]; i++)
        if (slots[i] < 0 || slots[i] >= texels.shape[0]) return OUT_OF_BOUNDS;
    const Buffer<double> scratch(scratch_size(rules));
    if (!scratch) return NO_MEMORY;
    for (int64_t i = 0; i < cells.shape[0]; i++) make_texels(rules, cells[i], scratch.data, texels[slots[i]].data);
    return DONE;
}
