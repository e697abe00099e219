from .bricks import (
    APRON as APRON,
    BRICK_LEVELS as BRICK_LEVELS,
    ERRORS_ON_A_RAY as ERRORS_ON_A_RAY,
    BrickCut as BrickCut,
    BrickLevel as BrickLevel,
    Bricks as Bricks,
    cut_bricks as cut_bricks,
    make_bricks as make_bricks,
    num_bricks_at as num_bricks_at,
)
from .kernels import BRICK as BRICK, SIDE as SIDE
from .means import LEAST_BRICKS as LEAST_BRICKS, MOST_KEPT_BYTES as MOST_KEPT_BYTES, MadeMeans as MadeMeans
from .sampling import (
    DITHER as DITHER,
    PHASE_PER_PX as PHASE_PER_PX,
    BrickBatch as BrickBatch,
    Thrift as Thrift,
    make_brick_batch as make_brick_batch,
    toward_light as toward_light,
)
from .sizes import brick_sizes as brick_sizes
from .texels import mean_texels as mean_texels, scalar_texels as scalar_texels
