from .classify import (
    VISIBILITY_THRESHOLD as VISIBILITY_THRESHOLD,
    Channels as Channels,
    Classifier as Classifier,
    Float64 as Float64,
    Lighting as Lighting,
    RawVoxels as RawVoxels,
    TransferSegments as TransferSegments,
    classify_voxel as classify_voxel,
    evaluate as evaluate,
    make_classifier as make_classifier,
    raw_voxels as raw_voxels,
    scalar_at as scalar_at,
)
from .piecewise import (
    GUIDE_SIZE as GUIDE_SIZE,
    MAX_NORMALIZED_SCALAR as MAX_NORMALIZED_SCALAR,
    PiecewiseTransfer as PiecewiseTransfer,
    make_piecewise_transfer as make_piecewise_transfer,
    range_width as range_width,
    relative as relative,
)
from .transfer_function import (
    LARGEST_EXPONENT as LARGEST_EXPONENT,
    TransferFunction as TransferFunction,
    make_transfer_function as make_transfer_function,
)
