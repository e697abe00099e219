// Average extinctions over cells, and send rays through them.
//
// Grids repeat the outermost cells once beyond each border, so that interpolation has cells on both sides there.
// Positions are in cells: the centre of cell i is at i + 1 along each axis, and the volume begins at 1/2.
#include "lighting/kernels.h"
#include "base/lanes.h"
#include "base/stopping.h"
#include "pyramid/brick_ranges.h"
#include "transfer/light_grid.h"
#include "transfer/transfer.h"

namespace {

// The optical depth beyond which a ray ends, because no more than exp(-10) = 5e-5 of its light is left.
constexpr float OPAQUE_DEPTH = 10.0f;

// The number of cells in a part of a row of cells. Parts in which nothing is visible are skipped. The number is the
// same in renderer/lighting/light_grid.py.
constexpr int64_t CELLS_OF_PART = 16;
static_assert(LANES <= CELLS_OF_PART);

// Return the values of a grid at the positions of lanes that are all in one row, as `interpolate_cells` does. Only
// values in the lanes of `is_met` have a meaning.
INLINE Floats interpolate_row(const Array<const float, 3>& grid, Floats x, float y, float z, Mask is_met) {
    const Array<const float, 1> flat = {grid.data, {grid.size()}};
    int64_t j = (int64_t)y, k = (int64_t)z, row = grid.shape[2], slab = grid.shape[1] * row;
    Ints i = to_int32(x);
    int64_t begin = k * slab + j * row + i[0];
    Floats a = x - to_float32(i), values = 0.0f;
    // The cells of lanes lie side by side, unless a position was rounded across the middle of a cell, or is before the
    // first cell.
    if (any_of(mask_of(i != i[0] + lane_numbers<Ints>())) || begin < 0 || begin + slab + row + LANES >= flat.shape[0]) {
        for (int lane = 0; lane < LANES; lane++)
            if (is_met[lane]) values[lane] = interpolate_cells(grid, x[lane], y, z);
        return values;
    }
    auto along_x = [&](int64_t step) {
        Floats first = load<Floats>(flat, begin + step);
        return first + a * (load<Floats>(flat, begin + step + 1) - first);
    };
    Floats near = along_x(0), below = along_x(row), far = along_x(slab), beyond = along_x(slab + row);
    near += (y - (float)j) * (below - near), far += (y - (float)j) * (beyond - far);
    return near + (z - (float)k) * (far - near);
}

}  // namespace

// Write the mean optical depths of cells of 2^level voxels in a slab, which is one cell thick. A cell that the border
// cuts has the mean of the voxels inside the volume.
Status average_voxels(const AverageVoxels* arguments) {
    const auto [raw, by_pattern, curve, ranges, breakpoints, level, slab, out] = *arguments;
    const auto [num_z, num_y, num_x] = raw.shape;
    int64_t side = (int64_t)1 << level, z0 = slab << level, z1 = least((slab + 1) << level, num_z);
    auto num_cells = [&](int64_t num) { return (num + side - 1) >> level; };
    if (!has_shape(out, num_cells(num_y), num_cells(num_x)) || z0 < 0 || z0 >= num_z || !fits(ranges, raw))
        return OUT_OF_BOUNDS;
    Buffer<double> sums(out.shape[1]);
    Buffer<bool> may_show((num_x + BRICK_SIZE - 1) / BRICK_SIZE);  // the bricks along a line of voxels
    if (!sums || !may_show) return NO_MEMORY;
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
            if (is_stopped()) return STOPPED;
            int64_t y0 = row << level, y1 = least((row + 1) << level, num_y), num_lines = (y1 - y0) * (z1 - z0);
            for (int64_t cell = 0; cell < out.shape[1]; cell++) sums[cell] = 0.0;
            for (int64_t z = z0; z < z1; z++)
                for (int64_t y = y0; y < y1; y++) {
                    const auto line = voxels[z][y];
                    for (int64_t brick = 0; brick < may_show.shape[0]; brick++)
                        may_show[brick] = may_show_brick(ranges, breakpoints, BRICK_SIZE * brick, y, z);
                    for (int64_t cell = 0; cell < out.shape[1]; cell++) {
                        double sum = sums[cell];
                        for (int64_t x = cell << level, end; x < end_of(cell); x = end) {
                            end = least(end_of(cell), (x / BRICK_SIZE + 1) * BRICK_SIZE);
                            if (may_show[x / BRICK_SIZE])
                                for (int64_t k = x; k < end; k++) sum += depth_of(line[k]);
                        }
                        sums[cell] = sum;
                    }
                }
            for (int64_t cell = 0; cell < out.shape[1]; cell++)
                out(row, cell) = (float)(sums[cell] / (double)((end_of(cell) - (cell << level)) * num_lines));
        }
        return DONE;
    });
}

// Write the mean transmission of the rays from the centres of a slab's cells to the volume's border; 1 if nothing near
// a cell is visible.
Status transmit(const Transmit* arguments) {
    const auto [depths, offsets, filled, lengths, end, slab, out] = *arguments;
    bool fits = slab >= 0 && slab + 2 < depths.shape[0] && has_shape(out, depths.shape[1] - 2, depths.shape[2] - 2) &&
        has_shape(offsets, offsets.shape[0], lengths.shape[0], 3) &&
        has_shape(filled, depths.shape[0], depths.shape[1], (depths.shape[2] - 1) / CELLS_OF_PART + 1);
    for (int axis = 0; axis < 3; axis++) fits &= end[axis] < (float)(depths.shape[2 - axis] - 1);
    if (!fits) return OUT_OF_BOUNDS;
    auto is_inside = [&](int axis, float place) { return 0.5f <= place && place <= end[axis]; };
    int64_t num = out.shape[1];
    // Arrays for a row of cells, with room for whole vectors: for each cell, the largest optical depth of the cell and
    // its neighbours, the optical depth of a ray so far, and the sum of the transmissions of rays.
    Buffer<float> deepest(num + 2), ray_depths(num + LANES), totals(num + 2 + LANES);
    Buffer<int64_t> starts(num);  // the first cell of each vector, a cell near which something is visible
    if (!deepest || !ray_depths || !totals || !starts) return NO_MEMORY;
    for (int64_t row = 0; row < out.shape[0]; row++) {
        if (is_stopped()) return STOPPED;
        float y = (float)row + 1.0f, z = (float)slab + 1.0f;
        for (int64_t cell = 0; cell < num + 2; cell++) deepest[cell] = totals[cell] = 0.0f;
        for (int64_t near = 0; near < 9; near++)
            for (int64_t cell = 0; cell < num + 2; cell++)
                deepest[cell] = most(deepest[cell], depths(slab + near / 3, row + near % 3, cell));
        for (int64_t cell = 0; cell < num; cell++)
            deepest[cell] = most(most(deepest[cell], deepest[cell + 1]), deepest[cell + 2]);
        int64_t num_starts = 0;
        for (int64_t cell = 0; cell < num; cell++)
            if (deepest[cell] > 0) starts[num_starts++] = cell, cell += LANES - 1;
        for (int64_t ray = 0; ray < offsets.shape[0]; ray++) {
            for (int64_t cell = 0; cell < num; cell++) ray_depths[cell] = deepest[cell] > 0 ? 0.0f : (float)INFINITE;
            bool is_going = true;
            for (int64_t k = 0; k < lengths.shape[0] && is_going; k++) {
                float v = y + offsets(ray, k, 1), w = z + offsets(ray, k, 2);
                if (!(is_inside(1, v) && is_inside(2, w))) break;
                is_going = false;
                const auto are_filled = filled[(int64_t)w][(int64_t)v];
                for (int64_t n = 0; n < num_starts; n++) {
                    Floats u = (float)starts[n] + 1.0f + to_float32(lane_numbers<Ints>()) + offsets(ray, k, 0);
                    Floats depth = load<Floats>(ray_depths, starts[n]);
                    Mask is_met = mask_of((0.5f <= u) & (u <= end[0]) & (depth <= OPAQUE_DEPTH));
                    is_going |= any_of(is_met);
                    if (!any_of(is_met) || !are_filled[most((int64_t)u[0], (int64_t)0) / CELLS_OF_PART]) continue;
                    Floats deeper = depth + lengths[k] * interpolate_row(depths, u, v, w, is_met);
                    store(ray_depths, starts[n], where(is_met, deeper, depth));
                }
            }
            for (int64_t n = 0; n < num_starts; n++)
                for (int64_t cell = starts[n]; cell < starts[n] + LANES; cell++)  // exp(-200) is 0 in float32
                    totals[cell] += (float)maths::moderate_exp(-(double)least(ray_depths[cell], 200.0f));
        }
        for (int64_t cell = 0; cell < num; cell++)
            out(row, cell) = deepest[cell] > 0 ? totals[cell] / (float)offsets.shape[0] : 1.0f;
    }
    return DONE;
}
