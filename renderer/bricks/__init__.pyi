from .brick_cut import (
    BrickCut as BrickCut,
    brick_cut_sizes as brick_cut_sizes,
    cut_bricks as cut_bricks,
)
from .brick_layers import BrickLayer as BrickLayer, BrickLayers as BrickLayers
from .brick_means import (
    MIN_BRICKS_PER_THREAD as MIN_BRICKS_PER_THREAD,
    color_texels as color_texels,
)
from .bricks import (
    RAY_ERROR_FACTOR as RAY_ERROR_FACTOR,
    Bricks as Bricks,
    make_bricks as make_bricks,
)
from .extremes import extreme_bricks as extreme_bricks, extremes_at as extremes_at
from .layout import (
    BRICK_LEVELS as BRICK_LEVELS,
    BRICK_SIZE as BRICK_SIZE,
    PADDED_BRICK_SIZE as PADDED_BRICK_SIZE,
)
from .pixel_grid import (
    RAYS_ACROSS as RAYS_ACROSS,
    ScreenSampling as ScreenSampling,
    ray_positions as ray_positions,
)
from .sampling import (
    BrickBatch as BrickBatch,
    make_brick_batch as make_brick_batch,
)
from .texels import (
    NO_LIGHT as NO_LIGHT,
    fill_scalar_texels as fill_scalar_texels,
    mean_texels as mean_texels,
    texel_change as texel_change,
    texel_gradients as texel_gradients,
    texel_rules as texel_rules,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .brick_means import recompute_means as recompute_means, stored_means as stored_means
from .pixel_grid import (
    screen_sampling_at as screen_sampling_at,
)
from .sampling import step_sizes as step_sizes
from .subvoxel import make_channel_curve as make_channel_curve
from .texels import voxel_texels as voxel_texels
