// Find the blocks of a brick in which nothing is visible, so that rays pass over their samples.
//
// A block is dark if none of the texels around its cells is visible. No sample in it is visible either: `lerp`, with a share
// below 1, returns no more than the larger of two texels, also after rounding. A ray passes over samples only if they are
// certainly in one dark block, and takes all others where it takes them without blocks: pictures have the same bytes.
#pragma once
#include "draw/atlas.h"

// The number of cells along the side of a block, as an exponent of two. On an opaque shell in 512^3 voxels, TODO.
constexpr int BLOCK_LEVELS = 2;
// The number of blocks along the side of a brick, whose samples are in the cells 0 to PADDED_BRICK_SIZE - 2.
constexpr int32_t BLOCKS_ACROSS = ((PADDED_BRICK_SIZE - 2) >> BLOCK_LEVELS) + 1;
// The number of blocks of a brick.
constexpr int32_t NUM_BLOCKS = BLOCKS_ACROSS * BLOCKS_ACROSS * BLOCKS_ACROSS;
// How far before the face at which a ray leaves a block its samples are still passed over at once, in samples: rounding may
// have moved the face.
constexpr float FACE_MARGIN = 0.01;
// The share of the largest scalar around a sample by which rounding may change a scalar, and more.
constexpr float SCALAR_MARGIN = 1e-4;

// The ways of rays through a brick, one ray in each lane.
struct RayWays {
    // The position of sample 0, in texels of the brick.
    Three begin;
    // The way from one sample to the next, in texels.
    Three step;
    // The number of samples of a texel along each axis.
    Three per_texel;
    // The number of the last sample.
    Floats last;

    INLINE RayWays(const Three& first, const Three& way, Floats num)
        : begin(first), step(way), per_texel{1.0f / way.x, 1.0f / way.y, 1.0f / way.z}, last(num) {}

    // Return the number of the sample at which rays reach the face of a block along an axis.
    template <int LEVELS>
    static INLINE Floats number_at_face(Ints block, Floats first, Floats way, Floats per_texel) {
        Ints face = (block + where(mask_of(way > 0.0f), in_all<Ints>(1), in_all<Ints>(0))) << LEVELS;
        Floats number = (to_float32(face) - first) * per_texel;
        return where(mask_of(way == 0.0f), in_all<Floats>((float)INFINITE), number);
    }

    // Return the numbers of samples behind the block of samples, of 2^LEVELS cells along its side, or of earlier ones.
    // cell, number: of the samples. most_numbers: numbers that are not passed.
    template <int LEVELS>
    INLINE Floats behind_block(const Cell& cell, Floats number, Floats most_numbers) const {
        Ints x = cell.x >> LEVELS, y = cell.y >> LEVELS, z = cell.z >> LEVELS;
        Floats face = number_at_face<LEVELS>(x, begin.x, step.x, per_texel.x);
        face = min_of(face, number_at_face<LEVELS>(y, begin.y, step.y, per_texel.y));
        face = min_of(face, number_at_face<LEVELS>(z, begin.z, step.z, per_texel.z));
        Floats found = to_float32(to_int32(max_of(number, min_of(most_numbers, face - FACE_MARGIN))));
        // Along each axis, rounded positions ascend or descend: samples between two of a block are in this block.
        Three shares;
        Cell other = cell_at(found, begin, step, shares);
        Mask is_same = mask_of((((other.x >> LEVELS) ^ x) | ((other.y >> LEVELS) ^ y) | ((other.z >> LEVELS) ^ z)) == 0);
        return where(is_same, found, number) + 1.0f;
    }

    // Return the numbers of the next samples that may reach a scalar, in the cell of samples or behind it.
    INLINE Floats next_in_cell(const Cell& cell, Floats number, const Corners& corners, Floats scalar, float wanted) const {
        const auto& [a, b, c, d, e, f, g, h] = corners;
        Floats most_rise = in_all<Floats>(0.0f), size = magnitude(scalar);
        auto add = [&](Floats one, Floats two, Floats three, Floats four, Floats way) {
            Floats highest = max_of(max_of(one, two), max_of(three, four));
            Floats lowest = min_of(min_of(one, two), min_of(three, four));
            most_rise += max_of(highest * way, lowest * way), size += max_of(highest, -lowest);
        };
        add(b - a, d - c, f - e, h - g, step.x);
        add(c - a, d - b, g - e, h - f, step.y);
        add(e - a, f - b, g - c, h - d, step.z);
        Floats missing = wanted - scalar - SCALAR_MARGIN * (size + __builtin_fabsf(wanted));
        Floats num = missing / fma(max_of(in_all<Floats>(0.0f), most_rise), 1.001f, 1e-30f);
        return behind_block<0>(cell, number, min_of(last, number + num));
    }
};

// The blocks of a brick that may show anything.
class Blocks {
    // A bit for each block, x before y before z, in words of 32 bits; 0 for a dark block.
    Ints words = in_all<Ints>(-1);

    // Return a bit for each texel of a row that is visible.
    template <class T>
    static INLINE uint32_t visible_in_row(const Array<const T, 1>& texels, int64_t place, T lowest_visible) {
        auto bits_from = [&](int64_t first) {
            auto row = load<Vector<T, BRICK_SIZE>>(texels, place + first);
            return (uint32_t)__builtin_bit_cast(uint16_t, mask_of(row >= lowest_visible)) << first;
        };
        return bits_from(0) | bits_from(2 * HALO);
    }

    // Set the bits of the blocks around texels. texels: from the first of the halo of one on. side: the number of texels
    // along the side of the brick. lowest_visible: the lowest texel that is visible.
    template <class T>
    INLINE void find(const Array<const T, 1>& texels, int64_t side, T lowest_visible) {
        uint32_t rows[BLOCKS_ACROSS][BLOCKS_ACROSS] = {};
        for (int64_t z = 0; z < PADDED_BRICK_SIZE; z++) {
            uint32_t of_plane[BLOCKS_ACROSS] = {};
            for (int64_t y = 0; y < PADDED_BRICK_SIZE; y++) {
                uint32_t bits = visible_in_row(texels, (z * side + y) * side, lowest_visible);
                for_blocks(y, [&](int64_t block) { of_plane[block] |= bits; });
            }
            for_blocks(z, [&](int64_t block) {
                for (int64_t y = 0; y < BLOCKS_ACROSS; y++) rows[block][y] |= of_plane[y];
            });
        }
        words = in_all<Ints>(0);
        constexpr uint32_t around = (2u << (1 << BLOCK_LEVELS)) - 1;
        uint32_t found[LANES] = {};
        for (int32_t block = 0; block < NUM_BLOCKS; block++) {
            uint32_t row = rows[block / BLOCKS_ACROSS / BLOCKS_ACROSS][block / BLOCKS_ACROSS % BLOCKS_ACROSS];
            bool is_visible = row >> (block % BLOCKS_ACROSS << BLOCK_LEVELS) & around;
            found[block >> 5] |= (uint32_t)is_visible << (block & 31);
            have_dark |= !is_visible;
        }
        words = load<Ints>((int32_t*)found, 0);
    }

    // Find the blocks by texels that are voxels, whose scalars ascend.
    template <class T>
    INLINE void find_in_voxels(const BrickTexels& texels, float lowest_visible) {
        const TexelRules& rules = *texels.rules;
        int32_t lowest = 0, end = 1 << 8 * sizeof(T);
        while (lowest < end) {
            int32_t middle = (lowest + end) / 2;
            if (scalars_of<1>(middle, rules)[0] >= lowest_visible) end = middle;
            else lowest = middle + 1;
        }
        const Array<const T, 1> voxels = {(const T*)texels.words.data, {4 / (int64_t)sizeof(T) * texels.words.shape[0]}};
        int64_t side = texels.side();
        if (lowest >> 8 * sizeof(T)) words = in_all<Ints>(0), have_dark = true;
        else find<T>(rest_of(voxels, texels.margin() * ((side + 1) * side + 1)), side, (T)lowest);
    }

    // Call `take` with the blocks, one or two, around a texel along an axis.
    template <class Take>
    static INLINE void for_blocks(int64_t texel, Take take) {
        int64_t block = texel >> BLOCK_LEVELS;
        if (block < BLOCKS_ACROSS) take(block);
        if (texel > 0 && texel == block << BLOCK_LEVELS) take(block - 1);
    }

  public:
    // Whether any block is dark.
    bool have_dark = false;

    // Find the blocks of a brick by its texels of scalars. lowest_visible: the lowest scalar that is visible.
    INLINE void find(const BrickTexels& texels, float lowest_visible) {
        if (texels.rules == nullptr) find<float>(texels.words, PADDED_BRICK_SIZE, lowest_visible);
        else if (texels.rules->voxel_texels.value.num_bytes == 1) find_in_voxels<uint8_t>(texels, lowest_visible);
        else find_in_voxels<uint16_t>(texels, lowest_visible);
    }

    // Return which cells are in dark blocks.
    INLINE Mask are_dark(const Cell& cell) const {
        Ints x = cell.x >> BLOCK_LEVELS, y = cell.y >> BLOCK_LEVELS, z = cell.z >> BLOCK_LEVELS;
        Ints block = (z * BLOCKS_ACROSS + y) * BLOCKS_ACROSS + x;
        Ints word = float32_to_bits(permute(bits_to_float32(words), block >> 5));
        return mask_of((word >> (block & 31) & 1) == 0);
    }
};
