// Make the missing texels of a brick when a ray first meets the brick, so that bricks behind what is opaque cost nothing.
//
// The thread that finds that the texels are missing takes a free position of the atlas for them, and makes them. Other
// threads that meet the brick meanwhile wait for it. If no position is free, each thread makes the texels in memory of
// its own. Texels depend neither on the thread that makes them nor on their place.
#pragma once
#include "bricks/brick_texels.h"
#include "draw/voxel_texels.h"

extern "C" int sched_yield(void) noexcept;

// The number of floats of padding behind the last texel of an atlas: loads of whole rows may read so far beyond it.
constexpr int READ_BEHIND = 2;
// The offset of a brick that shows nothing; positions of texels are larger.
constexpr int64_t NOTHING = -1;
// The offset of a brick whose texels are missing.
constexpr int64_t MISSING = -2;
// The offset of a brick whose texels a thread is making.
constexpr int64_t IN_WORK = -3;

// Return the offset of a brick: the position of its texels, or one of the constants above.
INLINE int64_t offset_of(const AtlasTexels& atlas, int64_t brick) {
    return __atomic_load_n(&atlas.offsets[brick], __ATOMIC_ACQUIRE);
}

// Finds the texels of bricks for one thread, and makes those that are missing.
struct TexelFinder {
    // The texels of the atlas.
    const AtlasTexels* atlas;
    // Memory in which texels are made: room for `scratch_size` numbers.
    double* memory;
    // The texels of a brick for which the atlas had no free position.
    Array<float, 1> own;
    // The brick whose texels are in `own`; -1 for none.
    int64_t own_brick;

    // Make the texels of a brick that a ray meets, if they are missing.
    inline void meet(int64_t brick) {
        __atomic_store_n(&atlas->are_met[brick], true, __ATOMIC_RELAXED);
        if (offset_of(*atlas, brick) >= NOTHING || own_brick == brick) return;
        if (take_position(brick)) return;
        make_texels(atlas->rules.value, atlas->cells[brick], memory, own.data);
        own_brick = brick;
    }

    // Make the texels of a brick in the atlas, or let another thread finish them. Return whether the atlas had room.
    inline bool take_position(int64_t brick) const {
        int64_t *offset = &atlas->offsets[brick], found = MISSING, num_free = atlas->free.shape[0];
        if (__atomic_load_n(&atlas->num_taken[0], __ATOMIC_RELAXED) < num_free &&
            __atomic_compare_exchange_n(offset, &found, IN_WORK, false, __ATOMIC_ACQUIRE, __ATOMIC_ACQUIRE)) {
            int64_t number = __atomic_fetch_add(&atlas->num_taken[0], 1, __ATOMIC_RELAXED);
            int64_t position = number < num_free ? atlas->free[number] : MISSING;
            if (number < num_free) make_texels(atlas->rules.value, atlas->cells[brick], memory, &atlas->texels[position]);
            __atomic_store_n(offset, position, __ATOMIC_RELEASE);
        }
        while (offset_of(*atlas, brick) == IN_WORK) sched_yield();
        return offset_of(*atlas, brick) > NOTHING;
    }

    // Return the texels of a brick that this thread has met, and those after them.
    INLINE BrickTexels texels(int64_t brick) const {
        int64_t offset = offset_of(*atlas, brick);
        const Array<float, 1> found = offset < 0 ? own : rest_of(atlas->texels, offset);
        const Texels words = {found.data, {found.shape[0]}};
        const auto& rules = atlas->rules;
        if (rules.exists && rules.value.voxel_texels.exists) return voxels_of(words, rules.value, atlas->cells[brick]);
        return {words};
    }
};

// Return the number of doubles of memory in which the missing texels of a brick are made.
inline int64_t scratch_size(const AtlasTexels& atlas) { return atlas.rules.exists ? scratch_size(atlas.rules.value) : 0; }

// Return the number of floats that a thread needs for the texels of a brick of its own.
inline int64_t own_size(const AtlasTexels& atlas) {
    return atlas.rules.exists ? texel_floats(atlas.rules.value) + READ_BEHIND : 0;
}

// Return whether the arrays of an atlas fit together, and all free positions are in it.
inline bool is_consistent(const AtlasTexels& atlas) {
    if (atlas.num_taken.shape[0] != 1 || !match(atlas.offsets, atlas.cells, atlas.are_met)) return false;
    if (!atlas.rules.exists) return true;
    for (int64_t k = 0; k < atlas.free.shape[0]; k++)
        if (atlas.free[k] < 0 || atlas.free[k] > atlas.texels.shape[0] - own_size(atlas)) return false;
    return are_complete(atlas.rules.value);
}

// Return whether texels that kernels make have everything that samples read. gradients, numbers: whether samples read
// gradients, and whether they read the bits of float32 numbers.
inline bool have(const AtlasTexels& atlas, bool gradients, bool numbers) {
    const auto& rules = atlas.rules;
    return !rules.exists || ((rules.value.is_lit || !gradients) && !(rules.value.voxel_texels.exists && numbers));
}

// Return whether a brick of voxels shows nothing, is in the atlas, or can be made. num: the number of floats that a brick
// takes in the atlas if kernels do not make it.
inline bool can_be_drawn(const AtlasTexels& atlas, int64_t brick, int64_t num) {
    int64_t offset = offset_of(atlas, brick);
    if (offset >= 0) return offset <= atlas.texels.shape[0] - (atlas.rules.exists ? own_size(atlas) : num);
    return offset == NOTHING || (atlas.rules.exists && is_brick_of(atlas.rules.value, atlas.cells[brick]));
}
