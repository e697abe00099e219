// The numbers of cells and texels of a brick (renderer/bricks/layout.py).
#pragma once
#include "base/arrays.h"

// The number of octree levels between a brick and its cells.
constexpr int64_t BRICK_LEVELS = 4;
// The number of cells along each axis of a brick.
constexpr int64_t BRICK_SIZE = 1 << BRICK_LEVELS;
// The width, in cells, of a brick's halo: the layer of neighbouring cells around the brick that its texels hold, too.
constexpr int64_t HALO = 1;
// The number of texels along each axis of a brick with its halo.
constexpr int64_t PADDED_BRICK_SIZE = BRICK_SIZE + 2 * HALO;
