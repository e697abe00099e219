// Sample bricks whose texels are voxels as the file has them, of 8 or 16 bits. Each lane has a sample of its own.
//
// Scalars and gradients have the same bytes as those of texels that are float32 numbers (bricks/brick_texels.cpp). A brick
// of voxels of 8 bits takes a quarter of their memory without light, and a twelfth with light.
#pragma once
#include "draw/sample.h"

// The texels of a brick, as samples read them.
struct BrickTexels {
    // The texels, and those after them: float32 numbers, or words of four bytes that hold voxels.
    Texels words;
    // The rules by which texels were made that are voxels; null if texels are float32 numbers.
    const TexelRules* rules = nullptr;
    // The first and the last voxel of the volume along each axis, counted in texels of a brick with a halo of one.
    int32_t low[3] = {}, high[3] = {};
    // Whether a sample in the brick may need a gradient at the border of the volume.
    bool is_at_border = false;

    // Return the number of texels along the side of the brick.
    INLINE int32_t side() const { return rules == nullptr ? (int32_t)PADDED_BRICK_SIZE : (int32_t)voxel_side(*rules); }

    // Return the number of texels of the halo beyond one.
    INLINE int32_t margin() const { return (side() - (int32_t)PADDED_BRICK_SIZE) / 2; }
};

// Return the texels of a brick. cell: the brick, [3] (x, y, z). rules: as in BrickTexels.
INLINE BrickTexels voxels_of(const Texels& words, const TexelRules& rules, const Array<const int32_t, 1>& cell) {
    BrickTexels texels = {words, &rules};
    for (int axis = 0; axis < 3; axis++) {
        int64_t low = HALO - BRICK_SIZE * (int64_t)cell[axis];
        int64_t high = low + rules.voxels.raw.shape[2 - axis] - 1;
        texels.low[axis] = (int32_t)low, texels.high[axis] = (int32_t)least(high, BRICK_SIZE * (int64_t)4);
        texels.is_at_border |= low >= 0 || high < PADDED_BRICK_SIZE;
    }
    return texels;
}

// For each lane, load four bytes from the byte at the lane's place on.
INLINE Ints load_words(const Array<const uint8_t, 1>& bytes, Ints places) {
    auto load_word = [&](int lane) { return load<Vector<uint8_t, 4>>(bytes, address(places, lane)); };
    return __builtin_bit_cast(Ints, joined_rows<0, 1, LANES>(load_word));
}

// The voxels around samples in a brick. BYTES: the size of a voxel.
template <int BYTES>
struct VoxelRows {
    // The bytes of the texels, and those after them.
    Array<const uint8_t, 1> bytes;
    // The number of texels along the side of the brick.
    int32_t side;
    // The place of the lowest of the eight voxels around each sample.
    Ints at;

    INLINE VoxelRows(const BrickTexels& texels, const Cell& cell)
        : bytes{(const uint8_t*)texels.words.data, {4 * texels.words.shape[0]}},
          side(texels.side()), at(cell.at(side) + texels.margin() * ((side + 1) * side + 1)) {}

    // Return the first byte of the voxel that is `x`, `y` and `z` texels away.
    INLINE Ints byte_of(int x, int y, int z) const { return (at + (z * side + y) * side + x) * BYTES; }

    // Load the two voxels of a row of the cell.
    INLINE void pair(int y, int z, Ints& first, Ints& second) const {
        Ints word = load_words(bytes, byte_of(0, y, z));
        constexpr int32_t mask = (1 << 8 * BYTES) - 1;
        first = word & mask, second = word >> 8 * BYTES & mask;
    }

    // Load the two voxels of a row of the cell, and the one before and the one after them.
    INLINE Four<Ints> four(int y, int z) const {
        Ints word = load_words(bytes, byte_of(-1, y, z));
        if constexpr (BYTES == 1) return {word & 255, word >> 8 & 255, word >> 16 & 255, word >> 24 & 255};
        Ints next = load_words(bytes, byte_of(1, y, z));
        return {word & 65535, word >> 16 & 65535, next & 65535, next >> 16 & 65535};
    }
};

// Return the scalars of voxels, as texels of float32 have them.
INLINE Floats scalars_of(Ints voxels, const TexelRules& rules) {
    const VoxelTexels& form = rules.voxel_texels.value;
    auto scalars = __builtin_convertvector(voxels + (int32_t)form.lowest, Vector<double, LANES>);
    return __builtin_convertvector((scalars - rules.first) * form.slope, Floats);
}

template <int BYTES>
INLINE Corners corners_of_voxels(const BrickTexels& texels, const Cell& cell) {
    const VoxelRows<BYTES> rows(texels, cell);
    Ints v[8];
    for (int k = 0; k < 4; k++) rows.pair(k & 1, k >> 1, v[2 * k], v[2 * k + 1]);
    auto scalar = [&](int k) { return scalars_of(v[k], *texels.rules); };
    return {scalar(0), scalar(1), scalar(2), scalar(3), scalar(4), scalar(5), scalar(6), scalar(7)};
}

// Return the scalars of the eight texels around samples.
INLINE Corners load_corners(const BrickTexels& texels, const Cell& cell) {
    if (texels.rules == nullptr) return load_corners(texels.words, cell.at(PADDED_BRICK_SIZE));
    if (texels.rules->voxel_texels.value.num_bytes == 1) return corners_of_voxels<1>(texels, cell);
    return corners_of_voxels<2>(texels, cell);
}

// The differences along one axis at the eight corners of a cell, x fastest.
struct Differences {
    Floats at[8];

    // Turn differences of two voxels into differences of one. Differences are one-sided at the border of the volume, and
    // beyond it they are those of the nearest voxel.
    //
    // lower: the number of the lower texel along the axis. bit: the place of the axis in the numbers of corners.
    INLINE void adjust(Ints lower, int32_t low, int32_t high, int bit) {
        Floats half = in_all<Floats>(0.5f), one = in_all<Floats>(1.0f);
        Ints upper = lower + 1;
        Mask is_below = mask_of(lower < low), is_above = mask_of(upper > high);
        auto weight = [&](Ints place) { return where(mask_of(place <= low) | mask_of(place >= high), one, half); };
        Floats of_lower = weight(lower), of_upper = weight(upper);
        for (int k = 0; k < 8; k++) {
            if (k >> bit & 1) continue;
            Floats one_side = at[k] * of_lower, other = at[k + (1 << bit)] * of_upper;
            at[k] = where(is_below, other, one_side), at[k + (1 << bit)] = where(is_above, one_side, other);
        }
    }
};

// Return the gradient along one world axis at eight corners. m: the row of the matrix from index axes to the world axis.
INLINE Corners along_world_axis(const Differences (&along)[3], const double* m, double scale) {
    Floats g[8];
    bool is_along_one = false;
    for (int axis = 0; axis < 3; axis++) {
        bool is_alone = m[(axis + 1) % 3] == 0.0 && m[(axis + 2) % 3] == 0.0;
        if (!is_alone || (double)(float)m[axis] != m[axis]) continue;
        // Products of two float32 numbers are exact in float64: here float32 rounds in the same way.
        for (int k = 0; k < 8; k++) g[k] = along[axis].at[k] * (float)scale * (float)m[axis];
        is_along_one = true;
        break;
    }
    using Wide = Vector<double, LANES>;
    for (int k = 0; k < 8 && !is_along_one; k++) {
        auto wide = [&](int axis) { return __builtin_convertvector(along[axis].at[k], Wide) * scale; };
        g[k] = __builtin_convertvector(m[0] * wide(0) + m[1] * wide(1) + m[2] * wide(2), Floats);
    }
    return {g[0], g[1], g[2], g[3], g[4], g[5], g[6], g[7]};
}

template <int BYTES>
INLINE Three gradient_of_voxels(const BrickTexels& texels, const Cell& cell, const Three& shares) {
    const VoxelRows<BYTES> rows(texels, cell);
    Ints rim[4][4][4];  // the voxels around samples, by z, y and x, from the voxel before the cell on; without corners
    for (int z = 0; z < 4; z++)
        for (int y = 0; y < 4; y++) {
            bool is_inner_y = y == 1 || y == 2, is_inner_z = z == 1 || z == 2;
            if (is_inner_y && is_inner_z) {
                auto [a, b, c, d] = rows.four(y - 1, z - 1);
                rim[z][y][0] = a, rim[z][y][1] = b, rim[z][y][2] = c, rim[z][y][3] = d;
            } else if (is_inner_y || is_inner_z) {
                rows.pair(y - 1, z - 1, rim[z][y][1], rim[z][y][2]);
            }
        }
    Differences along[3];
    for (int k = 0; k < 8; k++) {
        int x = 1 + (k & 1), y = 1 + (k >> 1 & 1), z = 1 + (k >> 2);
        along[0].at[k] = to_float32(rim[z][y][x + 1] - rim[z][y][x - 1]);
        along[1].at[k] = to_float32(rim[z][y + 1][x] - rim[z][y - 1][x]);
        along[2].at[k] = to_float32(rim[z + 1][y][x] - rim[z - 1][y][x]);
    }
    const auto &low = texels.low, &high = texels.high;
    double scale = texels.rules->scale;
    if (texels.is_at_border) {
        along[0].adjust(cell.x, low[0], high[0], 0);
        along[1].adjust(cell.y, low[1], high[1], 1);
        along[2].adjust(cell.z, low[2], high[2], 2);
    } else {
        scale *= 0.5;
    }
    const double* m = texels.rules->world_from_gradient;
    return {interpolate(along_world_axis(along, m, scale), shares), interpolate(along_world_axis(along, m + 3, scale), shares),
            interpolate(along_world_axis(along, m + 6, scale), shares)};
}

// Return the gradient at samples, in world axes.
INLINE Three gradient_at(const BrickTexels& texels, const Cell& cell, const Three& shares) {
    if (texels.rules == nullptr) return sample_gradient(texels.words, cell.at(PADDED_BRICK_SIZE), shares);
    if (texels.rules->voxel_texels.value.num_bytes == 1) return gradient_of_voxels<1>(texels, cell, shares);
    return gradient_of_voxels<2>(texels, cell, shares);
}
