// Make the texels of bricks of voxels (renderer/bricks/texels.py).
#include "bricks/kernels.h"
#include "transfer/transfer.h"
#include "bricks/absent.h"

namespace {

// Return the scaled difference of the voxels after and before a voxel, times a weight. The difference is one-sided
// beside a voxel without data, and NaN at such a voxel.
template <bool HAS_ABSENT>
INLINE double difference(double before, double here, double after, double scale, double weight) {
    if constexpr (HAS_ABSENT) {
        weight = is_nan(before) || is_nan(after) ? 1.0 : weight;
        before = is_nan(before) ? here : before;
        after = is_nan(after) ? here : after;
        return is_nan(here) ? here : (after * scale - before * scale) * weight;
    }
    return (after * scale - before * scale) * weight;
}

// The voxels of the volume that give the gradients of the texels along one axis of a brick.
struct Places {
    // For each texel, the nearest voxel of the volume, counted from the first texel on.
    int64_t nearest[PADDED_BRICK_SIZE + 2];
    // For each texel, the weight of the difference between the two voxels beside the nearest one.
    double weights[PADDED_BRICK_SIZE + 2];

    // num: the number of voxels of the volume along the axis. start: the voxel of the volume at the first texel. side:
    // the number of texels. weight: the weight of all differences; at 0, the weight of a difference is the reciprocal
    // of the distance of its two voxels.
    Places(int64_t num, int64_t start, int64_t side, double weight) {
        for (int64_t t = 0; t < side; t++) {
            int64_t voxel = least(most<int64_t>(start + t, 0), num - 1);
            int64_t distance = least(voxel + 1, num - 1) - most<int64_t>(voxel - 1, 0);
            weights[t] = weight > 0 ? weight : 1.0 / (double)most<int64_t>(distance, 1);
            nearest[t] = voxel - start;
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
            for (int64_t x = 0; x < side; x++) {
                double gx = difference<HAS_ABSENT>(here[x - 1], here[x], here[x + 1], scale, along_x.weights[x]);
                double gy = difference<HAS_ABSENT>(front[x], here[x], back[x], scale, wy);
                double gz = difference<HAS_ABSENT>(below[x], here[x], above[x], scale, wz);
                to[0][x] = m[0] * gx + m[1] * gy + m[2] * gz;
                to[1][x] = m[3] * gx + m[4] * gy + m[5] * gz;
                to[2][x] = m[6] * gx + m[7] * gy + m[8] * gz;
            }
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

}  // namespace

// Write the texels of bricks of voxels.
Status fill_scalar_texels(const FillScalarTexels* arguments) {
    const auto [voxels, cells, first, width, factor, m, scale, toward_light, opacities, texels] = *arguments;
    constexpr int64_t size = PADDED_BRICK_SIZE, num = size * size * size;
    const bool is_lit = texels.shape[1] == 4 * num, has_absent = voxels.has_absent;
    if (!fit_together(voxels, cells) || !has_shape(texels, cells.shape[0], is_lit ? 4 * num : num))
        return OUT_OF_BOUNDS;
    // Gradients need the voxels next to the texels, and so do the means that replace voxels without data.
    int64_t margin = is_lit, side = size + 2 * margin, gradient_side = is_lit * (size + 2 * has_absent);
    Cube field(side), around(side + 2), smoothed(size + 6);
    Buffer<double> memory(3 * gradient_side * gradient_side * gradient_side), filled(3 * num);
    if (!field || !around || !smoothed || !memory || !filled) return NO_MEMORY;
    const Array<double, 4> gradients = {memory.data, {3, gradient_side, gradient_side, gradient_side}};
    const Array<double, 4> planes = {has_absent ? filled.data : memory.data, {3, size, size, size}};
    for (int64_t i = 0; i < cells.shape[0]; i++) {
        load_brick(voxels, cells[i], has_absent ? around.field : field.field);
        if (has_absent) fill_absent(around.field, field.field);
        if (is_lit && voxels.is_labels) {
            fill_label_gradients(voxels, cells[i], m, opacities, toward_light, smoothed.field, gradients);
        } else if (is_lit && has_absent) {
            fill_gradients<true>(around.field, voxels.raw.shape, cells[i], m, scale, gradients);
            for (int axis = 0; axis < 3; axis++) fill_absent(gradients[axis], planes[axis]);
        } else if (is_lit) {
            fill_gradients<false>(field.field, voxels.raw.shape, cells[i], m, scale, gradients);
        }
        for (int64_t z = 0; z < size; z++)
            for (int64_t y = 0; y < size; y++)
                for (int64_t x = 0; x < size; x++) {
                    double scalar = field.field(z + margin, y + margin, x + margin);
                    if (is_nan(scalar)) scalar = first;  // a voxel far from any data
                    double inside = (scalar * factor - first * factor) / width;
                    float u = (float)least(most(inside, -MAX_NORMALIZED_SCALAR), MAX_NORMALIZED_SCALAR);
                    if (has_absent) {
                        bool is_absent = is_nan(around.field(z + margin + 1, y + margin + 1, x + margin + 1));
                        u = __builtin_bit_cast(float, (__builtin_bit_cast(uint32_t, u) & ~1u) | is_absent);
                    }
                    int64_t at = (z * size + y) * size + x;
                    texels(i, at) = u;
                    for (int axis = 0; axis < 3 * is_lit; axis++) {
                        double value = planes(axis, z, y, x);
                        texels(i, num + 3 * at + axis) = is_nan(value) ? 0 : (float)value;
                    }
                }
    }
    return DONE;
}
