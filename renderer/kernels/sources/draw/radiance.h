// Look up the mean radiance at samples, in matter that scatters light. Each lane has a sample of its own.
#pragma once
#include "draw/sample.h"

// The number of numbers of a cell with flux.
constexpr int NUMBERS_WITH_FLUX = 16;

// The grid of mean radiance, as it lies in a brick.
struct BrickRadiance {
    // The grid; null if matter does not scatter light.
    const RadianceCells* grid;
    // [3, 3]: the matrix from positions in the brick, in texels, to cells of the grid.
    float cells_from_texels[9];
    // The position of texel 0 in the grid, in cells along x, y, z.
    float origin[3];
};

// Return how the grid of mean radiance lies in a brick.
INLINE BrickRadiance radiance_in(const LayerBricks& bricks, const Box& box) {
    BrickRadiance found = {};
    if (!bricks.radiance.exists) return found;
    found.grid = &bricks.radiance.value;
    for (int axis = 0; axis < 3; axis++) {
        const double* row = found.grid->cells_from_index + 4 * axis;
        double origin = row[3];
        for (int along = 0; along < 3; along++) {
            found.cells_from_texels[3 * axis + along] = (float)(row[along] / box.scale);
            origin += row[along] * (box.corner[along] - TEXEL_OFFSET / box.scale);
        }
        found.origin[axis] = (float)origin;
    }
    return found;
}

// The places of samples in the grid.
struct RadiancePlace {
    // The number of the lowest of the eight cells between whose middles each sample is.
    Ints at;
    // The distance from the middle of this cell along x, y, z, from 0 to 1.
    Floats shares[3];
};

// Return the places of samples in the grid. texel: the positions of samples in the brick, in texels.
INLINE RadiancePlace place_in(const BrickRadiance& radiance, const Three& texel) {
    const auto& shape = radiance.grid->cells.shape;
    RadiancePlace found = {in_all<Ints>(0), {}};
    for (int axis = 0; axis < 3; axis++) {
        const float* row = radiance.cells_from_texels + 3 * axis;
        int32_t num = (int32_t)shape[2 - axis];
        Floats place = fma(texel.x, row[0], fma(texel.y, row[1], fma(texel.z, row[2], radiance.origin[axis])));
        place = min_of(max_of(in_all<Floats>(0.0f), place), in_all<Floats>((float)(num - 1)));
        Ints cell = min_of(to_int32(place), in_all<Ints>(num - 2));
        found.shares[axis] = place - to_float32(cell);
        found.at += cell * (int32_t)(axis == 0 ? 1 : axis == 1 ? shape[2] : shape[1] * shape[2]);
    }
    return found;
}

// Interpolate the first four numbers of cells.
INLINE Four<Floats> look_up(const Array<const float, 4>& cells, const RadiancePlace& place) {
    const Array<const float, 1> numbers = {cells.data, {cells.size()}};
    const int64_t num = cells.shape[3], row = num * cells.shape[2], plane = row * cells.shape[1];
    const Ints at = place.at * (int32_t)num;
    auto along_x = [&](int64_t from) {
        return mix(place.shares[0], load_four(rest_of(numbers, from), at), load_four(rest_of(numbers, from + num), at));
    };
    auto face = [&](int64_t from) { return mix(place.shares[1], along_x(from), along_x(from + row)); };
    return mix(place.shares[2], face(0), face(plane));
}

// The numbers of cells at samples, four after four.
struct ManyNumbers {
    Four<Floats> fours[NUMBERS_WITH_FLUX / 4];
};

// Interpolate all numbers of cells that have NUMBERS_WITH_FLUX of them. Each sample is a sum of eight rows, and the sums are
// transposed. With `look_up` for each four numbers, which transposes eight times as much, a frame takes 1.9 times as long.
// needed: the samples that count; all others have numbers of 0, which takes less time.
INLINE ManyNumbers look_up_all(const Array<const float, 4>& cells, const RadiancePlace& place, Mask needed) {
    using Row = Vector<float, NUMBERS_WITH_FLUX>;
    const Array<const float, 1> numbers = {cells.data, {cells.size()}};
    const int64_t row = NUMBERS_WITH_FLUX * cells.shape[2], plane = row * cells.shape[1];
    const Ints at = place.at * NUMBERS_WITH_FLUX;
    const auto& [x, y, z] = place.shares;
    const Floats both = y * z, of_edges[] = {1.0f - y - (z - both), y - both, z - both, both};
    float weights[8][LANES], sums[LANES][NUMBERS_WITH_FLUX];
#pragma clang loop unroll(full)
    for (int edge = 0; edge < 4; edge++) {
        const Floats of_next = x * of_edges[edge];
        store(&weights[2 * edge][0], 0, of_edges[edge] - of_next);
        store(&weights[2 * edge + 1][0], 0, of_next);
    }
#pragma clang loop unroll(full)
    for (int lane = 0; lane < LANES; lane++) {
        Row sum = {};
        if (needed[lane]) {
            const int64_t first = address(at, lane);
#pragma clang loop unroll(full)
            for (int corner = 0; corner < 8; corner++) {
                const int64_t of_corner = (corner & 1) * NUMBERS_WITH_FLUX + (corner >> 1 & 1) * row + (corner >> 2) * plane;
                sum = fused((Row)weights[corner][lane], load<Row>(numbers, first + of_corner), sum);
            }
        }
        store(&sums[lane][0], 0, sum);
    }
    ManyNumbers found;
#pragma clang loop unroll(full)
    for (int four = 0; four < NUMBERS_WITH_FLUX / 4; four++)
        found.fours[four] = columns_of([&](int lane) { return load<Vector<float, 4>>(&sums[lane][0], 4 * four); });
    return found;
}

// Multiply the colours of samples by the mean radiance at places in the brick. texel: the places, in texels.
INLINE void scatter(const BrickRadiance& radiance, const Three& texel, Sample& sample) {
    auto [red, green, blue, unused] = look_up(radiance.grid->cells, place_in(radiance, texel));
    sample.r *= red, sample.g *= green, sample.b *= blue;
}

// Return whether a grid of mean radiance has two cells or more along each axis, and few enough to be numbered.
inline bool is_complete(const RadianceCells& radiance) {
    const auto& shape = radiance.cells.shape;
    for (int axis = 0; axis < 3; axis++)
        if (shape[axis] < 2 || shape[axis] > 512) return false;
    return shape[3] == (radiance.surface.exists ? NUMBERS_WITH_FLUX : 4);
}
