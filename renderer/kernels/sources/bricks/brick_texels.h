// Make the texels of bricks of level 0 (renderer/bricks/texels.py).
#pragma once
#include "bricks/kernels.h"
#include "pyramid/brick_layout.h"

// Return the number of doubles of memory that `make_texels` works in.
int64_t scratch_size(const TexelRules& rules);

// Return the number of voxels along the side of a brick whose texels are voxels. Gradients need a halo of two.
inline int64_t voxel_side(const TexelRules& rules) { return BRICK_SIZE + 2 * HALO * (rules.is_lit ? 2 : 1); }

// Return the number of floats, or of words of four bytes, of the texels of a brick.
int64_t texel_floats(const TexelRules& rules);

// Return whether each bit pattern of a voxel has a scalar.
bool are_complete(const TexelRules& rules);

// Return whether a cell, [3] (x, y, z), is a brick of the volume.
bool is_brick_of(const TexelRules& rules, const Array<const int32_t, 1>& cell);

// Write the texels of a brick. cell: the brick, [3] (x, y, z). memory: room for `scratch_size` numbers. texels: room for
// `texel_floats` numbers.
void make_texels(const TexelRules& rules, const Array<const int32_t, 1>& cell, double* memory, float* texels);
