// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// A transfer function of n control values as n + 1 intervals, the first and last of them unbounded.
struct Intervals {
    // [n]: control values times `scale`, not descending. Interval k has knots[k - 1] <= value < knots[k]: the value of
    // a step belongs to its upper side.
    Array<const double, 1> knots;
    // [n + 1, 10]: for interval k its base [4], slope [4], origin, and how many of the first k control points have
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
    // Whether both sides of a surface are lit, as in ShadingSpec (renderer/scene/shading_section.py).
    bool two_sided;
    // The coefficient of the ambient light, which reaches every point from all sides.
    double ambient;
    // The coefficient of the diffuse light, which is multiplied by the cosine between normal and light.
    double diffuse;
    // The coefficient of the highlight, where a surface mirrors the light.
    double specular;
    // The exponent of the highlight; a larger one makes highlights smaller.
    double shininess;
    // The share of the light that a surface seen edge-on loses, as in ShadingSpec.
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
// A half-space is bounded along the first axis only; the rows of its other two axes are 0.
struct RemovedSet {
    // [3, 4]: the transformation from index space to the set's own axes.
    double own_from_index[12];
    // [3, 3]: the matrix from directions along the set's own axes to the world.
    double world_from_own[9];
    // The lowest corner of the set, in its own axes.
    double low[3];
    // The highest corner of the set, in its own axes.
    double high[3];
};

// A set of n rays in index space, and their parts that are neither clipped away nor masked.
struct IndexRays {
    // [n, 3]: the origin (x, y, z) of each ray, in voxels.
    Array<const double, 2> origins;
    // [n, 3]: the direction of each ray, in index space, of unit length in the world.
    Array<const double, 2> directions;
    // [n, k, 2]: the distances from the origin, in the world, at which the parts of each ray start and end; some parts
    // are empty.
    Array<const double, 3> parts;
    // The clip sets that are removed, given only if cut faces are lit by their own normals; empty otherwise.
    Array<const RemovedSet, 1> removed;
};

// The voxels of a volume, in any order. The place of a voxel is the sum of a number for each of its coordinates.
struct PlacedVoxels {
    // [n]: the values of the voxels, at their places.
    AnyArray<1> values;
    // [z], [y], [x]: the numbers of each coordinate, ascending. The sum of the three last ones is below n.
    Array<const int64_t, 1> z;
    Array<const int64_t, 1> y;
    Array<const int64_t, 1> x;
};

// A layer: the values of a volume, and how they are shown.
struct LayerOptics {
    // The voxels of the volume.
    PlacedVoxels voxels;
    // [z, y, x]: the state of each macrocell, a block of 4^3 cells: UNKNOWN (0) at first, then whether it may show
    // anything. The array is updated, and later calls with the same voxels and intervals use it.
    Array<uint8_t, 3> macrocells;
    // The transfer function of the layer.
    Intervals intervals;
    // The light on the layer; None without a light.
    Maybe<RayShading> shading;
    // The factor on the layer's extinction.
    double weight;
    // [z, y, x, 3]: the colours of voxels, which multiply the transfer function's colours; None for white.
    Maybe<Sized<const uint8_t, 4, 3>> colors;
    // [labels]: the opacity of a voxel of each label, by the label's number; larger numbers have the last opacity. None
    // if values are not labels.
    Maybe<Array<const double, 1>> label_opacities;
};

// The fog along rays: the share of its colour, which is linear in the length along a ray, from 0 to 1.
struct RayFog {
    // [rgb]: the colour of the fog.
    double color[3];
    // [n, 2]: the share at the origin of each ray, not limited to numbers from 0 to 1, and its change per length in the
    // world. The parts of rays end where the share becomes 0 or 1.
    Sized<const double, 2, 2> shares;
};

// Integrate the light of layers along rays.
struct IntegrateRays {
    // The layers that the rays meet; their extinctions add up.
    Array<const LayerOptics, 1> layers;
    // The rays in the index space of each layer, all of them the same rays in the world, with the same lengths along
    // them.
    EACH_CALL Array<const IndexRays, 1> rays;
    // Whether light adds up without absorption, so that no point hides another one.
    bool adds;
    // [steps]: the largest quadrature steps. A number bounds the length of a step, in voxels, and its optical depth.
    // Rays are integrated with each of these bounds.
    EACH_CALL Array<const double, 1> max_steps;
    // The fog; None without fog.
    EACH_CALL Maybe<RayFog> fog;
    // [n, steps, 4]: the premultiplied RGBA of each ray, for each bound of the steps. If there are 4 + intervals
    // channels, the further channels hold how much each interval of the transfer function adds to the opacity, layer by
    // layer.
    EACH_CALL Array<double, 3> radiance;
};
LONG_KERNEL(integrate_rays, IntegrateRays)

// Find the parts of rays inside a mask.
struct MaskRays {
    // The mask, as a layer that shows the points inside the mask.
    LayerOptics layer;
    // The rays, in the index space of the mask.
    IndexRays rays;
    // [n, k, 2]: the distances at which the first k parts of each ray inside the mask start and end.
    Array<double, 3> parts;
    // [n]: the number of parts of each ray inside the mask, which may exceed k.
    Array<int64_t, 1> counts;
};
LONG_KERNEL(mask_rays, MaskRays)

// Find the most extreme scalar along rays.
struct SearchRays {
    // The voxels of the volume.
    PlacedVoxels voxels;
    // [z, y, x]: the largest product of `sign` and a value in each macrocell, a block of 4^3 cells; NaN at first. The
    // array is updated, and later calls with the same voxels and sign use it.
    Array<double, 3> tops;
    // The factor on values: rays look for the largest product of the factor and a value. The factor is negative to find
    // the smallest value.
    double sign;
    // Among products of `sign` and a value that differ by no more than this number, the first along the ray counts.
    double least_rise;
    // The rays, in the volume's index space.
    EACH_CALL IndexRays rays;
    // [n, 2]: for each ray the largest product, and the distance along the ray at which it lies. The product is minus
    // infinity if the ray misses the volume.
    EACH_CALL Array<double, 2> found;
};
LONG_KERNEL(search_rays, SearchRays)

// The mask of a layer, for points in space.
struct PathMask {
    // The numbers of labels; the layer is shown at points whose label is not 0.
    PlacedVoxels voxels;
    // [3, 4]: the transformation from the world to the mask's index space.
    double index_from_world[12];
};

// A layer in space, for paths that turn. Places in the world are relative to a point that all layers share.
struct PathMedium {
    // [z, y, x]: the largest extinction in each macrocell, a block of 4^3 cells; NaN at first. The array is updated, and
    // later calls with the same values and intervals use it.
    Array<double, 3> majorants;
    // [3, 4]: the transformation from the world to the layer's index space.
    double index_from_world[12];
    // [3, 4]: the transformation from the layer's index space to the world.
    double world_from_index[12];
    // The finest spacing of voxels.
    double voxel;
    // The mask of the layer; None without a mask.
    Maybe<PathMask> mask;
};

// The surfaces of layers, as in SurfaceSpec (renderer/scene/light_section.py).
struct PathSurface {
    // The largest share of a point that is a surface.
    double share;
    // The coefficient and the exponent of highlights.
    double specular;
    double shininess;
};

// The sources of light around the layers, as in LightSources (renderer/lighting/environment.py), in world axes.
struct PathLight {
    // The axis of the environment, a unit vector.
    double up[3];
    // [band, rgb]: the coefficients of the environment's radiance.
    Sized<const double, 2, 3, 3> environment;
    // The unit vector to the middle of the key light.
    double key[3];
    // 1 less the cosine of the key light's angular radius.
    double key_rise;
    // [rgb]: the integral of the key light's radiance over its solid angle.
    double key_irradiance[3];
    // The factor on albedos of matter that light meets on its way; points of rays have their whole albedo.
    double scattering;
    // The surfaces on which paths may begin; None without surfaces.
    Maybe<PathSurface> surface;
};

// Follow the paths of light that scatters in layers, from rays on.
struct TracePaths {
    // The layers; their colours are albedos, and their extinctions add up. With surfaces they have a light of the viewer,
    // for their gradients; otherwise they have none.
    Array<const LayerOptics, 1> layers;
    // [layers]: the same layers in space.
    Array<const PathMedium, 1> media;
    // The sources of light.
    PathLight light;
    // The rays in the index space of each layer, as in IntegrateRays. `removed` has all clip sets of the layer.
    EACH_CALL Array<const IndexRays, 1> rays;
    // The fog, its colour divided by the exposure of the light; None without fog.
    EACH_CALL Maybe<RayFog> fog;
    // [n]: the state of the random numbers of each ray.
    EACH_CALL Array<const uint64_t, 1> states;
    // The number of paths that begin on each ray.
    EACH_CALL int64_t num_paths;
    // [n, 4]: the linear radiance of each ray, the mean of its paths; and the opacity, which is exact.
    EACH_CALL Array<double, 2> radiance;
};
LONG_KERNEL(trace_paths, TracePaths)
