// Make the missing texels of a brick when a ray first meets the brick, so that bricks behind what is opaque cost nothing.
//
// The thread that finds that the texels are missing takes a free position of the atlas for them, and makes them. Other
// threads that meet the brick meanwhile wait for it. Texels do not depend on the thread that makes them, nor on their
// position in the atlas.
#pragma once
#include "bricks/brick_texels.h"
#include "draw/kernels.h"

extern "C" int sched_yield(void) noexcept;

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

// Make the texels of a brick if they are missing. memory: room for `scratch_size` numbers.
inline void make_missing(const AtlasTexels& atlas, int64_t brick, double* memory) {
    int64_t* offset = &atlas.offsets[brick];
    int64_t found = offset_of(atlas, brick);
    if (found >= NOTHING) return;
    if (found == MISSING && __atomic_compare_exchange_n(offset, &found, IN_WORK, false, __ATOMIC_ACQUIRE, __ATOMIC_ACQUIRE)) {
        int64_t position = atlas.free[__atomic_fetch_add(&atlas.num_taken[0], 1, __ATOMIC_RELAXED)];
        make_texels(atlas.rules.value, atlas.cells[brick], memory, &atlas.texels[position]);
        __atomic_store_n(offset, position, __ATOMIC_RELEASE);
    }
    while (offset_of(atlas, brick) == IN_WORK) sched_yield();
}

// Return the number of doubles of memory that `make_missing` needs.
inline int64_t scratch_size(const AtlasTexels& atlas) { return atlas.rules.exists ? scratch_size(atlas.rules.value) : 0; }

// Return whether there are rules, places and free positions for all missing texels. Other threads may make some of them
// meanwhile: that takes as many positions as bricks.
inline bool can_be_made(const AtlasTexels& atlas) {
    if (atlas.num_taken.shape[0] != 1 || !match(atlas.offsets, atlas.cells)) return false;
    int64_t num = __atomic_load_n(&atlas.num_taken[0], __ATOMIC_ACQUIRE);
    for (int64_t brick = 0; brick < atlas.offsets.shape[0]; brick++) num += offset_of(atlas, brick) == MISSING;
    if (num > atlas.free.shape[0]) return false;
    if (!atlas.rules.exists) return atlas.free.shape[0] == 0;
    for (int64_t k = 0; k < atlas.free.shape[0]; k++)
        if (atlas.free[k] < 0 || atlas.free[k] > atlas.texels.shape[0] - texel_floats(atlas.rules.value)) return false;
    return are_bricks(atlas.rules.value, atlas.cells);
}
