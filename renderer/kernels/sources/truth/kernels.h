// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// As in renderer/truth/optics.py, and the next one.
struct Intervals {
    Array<const double, 1> knots;
    Array<const double, 2> rows;
    double scale;
};

struct RayShading {
    bool is_plain, is_camera, two_sided;
    double ambient, diffuse, specular, shininess, silhouette, face_depth;
    double light[3], world_from_index[9], world_from_gradient[9];
    Array<const double, 2> factors;
    LightGrid grid;
};

// As in renderer/truth/kept_parts.py.
struct RemovedSet {
    double own_from_index[12], world_from_own[9], low[3], high[3];
};

// n rays in index space, as in renderer/truth/integrator.py.
struct IndexRays {
    Array<const double, 2> origins, directions;
    Array<const double, 3> parts;
    Array<const RemovedSet, 1> removed;
};

// As `optics_of` there. macrocells: what is known of each; zeros at first, and updated. label_opacities: of labels
// alone, that of a voxel, by number; numbers above have the last one.
struct LayerOptics {
    AnyArray<3> values;
    Array<uint8_t, 3> macrocells;
    Intervals intervals;
    Maybe<RayShading> shading;
    double weight;
    Maybe<Sized<const uint8_t, 4, 3>> colors;
    Maybe<Array<const double, 1>> label_opacities;
};

// rays: of each layer. adds: whether what is behind is seen as if nothing were before it.
struct IntegrateRays {
    Array<const LayerOptics, 1> layers;
    Array<const IndexRays, 1> rays;
    bool adds;
    Array<const double, 1> max_steps;
    Array<double, 3> radiance;
};
LONG_KERNEL(integrate_rays, IntegrateRays)

struct MaskRays {
    LayerOptics layer;
    IndexRays rays;
    Array<double, 3> parts;
    Array<int64_t, 1> counts;
};
LONG_KERNEL(mask_rays, MaskRays)

struct SearchRays {
    AnyArray<3> values;
    Array<double, 3> tops;
    double sign, least_rise;
    IndexRays rays;
    Array<double, 2> found;
};
LONG_KERNEL(search_rays, SearchRays)
