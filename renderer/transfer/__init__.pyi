from .classify import (
    Classifier as Classifier,
    RawVoxels as RawVoxels,
    classify_scalar as classify_scalar,
    lambert_factor as lambert_factor,
    make_classifier as make_classifier,
    raw_voxels as raw_voxels,
    scalar_at as scalar_at,
    toward_light as toward_light,
)
from .light_field import (
    NO_LIGHT_FIELD as NO_LIGHT_FIELD,
    LightField as LightField,
    interpolate_cells as interpolate_cells,
    make_light_field as make_light_field,
)
from .piecewise import (
    GUIDE_SIZE as GUIDE_SIZE,
    MAX_NORMALIZED_SCALAR as MAX_NORMALIZED_SCALAR,
    PIECE_FLOATS as PIECE_FLOATS,
    PiecewiseTransfer as PiecewiseTransfer,
    TransferTable as TransferTable,
    evaluate as evaluate,
    evaluate_segment as evaluate_segment,
    make_piecewise_transfer as make_piecewise_transfer,
    make_transfer_table as make_transfer_table,
    normalize_scalar as normalize_scalar,
    range_width as range_width,
)
from .transfer_function import (
    LARGEST_EXPONENT as LARGEST_EXPONENT,
    MAX_VOXEL_DEPTH as MAX_VOXEL_DEPTH,
    VISIBILITY_THRESHOLD as VISIBILITY_THRESHOLD,
    TransferFunction as TransferFunction,
    is_range_visible as is_range_visible,
    make_transfer_function as make_transfer_function,
)
