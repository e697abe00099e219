// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "base/kernels.h"

// The region that clip planes and boxes leave: the points p of a volume in all slabs and in no removed box.
//
// A slab is [8]: a normal n [3], the lower and the upper bound of n . p, and n as a unit vector [3] in the world. The
// product n . p is a length, with p in index space relative to the volume's centre.
struct ClipRegion {
    // [k, 8]: the slabs of clip planes, which are unbounded on one side.
    Sized<const double, 2, 8> slabs;
    // [m, 3, 8]: for each removed box, the slabs across its axes.
    Sized<const double, 3, 3, 8> boxes;
};

// The rays of a view in the index space of a volume.
//
// With (x, y) the position of a pixel's centre in pixels, y downwards, relative to `center_px`:
//
//     origin = origins @ (1, x, y)        direction = directions @ (1, x, y)
struct RaySetup {
    // [3, 3]: the matrix from (1, x, y) to the origin of a ray, in index space relative to the volume's centre.
    double origins[9];
    // [3, 3]: the matrix from (1, x, y) to directions of rays, in index units per model unit (half the largest volume's
    // diagonal): per unit of depth in perspective, and of length otherwise.
    double directions[9];
    // The slope of a ray per pixel of distance from the optical axis: at (x, y), a ray's length per unit of depth is
    // `sqrt(1 + slope_per_px^2 (x^2 + y^2))`.
    double slope_per_px;
    // The distance from the origin at which rays start, on the near plane, in model units (half the largest volume's
    // diagonal) along the direction.
    double start;
    // The position (x, y) of the optical axis in the image, in pixels.
    double center_px[2];
    // The region that clipping leaves; None if the view clips nothing.
    Maybe<ClipRegion> clip;
};

// A view of a model: where the eye is, and how points are projected to pixels. Lengths are in model units (half the
// volume's diagonal).
struct ModelView {
    // [3, 4]: the rotation and translation from the model to the view, in model units (half the volume's diagonal).
    double view_from_model[12];
    // Whether the projection is in perspective; orthographic otherwise.
    bool perspective;
    // The focal length in pixels in perspective; otherwise the number of pixels in a model unit (half the volume's
    // diagonal).
    double scale_px;
    // The image's width and height, in pixels.
    int64_t size[2];
    // The position (x, y) of the optical axis in the image, in pixels.
    double center_px[2];
    // The depth of the near plane, in model units (half the volume's diagonal); nothing nearer to the eye is drawn.
    double near;
    // The largest slopes |x| / depth and |y| / depth, across and down the image. The footprint of a splat with a larger
    // slope is linearised as one with these slopes.
    double slope_limit[2];
};

// Find, for each brick, the rectangle of the image in which its bounds lie.
struct ProjectBounds {
    // [n, 2, 3]: the lowest and the highest corner of each brick, relative to the volume's centre, in model units (half
    // the volume's diagonal).
    Sized<const double, 3, 2, 3> bounds;
    ModelView camera;
    // The number of pixels by which rectangles may extend beyond the image; they are clipped there.
    int64_t beyond;
    // [n, 4]: the left, top, right and bottom edge of each brick's rectangle, in pixels.
    Sized<double, 2, 4> rectangles;
};
KERNEL(project_bounds, ProjectBounds)

// Find the splats that are visible in a view, and their depths.
struct CullSplats {
    // [n, 8]: the vertices of the splats, as in SplatBatch (renderer/splats/splats.py).
    Sized<const float, 2, 8> vertices;
    // [shapes]: the largest standard deviation of a splat of each shape, in model units (half the volume's diagonal).
    Array<const double, 1> sigmas;
    // The radius at which the footprint of a splat ends, in standard deviations.
    double cutoff;
    // The smallest standard deviation of a footprint, in pixels; smaller footprints are widened.
    double min_sigma_px;
    // A splat counts as cut by the near plane if its centre, seen from the eye, is less than this many standard
    // deviations behind the plane.
    double clipped_sigmas;
    // A splat is not drawn if its centre, seen from the eye, is at least this many standard deviations before the near
    // plane.
    double culled_sigmas;
    ModelView camera;
    // The unit vector in the world along which depths are measured.
    double along[3];
    // [n]: the depths of the splats' centres, relative to the volume's centre.
    Array<float, 1> depths;
    // [n]: whether the footprint of each splat may meet the image.
    Array<bool, 1> is_visible;
};
KERNEL(cull_splats, CullSplats)

// Sort the indices of depths: by descending depth, and equal depths by ascending index.
struct DepthOrder {
    // [n]: the depths that are sorted, none of them NaN.
    Array<const float, 1> depths;
    // [n]: the indices of the depths, from the largest depth to the smallest.
    Array<uint32_t, 1> order;
};
KERNEL(depth_order, DepthOrder)

// Sort nodes of the octree back to front, as boxes.
struct BoxOrder {
    // [n]: the octree level of each node.
    Array<const uint8_t, 1> levels;
    // [n, 3]: the place (x, y, z) of each node, in widths of the node.
    Sized<const int32_t, 2, 3> cells;
    // The eye (x, y, z), in voxel indices; infinitely far in parallel projections.
    double eye[3];
    // The number of voxels of the volume along x, y, z.
    int64_t shape[3];
    // [n]: the indices of the nodes, from back to front.
    Array<uint32_t, 1> order;
};
KERNEL(box_order, BoxOrder)
