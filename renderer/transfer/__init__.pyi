from .albedos import (
    albedos_of as albedos_of,
    color_of_thick as color_of_thick,
    linear_of_srgb as linear_of_srgb,
    srgb_of_linear as srgb_of_linear,
    surface_reflectance as surface_reflectance,
)
from .classify import (
    RawVoxels as RawVoxels,
    make_classifier as make_classifier,
    raw_voxels as raw_voxels,
    toward_light as toward_light,
)
from .light_factors import (
    NO_LIGHT_GRID as NO_LIGHT_GRID,
    make_light_grid as make_light_grid,
)
from .piecewise import (
    GUIDE_SIZE as GUIDE_SIZE,
    MAX_NORMALIZED_SCALAR as MAX_NORMALIZED_SCALAR,
    PIECE_FLOATS as PIECE_FLOATS,
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
    visibility_breakpoints as visibility_breakpoints,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .albedos import albedo_of_thick as albedo_of_thick
