from .classify import (
    Classifier as Classifier,
    RawVoxels as RawVoxels,
    make_classifier as make_classifier,
    raw_voxels as raw_voxels,
    toward_light as toward_light,
)
from .light_field import (
    NO_LIGHT_FIELD as NO_LIGHT_FIELD,
    LightField as LightField,
    make_light_field as make_light_field,
)
from .piecewise import (
    GUIDE_SIZE as GUIDE_SIZE,
    MAX_NORMALIZED_SCALAR as MAX_NORMALIZED_SCALAR,
    PIECE_FLOATS as PIECE_FLOATS,
    PiecewiseTransfer as PiecewiseTransfer,
    TransferTable as TransferTable,
    make_piecewise_transfer as make_piecewise_transfer,
    make_transfer_table as make_transfer_table,
    range_width as range_width,
)
from .transfer_function import (
    LARGEST_EXPONENT as LARGEST_EXPONENT,
    MAX_VOXEL_DEPTH as MAX_VOXEL_DEPTH,
    VISIBILITY_THRESHOLD as VISIBILITY_THRESHOLD,
    TransferFunction as TransferFunction,
    make_transfer_function as make_transfer_function,
)
