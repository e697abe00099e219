from .building import (
    STREAMED_LEVELS as STREAMED_LEVELS,
    build_pyramid as build_pyramid,
    pyramid_arrays as pyramid_arrays,
    restore_pyramid as restore_pyramid,
)
from .cut import (
    Cut as Cut,
    cell_voxel_counts as cell_voxel_counts,
    cut_pyramid as cut_pyramid,
    descendants as descendants,
    node_errors as node_errors,
    root_cells as root_cells,
    root_error as root_error,
    visible_children as visible_children,
)
from .cut_size import CutSizes as CutSizes, cut_sizes as cut_sizes
from .nodes import (
    BLOCK_SIZE as BLOCK_SIZE,
    opacities_to_depths as opacities_to_depths,
    packed_channels as packed_channels,
    store_scaled as store_scaled,
)
from .pyramid import (
    EVERY_CUT as EVERY_CUT,
    FinestCut as FinestCut,
    Level as Level,
    Pyramid as Pyramid,
    error_scale as error_scale,
    subdivide as subdivide,
)
