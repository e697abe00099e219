// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// A transfer function of n control values as n + 1 intervals, the first and last of them unbounded.
struct Intervals {
    // [n]: control values times `scale`, not descending. Interval k has knots[k - 1] <= value < knots[k]: the value of
    // a step belongs to its upper side.
    Array<const double, 1> knots;
    // [n + 1, 10]: base [4], slope [4], origin and the number of the first k control points that have extinction:
    // (r, g, b, extinction) of a value is base + slope * (value - origin).
    Array<const double, 2> rows;
    // Of scalars and knots: a power of two with which sums and differences neither overflow nor vanish.
    double scale;
};

// The light on rays, of scalars that are multiplied by `Intervals.scale`.
struct RayShading {
    // Whether Lambert's law is all, so that highlights, silhouettes, factors and the grid do not count.
    bool is_plain;
    // Whether the light comes from the viewer.
    bool is_camera;
    // As in ShadingSpec (renderer/scene/shading_section.py), and so are the next five.
    bool two_sided;
    double ambient;
    double diffuse;
    double specular;
    double shininess;
    double silhouette;
    // The distance from cut faces up to which they are lit by their own normal, a length in the world.
    double face_depth;
    // The unit vector to the light, in world axes; not used where the light comes from the viewer.
    double light[3];
    // [3, 3]: from positions in index space to the world.
    double world_from_index[9];
    // [3, 3]: from gradients along the index axes to the world.
    double world_from_gradient[9];
    // [n, 3]: a gradient's magnitude, times `Intervals.scale`, the factor on extinction there and its slope up to the
    // next one.
    Array<const double, 2> factors;
    // The share of the light that reaches each place.
    LightGrid grid;
};

// A convex set that is clipped away: the points from `low` to `high` in axes of its own, in world lengths.
//
// A half-space has one axis, the first, and the others are 0.
struct RemovedSet {
    // [3, 4]: from index space to the axes of the set.
    double own_from_index[12];
    // [3, 3]: from directions along these axes to the world.
    double world_from_own[9];
    // The lowest corner.
    double low[3];
    // The highest corner.
    double high[3];
};

// A set of n rays in index space, and their parts that are neither clipped away nor masked.
struct IndexRays {
    // [n, 3]: positions (x, y, z), in voxels.
    Array<const double, 2> origins;
    // [n, 3]: of unit length in the world.
    Array<const double, 2> directions;
    // [n, k, 2]: world lengths from the origin at which parts start and end, one behind the other; some are empty.
    Array<const double, 3> parts;
    // The sets that are clipped away, where their faces are lit; none otherwise.
    Array<const RemovedSet, 1> removed;
};

// A layer: the values of a volume, and how they are shown.
struct LayerOptics {
    // [z, y, x]: the values.
    AnyArray<3> values;
    // [z, y, x]: the state of each macrocell; 0, unknown, at first, and updated, for calls with the same values and
    // intervals.
    Array<uint8_t, 3> macrocells;
    Intervals intervals;
    // None without a light.
    Maybe<RayShading> shading;
    // A factor on extinction.
    double weight;
    // [z, y, x, 3]: colours of voxels, factors on the transfer function's colours; None for white.
    Maybe<Sized<const uint8_t, 4, 3>> colors;
    // [labels]: the opacity of a voxel of each label, by its number; numbers above have the last one. None where values
    // are not labels.
    Maybe<Array<const double, 1>> label_opacities;
};

// Integrate light along rays.
struct IntegrateRays {
    Array<const LayerOptics, 1> layers;
    // The same rays in the index space of each layer; lengths along them are common to all.
    EACH_CALL Array<const IndexRays, 1> rays;
    // Whether no point hides another one: the light of all points adds up.
    bool adds;
    // [steps]: the longest quadrature steps, in voxels, in optical depth and in pieces.
    EACH_CALL Array<const double, 1> max_steps;
    // [n, steps, 4]: premultiplied RGBA. With 4 + intervals channels, the others are what each interval of the transfer
    // function adds to the opacity, layer by layer.
    EACH_CALL Array<double, 3> radiance;
};
LONG_KERNEL(integrate_rays, IntegrateRays)

// Find the parts of rays inside a mask.
struct MaskRays {
    // The mask, as a layer that shows what is inside.
    LayerOptics layer;
    IndexRays rays;
    // [n, k, 2]: the first k parts of each ray.
    Array<double, 3> parts;
    // [n]: the number of all parts of each ray.
    Array<int64_t, 1> counts;
};
LONG_KERNEL(mask_rays, MaskRays)

// Find the most extreme scalar along rays.
struct SearchRays {
    // [z, y, x]: the values.
    AnyArray<3> values;
    // [z, y, x]: the largest number in each macrocell; NaN at first, and updated, for calls with the same values and
    // sign.
    Array<double, 3> tops;
    // The factor on values whose products are compared; negative where the smallest value is sought.
    double sign;
    // Of numbers that differ by no more than this the first along the ray counts.
    double least_rise;
    EACH_CALL IndexRays rays;
    // [n, 2]: the largest number, and the length along the ray at which it is; minus infinity for a ray that misses the
    // volume.
    EACH_CALL Array<double, 2> found;
};
LONG_KERNEL(search_rays, SearchRays)
