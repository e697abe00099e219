// Make the texels of bricks of voxels (renderer/bricks/texels.py).
#include "absent.h"
#include "transfer.h"

namespace {

// A difference times its weight, one-sided beside a voxel without data; NaN in one.
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

// Memory for the gradients of a brick along x, y, z.
struct Gradients : Buffer<double> {
    Array<double, 4> planes;
    explicit Gradients(int64_t side) : Buffer(3 * side * side * side), planes{data, {3, side, side, side}} {}
};

// Along an axis, for each of the places in a brick: the place of the voxel that is taken there, the nearest, and the
// reciprocal of the number of voxels from the one before to the one after it.
struct Places {
    int64_t nearest[PADDED_BRICK_SIZE + 2];
    double weights[PADDED_BRICK_SIZE + 2];

    // num: the voxels of the volume along the axis. start: of these, that at place 0.
    Places(int64_t num, int64_t start, int64_t side) {
        for (int64_t t = 0; t < side; t++) {
            int64_t voxel = least(most<int64_t>(start + t, 0), num - 1);
            int64_t distance = least(voxel + 1, num - 1) - most<int64_t>(voxel - 1, 0);
            weights[t] = 1.0 / (double)most<int64_t>(distance, 1);
            nearest[t] = voxel - start;
        }
    }
};

// Write the gradients of a brick, which `m` takes to the world, to [3, n, n, n]; NaN without data. field: the scalars,
// [n + 2, n + 2, n + 2]. shape: the volume's. With the factor `scale`, no difference of two scalars overflows.
template <bool HAS_ABSENT>
void fill_gradients(const Field& field, const int64_t (&shape)[3], const Array<const int32_t, 1>& cell,
                    const Array<const double, 2>& m, double scale, const Array<double, 4>& gradients) {
    int64_t side = gradients.shape[1];
    auto places = [&](int axis) {
        return Places(shape[2 - axis], BRICK_SIZE * cell[axis] - (side - BRICK_SIZE) / 2, side);
    };
    Places along_x = places(0), along_y = places(1), along_z = places(2);
    const double m00 = m(0, 0), m01 = m(0, 1), m02 = m(0, 2), m10 = m(1, 0), m11 = m(1, 1), m12 = m(1, 2),
                 m20 = m(2, 0), m21 = m(2, 1), m22 = m(2, 2);
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
                to[0][x] = m00 * gx + m01 * gy + m02 * gz;
                to[1][x] = m10 * gx + m11 * gy + m12 * gz;
                to[2][x] = m20 * gx + m21 * gy + m22 * gz;
            }
            for (double* row : to)
                for (int64_t x = 0; x < side; x++) row[x] = row[along_x.nearest[x]];
        }
}

}  // namespace

// Write texels [n, 18, 18, 18, c], as `scalar_texels` returns them, of bricks at cells [n, 3] (x, y, z). first, width,
// factor: of the range, as `range_width` returns them. world_from_gradient: [3, 3], where texels have gradients. With
// the factor `scale`, no difference of two scalars overflows.
Status fill_scalar_texels(const FillScalarTexels* arguments) {
    const auto [voxels, cells, first, width, factor, world_from_gradient, scale, texels] = *arguments;
    const auto [is_lit, m] = world_from_gradient;
    if (!fit_together(voxels, cells) || texels.shape[0] != cells.shape[0]) return OUT_OF_BOUNDS;
    for (int axis = 1; axis < 4; axis++)
        if (texels.shape[axis] != PADDED_BRICK_SIZE) return OUT_OF_BOUNDS;
    if (texels.shape[4] != (is_lit ? 4 : 1) || (is_lit && (m.shape[0] != 3 || m.shape[1] != 3))) return OUT_OF_BOUNDS;
    // Gradients need the voxels next to those of texels, and so does what takes the place of voxels without data.
    bool has_absent = voxels.has_absent;
    int64_t margin = is_lit, side = PADDED_BRICK_SIZE + 2 * margin, gradient_side = PADDED_BRICK_SIZE + 2 * has_absent;
    Cube field(side), around(side + 2);
    Gradients gradients(is_lit * gradient_side), filled(is_lit * PADDED_BRICK_SIZE);
    if (!field || !around || !gradients || !filled) return NO_MEMORY;
    for (int64_t i = 0; i < cells.shape[0]; i++) {
        load_brick(voxels, cells[i], has_absent ? around.field : field.field);
        if (has_absent) fill_absent(around.field, field.field);
        auto for_texels = [&](auto function) {
            for (int64_t z = 0; z < PADDED_BRICK_SIZE; z++)
                for (int64_t y = 0; y < PADDED_BRICK_SIZE; y++)
                    for (int64_t x = 0; x < PADDED_BRICK_SIZE; x++) function(z, y, x);
        };
        for_texels([&](int64_t z, int64_t y, int64_t x) {
            double scalar = field.field(z + margin, y + margin, x + margin);
            if (is_nan(scalar)) scalar = first;  // far from data
            double inside = (scalar * factor - first * factor) / width;
            float u = (float)least(most(inside, -MAX_NORMALIZED_SCALAR), MAX_NORMALIZED_SCALAR);
            if (has_absent) {
                bool is_absent = is_nan(around.field(z + margin + 1, y + margin + 1, x + margin + 1));
                u = __builtin_bit_cast(float, (__builtin_bit_cast(uint32_t, u) & ~1u) | is_absent);
            }
            texels(i, z, y, x, 0) = u;
        });
        if (!is_lit) continue;
        if (has_absent) {
            fill_gradients<true>(around.field, voxels.raw.shape, cells[i], m, scale, gradients.planes);
            for (int axis = 0; axis < 3; axis++) fill_absent(gradients.planes[axis], filled.planes[axis]);
        } else {
            fill_gradients<false>(field.field, voxels.raw.shape, cells[i], m, scale, gradients.planes);
        }
        const auto& planes = has_absent ? filled.planes : gradients.planes;
        for_texels([&](int64_t z, int64_t y, int64_t x) {
            for (int axis = 0; axis < 3; axis++) {
                double value = planes(axis, z, y, x);
                texels(i, z, y, x, 1 + axis) = is_nan(value) ? 0 : (float)value;
            }
        });
    }
    return DONE;
}
