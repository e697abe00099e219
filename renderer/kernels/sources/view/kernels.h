// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// A region that clip planes and boxes leave: the points p of a volume in all slabs and in no removed box.
//
// A slab is [8]: a normal n [3], bounds of n . p, a length, with p in index space relative to the volume's centre, and
// n as a unit vector [3] in the world.
struct ClipRegion {
    // [k, 8]: the slab of a plane is unbounded on one side.
    Sized<const double, 2, 8> slabs;
    // [m, 3, 8]: of each removed box the slabs across its axes.
    Sized<const double, 3, 3, 8> boxes;
};

// The rays of a view in the grid of a volume.
//
// With (x, y) the position of a pixel's centre in pixels, y downwards, relative to `center_px`:
//
//     origin = origins @ (1, x, y)        direction = directions @ (1, x, y)
struct RaySetup {
    // [3, 3]: index space relative to the volume's centre.
    double origins[9];
    // [3, 3]: index units per model unit of depth in perspective, per model unit of length otherwise.
    double directions[9];
    // A ray's length per unit of depth is `sqrt(1 + slope_per_px^2 (x^2 + y^2))`.
    double slope_per_px;
    // The near plane, in model units along the direction.
    double start;
    // The image's centre (x, y).
    double center_px[2];
    // The rest of the volume, if the view clips it.
    Maybe<ClipRegion> clip;
};

// A view in model units.
struct ModelView {
    // [3, 4]: rotation and translation, model units.
    double view_from_model[12];
    // Whether the projection is in perspective; orthographic otherwise.
    bool perspective;
    // Focal length in pixels (perspective), pixels per model unit (orthographic).
    double scale_px;
    // The image's width and height.
    int64_t size[2];
    // The depth of the near plane, in model units.
    double near;
    // Bounds on |x| / depth and |y| / depth where footprints are linearised.
    double slope_limit[2];
};

// Find the rectangles of the image around the bounds of bricks.
struct ProjectBounds {
    // [n, 2, 3]: lowest and highest corners, in model coordinates.
    Sized<const double, 3, 2, 3> bounds;
    ModelView camera;
    // Pixels outside of the image to which rectangles are clipped.
    int64_t beyond;
    // [n, 4]: left, top, right and bottom, in pixels.
    Sized<double, 2, 4> rectangles;
};
KERNEL(project_bounds, ProjectBounds)

// Find the splats that a view sees, and their depths.
struct CullSplats {
    // [n, 8]: as in SplatBatch (renderer/splats/splats.py).
    Sized<const float, 2, 8> vertices;
    // [shapes]: the largest standard deviation of each shape, in model units.
    Array<const double, 1> sigmas;
    // The radius at which a footprint ends, in standard deviations.
    double cutoff;
    // The least standard deviation of a footprint, in pixels.
    double min_sigma_px;
    // A splat counts as clipped by the near plane up to so many standard deviations behind it.
    double clipped_sigmas;
    // A splat is gone from so many standard deviations before the near plane on.
    double culled_sigmas;
    ModelView camera;
    // The unit vector in the world along which depths are measured.
    double along[3];
    // [n]: depths of the centres from the model's origin.
    Array<float, 1> depths;
    // [n]: whether the footprint may meet the image.
    Array<bool, 1> is_visible;
};
KERNEL(cull_splats, CullSplats)

// Sort by descending depth, equal ones by ascending number.
struct DepthOrder {
    // [n]: depths, none of them NaN.
    Array<const float, 1> depths;
    // [n]: their numbers, sorted.
    Array<uint32_t, 1> order;
};
KERNEL(depth_order, DepthOrder)

// Sort nodes of the octree back to front, as boxes.
struct BoxOrder {
    // [n]: the level of each node.
    Array<const uint8_t, 1> levels;
    // [n, 3]: the nodes (x, y, z), in units of their width.
    Sized<const int32_t, 2, 3> cells;
    // The eye (x, y, z), in voxel indices; infinite in parallel projections.
    double eye[3];
    // Voxels of the volume (x, y, z).
    int64_t shape[3];
    // [n]: the numbers of the nodes, sorted.
    Array<uint32_t, 1> order;
};
KERNEL(box_order, BoxOrder)
