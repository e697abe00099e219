// Average extinctions and albedos over the cells of a grid in the world, and prepare the cells for sweeps of light.
#include "lighting/kernels.h"
#include "base/maths.h"
#include "base/stopping.h"
#include "lighting/layouts.h"
#include "transfer/transfer.h"

namespace {

// Return the label at a place: the one with the largest sum of weights over the 27 voxels around the nearest voxel, as in
// `draw/labels.h`. It is the label of one of the eight voxels around the place. nearest: the indices of the nearest voxel.
// apart: how far behind it the place is, along each axis.
template <class T>
INLINE T label_at(const Array<const T, 3>& voxels, const int64_t* nearest, const double* apart) {
    double weights[3][3];
    for (int axis = 0; axis < 3; axis++) {
        double t = apart[axis], before = 0.5 - t, behind = 0.5 + t;
        weights[axis][0] = 0.4 * before * before + 0.2 * most(-t, 0.0);
        weights[axis][1] = 0.8 - 0.8 * t * t - 0.2 * most(t, -t);
        weights[axis][2] = 0.4 * behind * behind + 0.2 * most(t, 0.0);
    }
    T labels[27];
    bool are_equal = true;
    for (int k = 0; k < 27; k++) {
        const int steps[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
        int64_t at[3];
        for (int axis = 0; axis < 3; axis++)  // beyond the border, the outermost labels are repeated
            at[axis] = most(least(nearest[axis] + steps[axis], voxels.shape[2 - axis] - 1), (int64_t)0);
        labels[k] = voxels(at[2], at[1], at[0]);
        are_equal = are_equal && labels[k] == labels[0];
    }
    constexpr int MIDDLE = 13;
    if (are_equal) return labels[MIDDLE];
    auto sum_of = [&](T label) {
        double sum = 0;
        for (int k = 0; k < 27; k++)
            if (labels[k] == label) sum += weights[0][k % 3] * weights[1][k / 3 % 3] * weights[2][k / 9];
        return sum;
    };
    T best = labels[MIDDLE];
    double most_weight = sum_of(best);
    for (int corner = 1; corner < 8; corner++) {
        int k = MIDDLE;
        for (int axis = 0, stride = 1; axis < 3; axis++, stride *= 3)
            if (corner >> axis & 1) k += apart[axis] < 0 ? -stride : stride;
        if (labels[k] == best) continue;
        if (double sum = sum_of(labels[k]); sum > most_weight) best = labels[k], most_weight = sum;
    }
    return best;
}

// Return the scalar at a place in voxel indices; NaN outside, beside hidden voxels, and where the nearest voxel has no
// data. The volume covers [-1/2, n - 1/2]; beyond the middles of the outermost voxels, the scalar is constant.
template <class T, class ScalarOf>
INLINE double scalar_at(const Array<const T, 3>& voxels, const AverageMatter& of, const double* place,
                        ScalarOf scalar_of) {
    int64_t first[3], next[3], nearest[3];
    double share[3];
    for (int axis = 0; axis < 3; axis++) {
        int64_t num = voxels.shape[2 - axis];
        if (!(place[axis] >= -0.5 && place[axis] <= (double)num - 0.5)) return __builtin_nan("");
        double inside = least(most(place[axis], 0.0), (double)(num - 1));
        first[axis] = (int64_t)inside, next[axis] = least(first[axis] + 1, num - 1);
        share[axis] = inside - (double)first[axis], nearest[axis] = share[axis] < 0.5 ? first[axis] : next[axis];
    }
    double middle = scalar_of(voxels(nearest[2], nearest[1], nearest[0]));
    if (of.shown.exists && !of.shown.value(nearest[2], nearest[1], nearest[0])) return __builtin_nan("");
    if (of.is_labels) {
        const double apart[3] = {first[0] + share[0] - nearest[0], first[1] + share[1] - nearest[1],
                                 first[2] + share[2] - nearest[2]};
        return scalar_of(label_at(voxels, nearest, apart));
    }
    if (is_nan(middle)) return middle;
    auto known = [&](int64_t z, int64_t y, int64_t x) {  // beside voxels without data, the nearest value is repeated
        double scalar = scalar_of(voxels(z, y, x));
        return is_nan(scalar) ? middle : scalar;
    };
    auto along_x = [&](int64_t z, int64_t y) {
        double low = known(z, y, first[0]), high = known(z, y, next[0]);
        return low * (1 - share[0]) + high * share[0];
    };
    auto along_y = [&](int64_t z) {
        return along_x(z, first[1]) * (1 - share[1]) + along_x(z, next[1]) * share[1];
    };
    return along_y(first[2]) * (1 - share[2]) + along_y(next[2]) * share[2];
}

// Return whether any scalar in a cell may be visible, by the range of all voxels near it.
template <class T, class ScalarOf>
INLINE bool may_show(const Array<const T, 3>& voxels, const AverageMatter& of, const double* low_corner,
                     ScalarOf scalar_of) {
    int64_t first[3], end[3];
    for (int axis = 0; axis < 3; axis++) {
        const double* row = of.index_from_cells + 4 * axis;
        double low = low_corner[axis], high = low, num = (double)voxels.shape[2 - axis];
        for (int k = 0; k < 3; k++) low += least(row[k], 0.0), high += most(row[k], 0.0);
        if (!(high >= -0.5 && low <= num - 0.5)) return false;
        first[axis] = (int64_t)most(low, 0.0), end[axis] = (int64_t)least(most(high, 0.0) + 2.0, num);
        first[axis] = least(first[axis], end[axis] - 1);
    }
    double least_scalar = INFINITE, most_scalar = -INFINITE;
    for (int64_t z = first[2]; z < end[2]; z++)
        for (int64_t y = first[1]; y < end[1]; y++)
            for (int64_t x = first[0]; x < end[0]; x++) {
                double scalar = scalar_of(voxels(z, y, x));
                if (scalar < least_scalar) least_scalar = scalar;
                if (scalar > most_scalar) most_scalar = scalar;
            }
    return least_scalar <= most_scalar && is_range_visible(of.breakpoints, least_scalar, most_scalar);
}

}  // namespace

// Add the means over the cells of a slab.
Status average_matter(const AverageMatter* arguments) {
    const auto& of = *arguments;
    const auto& out = of.out;
    if (of.slab < 0 || of.slab >= out.shape[1] || out.shape[0] != 4 || of.num_places < 1 || !fits(of.curve) ||
        of.raw.shape[0] * of.raw.shape[1] * of.raw.shape[2] == 0)
        return OUT_OF_BOUNDS;
    if (of.shown.exists && !has_shape(of.shown.value, of.raw.shape[0], of.raw.shape[1], of.raw.shape[2]))
        return OUT_OF_BOUNDS;
    const double* m = of.index_from_cells;
    double step = 1.0 / (double)of.num_places, share = step * step * step;
    return with_array(of.raw, [&]<class T>(const Array<const T, 3>& voxels) {
        constexpr int num_bits = 8 * sizeof(T);
        bool is_right = num_bits > 16 ? !of.scalars.exists
                                      : T(-1) > 0 && of.scalars.exists && of.scalars.value.shape[0] == 1ll << num_bits;
        if (!is_right) return OUT_OF_BOUNDS;
        auto scalar_of = [&](T voxel) {
            if constexpr (num_bits <= 16) return of.scalars.value[(int64_t)voxel];
            else return (double)voxel;
        };
        for (int64_t y = 0; y < out.shape[2]; y++) {
            if (is_stopped()) return STOPPED;
            for (int64_t x = 0; x < out.shape[3]; x++) {
                Channels sum = {};
                double corner[3];
                for (int axis = 0; axis < 3; axis++)
                    corner[axis] = m[4 * axis] * (double)x + m[4 * axis + 1] * (double)y +
                                   m[4 * axis + 2] * (double)of.slab + m[4 * axis + 3];
                if (!may_show(voxels, of, corner, scalar_of)) continue;
                for (int64_t c = 0; c < of.num_places; c++)
                    for (int64_t b = 0; b < of.num_places; b++)
                        for (int64_t a = 0; a < of.num_places; a++) {
                            double u = (double)x + ((double)a + 0.5) * step, v = (double)y + ((double)b + 0.5) * step;
                            double w = (double)of.slab + ((double)c + 0.5) * step, place[3];
                            for (int axis = 0; axis < 3; axis++)
                                place[axis] = m[4 * axis] * u + m[4 * axis + 1] * v + m[4 * axis + 2] * w +
                                              m[4 * axis + 3];
                            sum += classify_scalar(of.curve, false, scalar_at(voxels, of, place, scalar_of));
                        }
                for (int channel = 0; channel < 4; channel++)
                    out(channel, of.slab, y, x) += (float)(sum[channel] * share);
            }
        }
        return DONE;
    });
}

// Write how the cells of a block scatter and let light through.
Status prepare_cells(const PrepareCells* arguments) {
    const auto& [cells, path, block, albedos, along_x, along_z] = *arguments;
    Shape shape = shape_of(along_x, along_z);
    bool fits = shape.has(block) && shape.fits(cells, 4) && shape.fits(albedos, 3) && shape.fits(along_x, 3) &&
        shape.fits_turned(along_z, 3);
    if (!fits) return OUT_OF_BOUNDS;
    for_tiles(shape, block, [&](int64_t y, const Tile& tile) {
        for (int64_t z = tile.z; z < tile.z + tile.num_z; z++)
            for (int64_t x = tile.x; x < tile.x + tile.num_x; x++) {
                double depth = (double)cells(3, z, y, x), through = exp_of(-path * depth);
                for (int c = 0; c < 3; c++)
                    albedos(c, z, y, x) = depth > 0 ? (float)least((double)cells(c, z, y, x) / depth, 1.0) : 0.0f;
                // As in `share_of_seen`.
                double seen = depth > LEAST_DEPTH ? expm1_of(-(1 + path) * depth) / ((1 + path) * expm1_of(-depth))
                                                  : exp_of(-0.5 * path * depth);
                float found[3] = {(float)seen, (float)through, (float)depth};
                for (int k = 0; k < 3; k++) along_x(k, z, y, x) = along_z(k, x, y, z) = found[k];
            }
    });
    return DONE;
}
