// Look up the mean radiance at samples, in matter that scatters light. Each lane has a sample of its own.
#pragma once
#include "draw/sample.h"

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

// Multiply the colours of samples by the mean radiance at their places. texel: the positions of samples in the brick, in
// texels.
INLINE void scatter(const BrickRadiance& radiance, const Three& texel, Sample& sample) {
    const auto& cells = radiance.grid->cells;
    const Array<const float, 1> numbers = {cells.data, {cells.size()}};
    Ints at = in_all<Ints>(0);
    Floats shares[3];
    for (int axis = 0; axis < 3; axis++) {
        const float* row = radiance.cells_from_texels + 3 * axis;
        int32_t num = (int32_t)cells.shape[2 - axis];
        Floats place = fma(texel.x, row[0], fma(texel.y, row[1], fma(texel.z, row[2], radiance.origin[axis])));
        place = min_of(max_of(in_all<Floats>(0.0f), place), in_all<Floats>((float)(num - 1)));
        Ints cell = min_of(to_int32(place), in_all<Ints>(num - 2));
        shares[axis] = place - to_float32(cell);
        at += cell * (int32_t)(axis == 0 ? 1 : axis == 1 ? cells.shape[2] : cells.shape[1] * cells.shape[2]);
    }
    int64_t row = 4 * cells.shape[2], plane = row * cells.shape[1];
    auto along_x = [&](int64_t first) {
        return mix(shares[0], load_four(rest_of(numbers, first), at * 4), load_four(rest_of(numbers, first + 4), at * 4));
    };
    auto face = [&](int64_t first) { return mix(shares[1], along_x(first), along_x(first + row)); };
    auto [red, green, blue, unused] = mix(shares[2], face(0), face(plane));
    sample.r *= red, sample.g *= green, sample.b *= blue;
}

// Return whether a grid of mean radiance has two cells or more along each axis, and few enough to be numbered.
inline bool is_complete(const RadianceCells& radiance) {
    const auto& shape = radiance.cells.shape;
    for (int axis = 0; axis < 3; axis++)
        if (shape[axis] < 2 || shape[axis] > 512) return false;
    return true;
}
