// Carry light through a grid of cells by short characteristics: from plane to plane, between whose cells it is linear.
//
// A cell has an even extinction and scatters an even light S. Light of radiance I that enters a cell has the radiance
// S + (I - S) exp(-t) behind an optical depth t. So no radiance is above the largest of S and of the light that enters
// the grid: energy is never gained, and even light stays even (the white furnace).
#include "lighting/kernels.h"
#include "base/lanes.h"
#include "base/stopping.h"
#include "lighting/layouts.h"

namespace {

// The number of directions that are swept together: they share the optical depths and the scattered light of a cell.
constexpr int NUM_WAYS = 4;
static_assert(ROW_CELLS % LANES == 0);

// The cells of a sweep: planes of rows.
struct Planes {
    int64_t num_planes;
    int64_t num_rows;
    int64_t row_cells;
    // The distances of neighbouring planes and rows in an array of one channel.
    int64_t plane_step;
    int64_t row_step;
    bool is_upwards;

    INLINE int64_t size() const { return num_planes * num_rows * row_cells; }

    // Return the position of a row in an array of one channel. step: the number of planes that light has passed.
    INLINE int64_t row_at(int64_t step, int64_t row) const {
        return (is_upwards ? step : num_planes - 1 - step) * plane_step + row * row_step;
    }
};

INLINE Planes planes_of(const int64_t* shape, bool are_planes_first, bool is_upwards) {
    int64_t slab = shape[1] * shape[2];
    if (are_planes_first) return {shape[0], shape[1], shape[2], slab, shape[2], is_upwards};
    return {shape[1], shape[0], shape[2], shape[2], slab, is_upwards};
}

// The four neighbours in a plane between which a place lies, and their weights.
struct Between {
    // The lower neighbour: 0 or -1 rows, and 0 or -1 cells.
    int64_t row;
    int64_t cell;
    // The share of the upper neighbour.
    float of_row;
    float of_cell;
};

INLINE Between between(float row, float cell) {
    int64_t lower_row = row < 0 ? -1 : 0, lower_cell = cell < 0 ? -1 : 0;
    return {lower_row, lower_cell, row - (float)lower_row, cell - (float)lower_cell};
}

INLINE Floats mix(const float* low, int64_t next, const Between& at) {
    Floats near = load<Floats>(low, 0), far = load<Floats>(low, next);
    near += at.of_cell * (load<Floats>(low, 1) - near);
    far += at.of_cell * (load<Floats>(low, next + 1) - far);
    return near + at.of_row * (far - near);
}

// Return exp(-x) for x from 0 on; the relative error is below 1e-6.
INLINE Floats decay(Floats x) {
    constexpr float to_integer = 0x1.8p23f;  // adding this number rounds to an integer
    constexpr float per_unit = 1.44269504f, step = 0.693145752f, step_lacks = 1.42860677e-6f;
    Floats far = min_of(x, in_all<Floats>(80.0f));
    Floats shifted = to_integer - far * per_unit, k = shifted - to_integer;
    Floats r = -far - k * step - k * step_lacks;
    Floats series = 1.0f + r * (1.0f + r * (0.5f + r * (1 / 6.0f + r * (1 / 24.0f + r * (1 / 120.0f + r * (1 / 720.0f))))));
    return series * bits_to_float32((to_int32(k) + 127) << 23);
}

// Return the share of light that reaches the visible matter of a cell of some optical depth, along a path so many widths
// long: exp(-path x) at the depth x, weighted by exp(-x), by which matter at x is seen.
INLINE Floats share_of_seen(Floats depth, float path, Floats through) {
    Floats dimmed = decay(depth);
    Floats deep = (1.0f - dimmed * through) / ((1 + path) * (1.0f - min_of(dimmed, in_all<Floats>(1 - LEAST_DEPTH / 2))));
    return where(mask_of(depth > LEAST_DEPTH), deep, decay(0.5f * path * depth));
}

}  // namespace

// Write the weighted sum of the radiances of four directions.
Status sweep_light(const SweepLight* arguments) {
    const auto& [shares, scattered, are_planes_first, is_upwards, offsets, entering, weights, out] = *arguments;
    const int64_t* s = shares.shape;
    if (s[0] != 3 || s[3] % ROW_CELLS || !has_shape(scattered, 3, s[1], s[2], s[3]) || !has_shape(out, 3, s[1], s[2], s[3]))
        return OUT_OF_BOUNDS;
    const Planes planes = planes_of(s + 1, are_planes_first, is_upwards);
    // A plane of radiances of each direction and colour, with a border of one row and of one vector.
    int64_t pitch = planes.row_cells + 2 * ROW_CELLS, plane = (planes.num_rows + 2) * pitch;
    Buffer<float> first(plane * 3 * NUM_WAYS), second(plane * 3 * NUM_WAYS);
    if (!first || !second) return NO_MEMORY;
    Between at[NUM_WAYS];
    for (int way = 0; way < NUM_WAYS; way++) {
        for (int k = 0; k < 2; k++)
            if (!(offsets(way, k) >= -1 && offsets(way, k) <= 1)) return OUT_OF_BOUNDS;
        at[way] = between(offsets(way, 0), offsets(way, 1));
        for (int c = 0; c < 3; c++)
            for (int64_t i = 0; i < plane; i++)
                first[(way * 3 + c) * plane + i] = second[(way * 3 + c) * plane + i] = entering(way, c);
    }
    float *before = first.data, *now = second.data;
    for (int64_t step = 0; step < planes.num_planes; step++) {
        if (is_stopped()) return STOPPED;
        for (int64_t row = 0; row < planes.num_rows; row++) {
            int64_t place = planes.row_at(step, row), in_plane = (row + 1) * pitch + ROW_CELLS;
            for (int64_t cell = 0; cell < planes.row_cells; cell += LANES) {
                Floats to_seen = load<Floats>(shares.data, place + cell);
                Floats through = load<Floats>(shares.data, planes.size() + place + cell);
                for (int c = 0; c < 3; c++) {
                    Floats source = load<Floats>(scattered.data, c * planes.size() + place + cell), sum = in_all<Floats>(0.0f);
                    for (int way = 0; way < NUM_WAYS; way++) {
                        int64_t own = (way * 3 + c) * plane + in_plane + cell;
                        Floats gain = mix(before + own + at[way].row * pitch + at[way].cell, pitch, at[way]) - source;
                        sum += weights[way] * (source + gain * to_seen);
                        store(now, own, source + gain * through);
                    }
                    store(out.data, c * planes.size() + place + cell, sum);
                }
            }
        }
        float* swapped = before;
        before = now, now = swapped;
    }
    return DONE;
}

// Add the share of light that reaches the visible matter of cells. A ray has a place in the first plane, and moves from plane
// to plane by whole numbers of cells and one share for all rays, so that only the shares that pass cells are interpolated
// on its way. Interpolated optical depths would make surfaces dark that light grazes: it passes beside their cells.
Status shine_key(const ShineKey* arguments) {
    const auto& [shares, are_planes_first, is_upwards, offset, path, weight, out] = *arguments;
    const int64_t* s = shares.shape;
    if (s[0] != 3 || s[3] % ROW_CELLS || !has_shape(out, 1, s[1], s[2], s[3])) return OUT_OF_BOUNDS;
    for (int k = 0; k < 2; k++)
        if (!(offset[k] >= -1 && offset[k] <= 1)) return OUT_OF_BOUNDS;
    const Planes planes = planes_of(s + 1, are_planes_first, is_upwards);
    const float* depths = shares.data + 2 * planes.size();
    // Rays have numbers from -margin on, in rows and in cells. Ray k is at k - offset * step.
    int64_t margin = planes.num_planes + 2, margin_cells = margin + 2 * ROW_CELLS;
    int64_t num_rows = planes.num_rows + 2 * margin, pitch = planes.row_cells + 2 * margin_cells + ROW_CELLS;
    Buffer<float> rays(num_rows * pitch);
    // The shares that pass the cells of one plane, with a border of empty cells.
    int64_t plane_pitch = planes.row_cells + 3 * ROW_CELLS;
    Buffer<float> plane((planes.num_rows + 4) * plane_pitch);
    if (!rays || !plane) return NO_MEMORY;
    for (int64_t i = 0; i < rays.shape[0]; i++) rays[i] = 1.0f;
    for (int64_t i = 0; i < plane.shape[0]; i++) plane[i] = 1.0f;
    auto floor_of = [](float x) { return (int64_t)x - (x < (float)(int64_t)x); };
    for (int64_t step = 0; step < planes.num_planes; step++) {
        if (is_stopped()) return STOPPED;
        // Light comes from `offset`: cell i of this plane is on ray i + step * offset.
        float row_shift = (float)step * offset[0], cell_shift = (float)step * offset[1];
        int64_t rows = floor_of(row_shift), cells = floor_of(cell_shift);
        Between at = {0, 0, row_shift - (float)rows, cell_shift - (float)cells};
        for (int64_t row = 0; row < planes.num_rows; row++) {
            int64_t place = planes.row_at(step, row);
            for (int64_t cell = 0; cell < planes.row_cells; cell += LANES) {
                const float* low = rays.data + (row + rows + margin) * pitch + cell + cells + margin_cells;
                Floats depth = load<Floats>(depths, place + cell), through = decay(path * depth);
                Floats seen = mix(low, pitch, at) * share_of_seen(depth, path, through);
                store(out.data, place + cell, load<Floats>(out.data, place + cell) + weight * seen);
                store(plane.data, (row + 2) * plane_pitch + ROW_CELLS + cell, through);
            }
        }
        // Ray k is at k - shift, between the cells k - shift rounded down and the next ones.
        Between back = {0, 0, at.of_row > 0 ? 1 - at.of_row : 0.0f, at.of_cell > 0 ? 1 - at.of_cell : 0.0f};
        int64_t row_back = at.of_row > 0, cell_back = at.of_cell > 0;
        for (int64_t row = -1; row <= planes.num_rows; row++)
            for (int64_t cell = -LANES; cell < planes.row_cells + LANES; cell += LANES) {
                // The ray whose place is just above (row, cell), or at it.
                int64_t ray = (row + row_back + rows + margin) * pitch + cell + cell_back + cells + margin_cells;
                const float* low = plane.data + (row + 2) * plane_pitch + ROW_CELLS + cell;
                store(rays.data, ray, load<Floats>(rays.data, ray) * mix(low, plane_pitch, back));
            }
    }
    return DONE;
}

// Write the light that the cells of a block scatter.
Status scatter_light(const ScatterLight* arguments) {
    const auto& [albedos, radiance, key, key_radiance, block, along_x, along_z] = *arguments;
    Shape shape = shape_of(along_x, along_z);
    bool fits = shape.has(block) && shape.fits(albedos, 3) && shape.fits(radiance, 3) &&
        shape.fits(along_x, 3) && shape.fits_turned(along_z, 3) &&
        has_shape(key, shape.num_z, shape.num_y, shape.row_x);
    if (!fits) return OUT_OF_BOUNDS;
    for_tiles(shape, block, [&](int64_t y, const Tile& tile) {
        float kept[ROW_CELLS][ROW_CELLS];
        for (int c = 0; c < 3; c++) {
            for (int64_t i = 0; i < tile.num_z; i++)
                for (int64_t j = 0; j < tile.num_x; j++) {
                    int64_t z = tile.z + i, x = tile.x + j;
                    float light = radiance(c, z, y, x) + key_radiance[c] * key(z, y, x);
                    along_x(c, z, y, x) = kept[i][j] = albedos(c, z, y, x) * light;
                }
            for (int64_t j = 0; j < tile.num_x; j++)
                for (int64_t i = 0; i < tile.num_z; i++) along_z(c, tile.x + j, y, tile.z + i) = kept[i][j];
        }
    });
    return DONE;
}

// Write the sums over all sweeps, in a fixed order.
Status gather_light(const GatherLight* arguments) {
    const auto& [along_x, along_z, block, out] = *arguments;
    const auto& a = along_x.shape;
    const auto& b = along_z.shape;
    Shape shape = {a[4], a[3], a[2], b[2], b[4]};
    if (!shape.has(block) || !shape.fits(out, a[1]) || a[1] != b[1] || b[3] != a[3]) return OUT_OF_BOUNDS;
    for_tiles(shape, block, [&](int64_t y, const Tile& tile) {
        for (int64_t c = 0; c < a[1]; c++) {
            float sums[ROW_CELLS][ROW_CELLS] = {};
            for (int64_t k = 0; k < b[0]; k++)
                for (int64_t j = 0; j < tile.num_x; j++)
                    for (int64_t i = 0; i < tile.num_z; i++) sums[i][j] += along_z(k, c, tile.x + j, y, tile.z + i);
            for (int64_t k = 0; k < a[0]; k++)
                for (int64_t i = 0; i < tile.num_z; i++)
                    for (int64_t j = 0; j < tile.num_x; j++) sums[i][j] += along_x(k, c, tile.z + i, y, tile.x + j);
            for (int64_t i = 0; i < tile.num_z; i++)
                for (int64_t j = 0; j < tile.num_x; j++) out(c, tile.z + i, y, tile.x + j) = sums[i][j];
        }
    });
    return DONE;
}

// Write the inner products of the change of a round with all changes, and its largest change, over a slab.
Status measure_round(const MeasureRound* arguments) {
    const auto& [begun, ended, number, slab, products, largest] = *arguments;
    const auto& s = ended.shape;
    int64_t num = s[0], slab_size = s[3] * s[4];
    bool fits = s[1] == 3 && s[4] % ROW_CELLS == 0 && number >= 0 && number < num && slab >= 0 && slab < s[2] &&
        has_shape(begun, num, 3, s[2], s[3], s[4]) && has_shape(products, s[2], 3, num) && has_shape(largest, s[2]);
    if (!fits) return OUT_OF_BOUNDS;
    float most_here = 0.0f;
    for (int64_t c = 0; c < 3; c++) {
        const float *first = &begun(number, c, slab, 0, 0), *last = &ended(number, c, slab, 0, 0);
        for (int64_t i = 0; i < slab_size; i++) most_here = most(most_here, __builtin_fabsf(last[i] - first[i]));
        for (int64_t k = 0; k < num; k++) {
            const float *other_first = &begun(k, c, slab, 0, 0), *other_last = &ended(k, c, slab, 0, 0);
            double sums[ROW_CELLS] = {};  // side by side, so that the loop becomes vector code
            for (int64_t i = 0; i < slab_size; i += ROW_CELLS)
                for (int64_t lane = i; lane < i + ROW_CELLS; lane++)
                    sums[lane - i] += (double)(last[lane] - first[lane]) * (double)(other_last[lane] - other_first[lane]);
            double sum = 0.0;
            for (double one : sums) sum += one;
            products(slab, c, k) = sum;
        }
    }
    largest[slab] = most_here;
    return DONE;
}

// Write the weighted sum of the results of rounds over a slab.
Status mix_rounds(const MixRounds* arguments) {
    const auto& [ended, weights, slab, out] = *arguments;
    const auto& s = ended.shape;
    if (s[1] != 3 || slab < 0 || slab >= s[2] || !has_shape(out, 3, s[2], s[3], s[4]) || weights.shape[0] != s[0])
        return OUT_OF_BOUNDS;
    for (int64_t c = 0; c < 3; c++)
        for (int64_t i = 0; i < s[3] * s[4]; i++) {
            float sum = 0.0f;
            for (int64_t k = 0; k < s[0]; k++) sum += weights(k, c) * (&ended(k, c, slab, 0, 0))[i];
            (&out(c, slab, 0, 0))[i] = most(sum, 0.0f);
        }
    return DONE;
}
