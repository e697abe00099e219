from .classify import (
    Classifier as Classifier,
    RawVoxels as RawVoxels,
    VoxelLighting as VoxelLighting,
    classify_scalar as classify_scalar,
    classify_voxel as classify_voxel,
    make_classifier as make_classifier,
    raw_voxels as raw_voxels,
    scalar_at as scalar_at,
)
from .piecewise import (
    GUIDE_SIZE as GUIDE_SIZE,
    MAX_NORMALIZED_SCALAR as MAX_NORMALIZED_SCALAR,
    Channels as Channels,
    PiecewiseTransfer as PiecewiseTransfer,
    TransferTable as TransferTable,
    evaluate_segment as evaluate_segment,
    make_piecewise_transfer as make_piecewise_transfer,
    make_transfer_table as make_transfer_table,
    normalize_scalar as normalize_scalar,
    range_width as range_width,
)
from .shading import lambert_factor as lambert_factor, toward_light as toward_light
from .transfer_function import (
    LARGEST_EXPONENT as LARGEST_EXPONENT,
    TransferFunction as TransferFunction,
    make_transfer_function as make_transfer_function,
)
from .visibility import (
    VISIBILITY_THRESHOLD as VISIBILITY_THRESHOLD,
    is_range_visible as is_range_visible,
)
