// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// As in renderer/view/clip_slabs.py.
struct ClipRegion {
    Sized<const double, 2, 8> slabs;
    Sized<const double, 3, 3, 8> boxes;
};

// As in renderer/view/brick_projection.py.
struct RaySetup {
    double origins[9], directions[9], slope_per_px, start, center_px[2];
    Maybe<ClipRegion> clip;
};

// As in renderer/view/splat_projection.py.
struct ModelView {
    double view_from_model[12];
    bool perspective;
    double scale_px;
    int64_t size[2];
    double near, slope_limit[2];
};

struct ProjectBounds {
    Sized<const double, 3, 2, 3> bounds;
    ModelView camera;
    int64_t beyond;
    Sized<double, 2, 4> rectangles;
};
KERNEL(project_bounds, ProjectBounds)

struct CullSplats {
    Sized<const float, 2, 8> vertices;
    Array<const double, 1> sigmas;
    double cutoff, min_sigma_px, clipped_sigmas, culled_sigmas;
    ModelView camera;
    double along[3];
    Array<float, 1> depths;
    Array<bool, 1> is_visible;
};
KERNEL(cull_splats, CullSplats)

struct DepthOrder {
    Array<const float, 1> depths;
    Array<uint32_t, 1> order;
};
KERNEL(depth_order, DepthOrder)

struct BoxOrder {
    Array<const uint8_t, 1> levels;
    Sized<const int32_t, 2, 3> cells;
    double eye[3];
    int64_t shape[3];
    Array<uint32_t, 1> order;
};
KERNEL(box_order, BoxOrder)
