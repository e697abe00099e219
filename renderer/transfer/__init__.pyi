from .classify import (
    FAINTEST as FAINTEST,
    Channels as Channels,
    Classifier as Classifier,
    Codes as Codes,
    Float64 as Float64,
    Lighting as Lighting,
    Segments as Segments,
    classify_voxel as classify_voxel,
    evaluate as evaluate,
    make_classifier as make_classifier,
    scalar_at as scalar_at,
    voxel_codes as voxel_codes,
)
from .piecewise import (
    FARTHEST as FARTHEST,
    GUIDE_SIZE as GUIDE_SIZE,
    OpticalPieces as OpticalPieces,
    optical_pieces as optical_pieces,
    range_width as range_width,
    relative as relative,
)
from .transfer_function import (
    LARGEST_EXPONENT as LARGEST_EXPONENT,
    TransferFunction as TransferFunction,
    make_transfer as make_transfer,
)
