from .splats import (
    GAUSSIAN_CUTOFF as GAUSSIAN_CUTOFF,
    GaussianFootprint as GaussianFootprint,
    GouraudFootprint as GouraudFootprint,
    SplatBatch as SplatBatch,
    make_footprint as make_footprint,
    make_splats as make_splats,
    samples_across_at as samples_across_at,
)
