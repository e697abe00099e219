// Average extinctions over cells, and send rays through them.
//
// Grids have the outermost cells once more beyond each border, so that the nearest ones hold there. Places are in
// cells: the centre of cell i is at i + 1 along each axis, and the volume begins at 1/2.
#include "light_grid.h"
#include "transfer.h"

namespace {

// Less than exp(-10) of the light, 5e-5, counts as none.
constexpr float OPAQUE_DEPTH = 10.0f;

// Whether a cell or one of its 26 neighbours shows anything: the others are never interpolated where something is
// visible.
bool is_visible_near(const Array<const float, 3>& depths, int64_t x, int64_t y, int64_t z) {
    for (int64_t k = z; k < z + 3; k++)
        for (int64_t j = y; j < y + 3; j++)
            for (int64_t i = x; i < x + 3; i++)
                if (depths(k, j, i) > 0) return true;
    return false;
}

}  // namespace

// Write the mean optical depths [y, x] of cells of 2^level voxels, in a slab that is one cell thick.
//
// A cell that the border cuts has the mean of what is inside. by_pattern, curve: to classify by, as of a Classifier.
Status average_voxels(const AverageVoxels* arguments) {
    const auto [raw, by_pattern, curve, level, slab, out] = *arguments;
    const auto [num_z, num_y, num_x] = raw.shape;
    int64_t side = (int64_t)1 << level, z0 = slab << level, z1 = least((slab + 1) << level, num_z);
    auto num_cells = [&](int64_t num) { return (num + side - 1) >> level; };
    if (!has_shape(out, num_cells(num_y), num_cells(num_x)) || z0 < 0 || z0 >= num_z) return OUT_OF_BOUNDS;
    Buffer<double> sums(out.shape[1]);
    if (!sums) return NO_MEMORY;
    auto end_of = [&](int64_t cell) { return least((cell + 1) << level, num_x); };
    return with_array(raw, [&]<class T>(const Array<const T, 3>& voxels) {
        constexpr int num_bits = 8 * sizeof(T);
        bool is_right = num_bits > 16 ? curve.exists && fits(curve.value)
                                      : T(-1) > 0 && by_pattern.exists && by_pattern.value.shape[0] == 1ll << num_bits;
        if (!is_right) return OUT_OF_BOUNDS;
        auto depth_of = [&](T voxel) {
            if constexpr (num_bits <= 16) return (double)by_pattern.value[(int64_t)voxel];
            else return classify_scalar(curve.value, false, (double)voxel).a;
        };
        for (int64_t row = 0; row < out.shape[0]; row++) {
            int64_t y0 = row << level, y1 = least((row + 1) << level, num_y), num_lines = (y1 - y0) * (z1 - z0);
            for (int64_t cell = 0; cell < out.shape[1]; cell++) sums[cell] = 0.0;
            for (int64_t z = z0; z < z1; z++)
                for (int64_t y = y0; y < y1; y++) {
                    const auto line = voxels[z][y];
                    for (int64_t cell = 0; cell < out.shape[1]; cell++) {
                        double sum = sums[cell];
                        for (int64_t x = cell << level; x < end_of(cell); x++) sum += depth_of(line[x]);
                        sums[cell] = sum;
                    }
                }
            for (int64_t cell = 0; cell < out.shape[1]; cell++)
                out(row, cell) = (float)(sums[cell] / (double)((end_of(cell) - (cell << level)) * num_lines));
        }
        return DONE;
    });
}

// Write the mean transmission of rays from the centres of a slab's cells [y, x]; 1 where nothing is visible near.
//
// depths: [z + 2, y + 2, x + 2], mean optical depths of a finest spacing. end: (x, y, z), the volume's border.
// offsets: [rays, samples, 3] (x, y, z), from a centre to where its rays are sampled, outwards. lengths: [samples],
// those that samples stand for, in finest spacings. A ray ends at the border.
Status transmit(const Transmit* arguments) {
    const auto [depths, offsets, lengths, end, slab, out] = *arguments;
    bool fits = slab >= 0 && slab + 2 < depths.shape[0] && has_shape(out, depths.shape[1] - 2, depths.shape[2] - 2) &&
        has_shape(offsets, offsets.shape[0], lengths.shape[0], 3);
    for (int axis = 0; axis < 3; axis++) fits &= end[axis] < (float)(depths.shape[2 - axis] - 1);
    if (!fits) return OUT_OF_BOUNDS;
    auto is_inside = [&](int axis, float place) { return 0.5f <= place && place <= end[axis]; };
    for (int64_t row = 0; row < out.shape[0]; row++) {
        for (int64_t cell = 0; cell < out.shape[1]; cell++) {
            if (!is_visible_near(depths, cell, row, slab)) {
                out(row, cell) = 1.0f;
                continue;
            }
            float x = (float)cell + 1.0f, y = (float)row + 1.0f, z = (float)slab + 1.0f, total = 0.0f;
            for (int64_t ray = 0; ray < offsets.shape[0]; ray++) {
                float depth = 0.0f;
                for (int64_t k = 0; k < lengths.shape[0] && !(depth > OPAQUE_DEPTH); k++) {
                    float u = x + offsets(ray, k, 0), v = y + offsets(ray, k, 1), w = z + offsets(ray, k, 2);
                    if (!(is_inside(0, u) && is_inside(1, v) && is_inside(2, w))) break;
                    depth += lengths[k] * interpolate_cells(depths, u, v, w);
                }
                total += (float)exp_of(-(double)depth);
            }
            out(row, cell) = total / (float)offsets.shape[0];
        }
    }
    return DONE;
}
