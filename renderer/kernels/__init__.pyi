from .binding import kernels as kernels
from .bus_errors import guarded_regions as guarded_regions
from .library import describe_kernels as describe_kernels, num_lanes as num_lanes, processor_level as processor_level
from .records import (
    AtlasTexels as AtlasTexels,
    BrickSums as BrickSums,
    Classifier as Classifier,
    ClipRegion as ClipRegion,
    Field as Field,
    FieldMask as FieldMask,
    FogRamp as FogRamp,
    Grid as Grid,
    IndexRays as IndexRays,
    Intervals as Intervals,
    LayerBricks as LayerBricks,
    LayerOptics as LayerOptics,
    Light as Light,
    LightGrid as LightGrid,
    MaskGrid as MaskGrid,
    ModelView as ModelView,
    PathLight as PathLight,
    PathMask as PathMask,
    PathMedium as PathMedium,
    PathSurface as PathSurface,
    PiecewiseTransfer as PiecewiseTransfer,
    PlacedVoxels as PlacedVoxels,
    RadianceCells as RadianceCells,
    RayFog as RayFog,
    RaySetup as RaySetup,
    RayShading as RayShading,
    RemovedSet as RemovedSet,
    SearchRules as SearchRules,
    Shading as Shading,
    StreamedLevel as StreamedLevel,
    SurfaceCells as SurfaceCells,
    TexelRules as TexelRules,
    TransferTable as TransferTable,
    VisibleNodes as VisibleNodes,
    VoxelLighting as VoxelLighting,
    Voxels as Voxels,
    VoxelTexels as VoxelTexels,
)
from .threads import ThreadPool as ThreadPool

# isort: split
# For tests alone: steps and constants that no other room uses.
from .binding import Kernel as Kernel
from .build import (
    BUILT as BUILT,
    LEVELS as LEVELS,
    SOURCES as SOURCES,
    source_files as source_files,
    this_target as this_target,
)
from .header import Header as Header, Member as Member, Struct as Struct, read_headers as read_headers
from .library import load_library as load_library
