// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// A transfer function of n control values as n + 1 intervals, the first and last of them unbounded.
struct Intervals {
    // [n]: control values times `scale`, not descending. Interval k has knots[k - 1] <= value < knots[k]: the value of
    // a step belongs to its upper side.
    Array<const double, 1> knots;
    // [n + 1, 10]: for each interval base [4], slope [4], origin, and how many of the first k control points have
    // extinction. The channels (r, g, b, extinction) of a value are base + slope * (value - origin).
    Array<const double, 2> rows;
    // A factor on scalars and knots: a power of two with which sums and differences neither overflow nor vanish.
    double scale;
};

// The light on rays, for scalars that are multiplied by `Intervals.scale`.
struct RayShading {
    // Whether the light follows Lambert's law alone; then highlights, silhouettes, factors and the grid are unused.
    bool is_plain;
    // Whether the light comes from the viewer.
    bool is_camera;
    // Whether both sides of a surface are lit, as in ShadingSpec (renderer/scene/shading_section.py); the next five are
    // as there, too.
    bool two_sided;
    double ambient;
    double diffuse;
    double specular;
    double shininess;
    double silhouette;
    // The distance from a cut face up to which points are lit by the face's normal, as a length in the world.
    double face_depth;
    // The unit vector towards the light, in world axes; unused if the light comes from the viewer.
    double light[3];
    // [3, 3]: the matrix from positions in index space to the world.
    double world_from_index[9];
    // [3, 3]: the matrix from gradients along the index axes to the world.
    double world_from_gradient[9];
    // [n, 3]: a gradient's magnitude times `Intervals.scale`, the factor on extinction at this magnitude, and the
    // factor's slope up to the next row.
    Array<const double, 2> factors;
    // The share of the light that reaches each position.
    LightGrid grid;
};

// A convex set that is clipped away: the points from `low` to `high` in the set's own axes, in world lengths.
//
// A half-space is bounded along the first axis only; its other axes are 0.
struct RemovedSet {
    // [3, 4]: the transformation from index space to the set's own axes.
    double own_from_index[12];
    // [3, 3]: the matrix from directions along the set's own axes to the world.
    double world_from_own[9];
    // The lowest corner, in the set's own axes.
    double low[3];
    // The highest corner, in the set's own axes.
    double high[3];
};

// A set of n rays in index space, and their parts that are neither clipped away nor masked.
struct IndexRays {
    // [n, 3]: positions (x, y, z), in voxels.
    Array<const double, 2> origins;
    // [n, 3]: the rays' directions in index space, of unit length in the world.
    Array<const double, 2> directions;
    // [n, k, 2]: the distances from the origin, in the world, at which the parts of each ray start and end; some parts
    // are empty.
    Array<const double, 3> parts;
    // The clip sets that are removed, given only if cut faces are lit by their own normals; empty otherwise.
    Array<const RemovedSet, 1> removed;
};

// A layer: the values of a volume, and how they are shown.
struct LayerOptics {
    // [z, y, x]: the values of the voxels.
    AnyArray<3> values;
    // [z, y, x]: the state of each macrocell, UNKNOWN (0) at first. The array is updated, and later calls with the same
    // values and intervals use it.
    Array<uint8_t, 3> macrocells;
    Intervals intervals;
    // The light; None without a light.
    Maybe<RayShading> shading;
    // A factor on extinction.
    double weight;
    // [z, y, x, 3]: the colours of voxels, which multiply the transfer function's colours; None for white.
    Maybe<Sized<const uint8_t, 4, 3>> colors;
    // [labels]: the opacity of a voxel of each label, by the label's number; larger numbers have the last opacity. None
    // if values are not labels.
    Maybe<Array<const double, 1>> label_opacities;
};

// Integrate light along rays.
struct IntegrateRays {
    Array<const LayerOptics, 1> layers;
    // The rays in the index space of each layer, all of them the same rays in the world, with the same lengths along
    // them.
    EACH_CALL Array<const IndexRays, 1> rays;
    // Whether light adds up without absorption, so that no point hides another one.
    bool adds;
    // [steps]: the longest quadrature steps, in voxels, in optical depth and in pieces; rays are integrated with each
    // of them.
    EACH_CALL Array<const double, 1> max_steps;
    // [n, steps, 4]: premultiplied RGBA. If there are 4 + intervals channels, the others are what each interval of the
    // transfer function adds to the opacity, layer by layer.
    EACH_CALL Array<double, 3> radiance;
};
LONG_KERNEL(integrate_rays, IntegrateRays)

// Find the parts of rays inside a mask.
struct MaskRays {
    // The mask, as a layer that shows the points inside.
    LayerOptics layer;
    IndexRays rays;
    // [n, k, 2]: the first k parts of each ray.
    Array<double, 3> parts;
    // [n]: the number of parts of each ray, which may exceed k.
    Array<int64_t, 1> counts;
};
LONG_KERNEL(mask_rays, MaskRays)

// Find the most extreme scalar along rays.
struct SearchRays {
    // [z, y, x]: the values of the voxels.
    AnyArray<3> values;
    // [z, y, x]: the largest number in each macrocell, NaN at first. The array is updated, and later calls with the
    // same values and sign use it.
    Array<double, 3> tops;
    // The factor on values, whose largest product is sought; it is negative if the smallest value is sought.
    double sign;
    // Among numbers that differ by no more than this, the first along the ray counts.
    double least_rise;
    EACH_CALL IndexRays rays;
    // [n, 2]: the largest number, and the distance along the ray at which it lies; minus infinity for a ray that misses
    // the volume.
    EACH_CALL Array<double, 2> found;
};
LONG_KERNEL(search_rays, SearchRays)
