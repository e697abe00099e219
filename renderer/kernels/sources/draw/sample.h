// Sample the field of a brick and classify the samples. Each lane has a sample of its own.
#pragma once
#include "base/lanes.h"
#include "transfer/transfer.h"
#include "draw/spans.h"

// The distance in memory, in texels, from one texel of a brick to the next along y.
constexpr int ROW_STRIDE = PADDED_BRICK_SIZE;
// The distance in memory, in texels, from one texel of a brick to the next along z.
constexpr int PLANE_STRIDE = PADDED_BRICK_SIZE * PADDED_BRICK_SIZE;
// The number of texels of a brick with its halo.
constexpr int TEXELS_PER_BRICK = PADDED_BRICK_SIZE * PLANE_STRIDE;
// The last texel that is the lowest corner of a cell of eight texels.
constexpr int32_t LAST_CELL = TEXELS_PER_BRICK - 1 - PLANE_STRIDE - ROW_STRIDE - 1;
// The number of parts into which a segment is divided if some voxels around it have no data. With one part, the mean colour
// of rays that graze such voxels has an error of 40 dB at tolerance 0.
constexpr int NUM_PARTS = 4;
// The number of floats of a piece of a transfer function, as in renderer/transfer/piecewise.py.
constexpr int PIECE_FLOATS = 12;
// The logarithm of e to base 2.
constexpr float LOG2_E = 1.4426950408889634;
// The natural logarithm of 2.
constexpr float LN_2 = 0.6931471805599453;
// From this optical depth on, an opacity is 1: exp(-40) is far below the precision of float32.
constexpr float MAX_DEPTH = 40.0;
// The coefficients of the series for 1 - exp(-x): OPACITY_SERIES of renderer/draw/splats/programs.py, which explains them.
constexpr float SERIES[4] = {(float)0.49999463, (float)0.16656359, (float)0.04104245, (float)0.00680757};

using Texels = Array<const float, 1>;

// A vector or point along x, y, z in each lane.
struct Three {
    Floats x, y, z;
};

// A classified sample in each lane.
struct Sample {
    // The extinction.
    Floats tau;
    // The colour; times the extinction if texels are (tau c, tau).
    Floats r, g, b;
};

// The values of the eight texels at the corners of a cell, in each lane; x varies fastest, then y, then z.
struct Corners {
    Floats a, b, c, d, e, f, g, h;
};

// A transfer function (PiecewiseTransfer) in the form in which lanes read it.
struct LaneTable {
    // [pieces, PIECE_FLOATS]: the pieces.
    Array<const float, 2> rows;
    // The piece in which the search for a scalar begins, by equal parts of the range of scalars.
    Array<const int32_t, 1> guide;
    // Whether a vector can hold a whole column of the pieces.
    bool fits;
    // The columns of the pieces, if they fit.
    float columns[PIECE_FLOATS][LANES];

    explicit LaneTable(const PiecewiseTransfer& pieces)
        : rows(pieces.rows), guide(pieces.guide), fits(rows.shape[0] <= LANES), columns() {
        for (int64_t piece = 0; fits && piece < rows.shape[0]; piece++)
            for (int k = 0; k < PIECE_FLOATS; k++) columns[k][piece] = rows(piece, k);
    }
};

// Classify samples by pieces in registers: with it, a frame takes 0.8 of the time that it takes with `classify_by_rows`.
INLINE Sample classify_by_columns(const LaneTable& table, Floats scalar) {
    Ints piece = in_all<Ints>(table.guide[0]);
    for (int64_t k = table.guide[0]; k < table.rows.shape[0] - 1; k++)
        piece = where(mask_of(scalar >= table.columns[0][k]), piece + 1, piece);
    auto column = [&](int number) { return permute(load<Floats>(table.columns[number], 0), piece); };
    Floats offset = scalar - column(1);
    return {
        fma(offset, column(3), column(2)),
        fma(offset, column(8), column(4)),
        fma(offset, column(9), column(5)),
        fma(offset, column(10), column(6)),
    };
}

// Classify samples by pieces in memory.
INLINE Sample classify_by_rows(const LaneTable& table, Floats scalar) {
    Texels rows = {table.rows.data, {table.rows.size()}};
    Floats place = min_of(max_of(in_all<Floats>(0.0f), scalar * (float)GUIDE_SIZE), in_all<Floats>(GUIDE_SIZE - 1.0f));
    Ints row = gather(table.guide, to_int32(place)) * PIECE_FLOATS;
    auto [end, origin, tau, tau_slope] = load_four(rows, row);
    Mask is_further = mask_of(scalar >= end);
    while (any_of(is_further)) {
        row = where(is_further, row + PIECE_FLOATS, row);
        auto next = load_four(rows, row);
        end = next.a, origin = next.b, tau = next.c, tau_slope = next.d;
        is_further = mask_of(scalar >= end);
    }
    auto color = load_four(rest_of(rows, 4), row), slope = load_four(rest_of(rows, 8), row);
    Floats offset = scalar - origin;
    return {
        fma(offset, tau_slope, tau),
        fma(offset, slope.a, color.a),
        fma(offset, slope.b, color.b),
        fma(offset, slope.c, color.c),
    };
}

// Classify samples; NaN falls into the first piece.
INLINE Sample classify(const LaneTable& table, Floats scalar) {
    return table.fits ? classify_by_columns(table, scalar) : classify_by_rows(table, scalar);
}

INLINE Floats lerp(Floats share, Floats one, Floats other) { return fma(share, other - one, one); }

// The cell between eight texels in which each sample is: the number of its lowest texel along each axis.
struct Cell {
    Ints x, y, z;

    // Return the position in memory of the lowest texel, in a brick with `side` texels along each axis.
    INLINE Ints at(int32_t side) const { return (z * side + y) * side + x; }
};

// Return the cell of each sample. number, first, step: the number of the sample on its ray, the position of sample 0 and
// the way to the next sample, in texels. shares: set to the distance from the lowest texel, from 0 to 1.
INLINE Cell cell_at(Floats number, const Three& first, const Three& step, Three& shares) {
    Floats x = fma(number, step.x, first.x), y = fma(number, step.y, first.y), z = fma(number, step.z, first.z);
    Ints i = to_int32(x), j = to_int32(y), k = to_int32(z);
    shares = {x - to_float32(i), y - to_float32(j), z - to_float32(k)};
    return {i, j, k};
}

// Return the eight texels whose lowest corner is at `at`.
INLINE Corners load_corners(const Texels& texels, Ints at) {
    Corners corners;
    load_pairs(texels, at, corners.a, corners.b);
    load_pairs(rest_of(texels, ROW_STRIDE), at, corners.c, corners.d);
    load_pairs(rest_of(texels, PLANE_STRIDE), at, corners.e, corners.f);
    load_pairs(rest_of(texels, PLANE_STRIDE + ROW_STRIDE), at, corners.g, corners.h);
    return corners;
}

// Interpolate trilinearly between eight texels. shares: the distance from the lowest texel along each axis, from 0 to 1.
INLINE Floats interpolate(const Corners& corners, const Three& shares) {
    const auto& [a, b, c, d, e, f, g, h] = corners;
    Floats below = lerp(shares.y, lerp(shares.x, a, b), lerp(shares.x, c, d));
    Floats above = lerp(shares.y, lerp(shares.x, e, f), lerp(shares.x, g, h));
    return lerp(shares.z, below, above);
}

// Return whether texels have data: the lowest bit of a texel without data is 1.
INLINE Mask has_data(Floats texel) { return mask_of((float32_to_bits(texel) & 1) == 0); }

// Return whether the texel nearest to each sample has data; `at` is the lowest of the eight texels around the sample.
INLINE Mask are_present(const Texels& texels, Ints at, const Three& shares) {
    // Products are avoided here, because the compiler would compute them lane by lane.
    auto beyond = [](Floats share, int32_t stride) {
        return where(mask_of(share + 0.5f >= 1.0f), in_all<Ints>(stride), in_all<Ints>(0));
    };
    at += beyond(shares.x, 1) + beyond(shares.y, ROW_STRIDE) + beyond(shares.z, PLANE_STRIDE);
    return has_data(gather(texels, at));
}

// Return whether all eight texels around samples have data.
INLINE Mask are_all_present(const Corners& corners) {
    auto [a, b, c, d, e, f, g, h] = corners;
    auto any = [](auto... texel) { return (float32_to_bits(texel) | ...); };
    return mask_of((any(a, b, c, d, e, f, g, h) & 1) == 0);
}

// Return the share of each sample's segment that has data, from NUM_PARTS points of it; 1 if the segment is not divided.
// numbers, first, step: as in `cell_at`. width: the length of the segments, in steps.
INLINE Floats share_of_data(const Texels& texels, Mask are_divided, Floats numbers, const Three& first,
                            const Three& step, Floats width) {
    Floats zero = in_all<Floats>(0.0f), share = where(are_divided, zero, in_all<Floats>(1.0f));
#pragma clang loop unroll(full)
    for (int k = 0; k < NUM_PARTS; k++) {
        Three shares;
        Cell cell = cell_at(numbers + (float)((k + 0.5) / NUM_PARTS - 0.5) * width, first, step, shares);
        Ints at = cell.at(PADDED_BRICK_SIZE);
        at = min_of(max_of(at, in_all<Ints>(0)), in_all<Ints>(LAST_CELL));  // lanes without a ray may be anywhere
        share += where(are_divided & are_present(texels, at, shares), in_all<Floats>(1.0f / NUM_PARTS), zero);
    }
    return share;
}

INLINE Four<Floats> mix(Floats share, const Four<Floats>& one, const Four<Floats>& other) {
    return {lerp(share, one.a, other.a), lerp(share, one.b, other.b), lerp(share, one.c, other.c),
            lerp(share, one.d, other.d)};
}

// Interpolate between a texel of 3 or 4 channels and the next texel. With three channels, the last number is arbitrary.
template <int NUM>
INLINE Four<Floats> mix_pair(Floats share, const Texels& texels, Ints place) {
    auto one = load_four(texels, place), other = load_four(rest_of(texels, 4), place);
    if constexpr (NUM == 3) return mix(share, one, {one.d, other.a, other.b, other.c});
    return mix(share, one, other);
}

// Interpolate NUM channels between eight texels, the lowest of which begins at `place`. Up to two floats behind the last
// texel are read.
template <int NUM>
INLINE Four<Floats> mix_corners(const Texels& texels, Ints place, const Three& shares) {
    auto face = [&](const Texels& rows) {
        return mix(shares.y, mix_pair<NUM>(shares.x, rows, place),
                   mix_pair<NUM>(shares.x, rest_of(rows, NUM * ROW_STRIDE), place));
    };
    return mix(shares.z, face(texels), face(rest_of(texels, NUM * PLANE_STRIDE)));
}

// Interpolate the gradient at samples. The gradients of a brick follow all of its scalars, three numbers for each texel.
INLINE Three sample_gradient(const Texels& texels, Ints at, const Three& shares) {
    auto gradient = mix_corners<3>(rest_of(texels, TEXELS_PER_BRICK), at * 3, shares);
    return {gradient.a, gradient.b, gradient.c};
}

// Interpolate (tau c, tau) at samples. texels: the texels of a brick of means or of colours.
INLINE Sample sample_rgba(const Texels& texels, Ints at, const Three& shares) {
    auto rgba = mix_corners<4>(texels, at * 4, shares);
    return {rgba.d, rgba.a, rgba.b, rgba.c};
}

// Return the factor on the colour for gradients of any length, by Lambert's law: ambient + diffuse max(0, n . l). The
// normal n points against the gradient, whose largest component is first made 1, so that squares neither overflow nor
// vanish. light: as `lambert` in Field.
INLINE Floats light_factor(const Three& gradient, const float (&light)[5]) {
    Floats largest = max_of(magnitude(gradient.x), magnitude(gradient.y));
    largest = max_of(largest, magnitude(gradient.z));
    Floats x = gradient.x / largest, y = gradient.y / largest, z = gradient.z / largest;
    Floats across = fma(x, light[0], fma(y, light[1], z * light[2]));
    Floats length = root(fma(x, x, fma(y, y, z * z)));
    Floats lit = fma(light[4], max_of(in_all<Floats>(0.0f), -across / length), light[3]);
    return where(mask_of(largest > 0.0f), lit, in_all<Floats>(light[3]));
}

// Return two factors of exp(-x) for x >= 0, of which the second is a power of two; x counts as at most 40.
INLINE void exp_factors(Floats x, Floats& power, Floats& power_of_two) {
    Floats held = min_of(x, in_all<Floats>(MAX_DEPTH));
    Ints n = to_int32(fma(held, LOG2_E, 0.5f));
    Floats r = fma(to_float32(n), LN_2, -held);
    power = fma(r, (float)(1.0 / 720), (float)(1.0 / 120));
    power = fma(r, power, (float)(1.0 / 24));
    power = fma(r, power, (float)(1.0 / 6));
    power = fma(r, power, 0.5f);
    power = fma(r, fma(r, power, 1.0f), 1.0f);
    power_of_two = bits_to_float32((127 - n) << 23);
}

// Return 1 - exp(-x) for x >= 0, with a relative error below 3e-7.
INLINE Floats opacity_of_depth(Floats x) {
    Mask is_small = mask_of(x < 0.5f);
    Floats opacity = x * fma(-x, fma(-x, fma(-x, fma(x, -SERIES[3], SERIES[2]), SERIES[1]), SERIES[0]), 1.0f);
    if (any_of(~is_small)) {
        Floats power, power_of_two;
        exp_factors(x, power, power_of_two);
        Floats large = where(mask_of(x < MAX_DEPTH), fma(-power, power_of_two, 1.0f), in_all<Floats>(1.0f));
        opacity = where(is_small, opacity, large);
    }
    return opacity;
}
