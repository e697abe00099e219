from .splats import (
    GaussianFootprint as GaussianFootprint,
    GouraudFootprint as GouraudFootprint,
    SplatBatch as SplatBatch,
    make_footprint as make_footprint,
    make_splats as make_splats,
)
