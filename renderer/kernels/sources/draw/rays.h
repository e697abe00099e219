// Set up the rays of a tile in a grid of voxels, and find the parts of rays that clipping leaves.
#pragma once
#include "draw/kernels.h"
#include "base/lanes.h"

// The number of rays that are clipped at once, in vectors of float64.
constexpr int CLIPPED = 8;
using Doubles = Vector<double, CLIPPED>;
using ClippedInts = Vector<int32_t, CLIPPED>;
using ClippedFloats = Vector<float, CLIPPED>;
using ClippedMask = Vector<bool, CLIPPED>;

// The number of floats of a span, the part of a ray inside a brick.
constexpr int SPAN_FLOATS = 8;
// Along a span of n segments, the numbers of segments of two neighbouring pixels differ by up to this share of n, and by
// one. In five scans, the largest error of a mean over 8 x 8 pixels is then 0.35 to 0.7 of the error with one number for
// all pixels; with 0.1 it is 0.5 to 0.75, with 0.3 no less. It takes 3 to 5 % more time, because lanes of the processor wait
// for each other.
constexpr double DITHER = 0.15;
// The change of a pixel's jitter from one column to the next and from one row to the next, in units of 2^-32: the inverse
// of the plastic number, and the square of this inverse.
constexpr uint32_t JITTER_PER_PX[2] = {3242174889, 2447445414};
// The change of a scattered ray's x in its pixel from one column to the next and from one row to the next, in units of
// 2^-32 pixels: the fractions of the square roots of 2 and 3.
constexpr uint32_t SCATTER_ALONG_X[2] = {1779033703, 3144134277};
// The change of a scattered ray's y in its pixel from one column to the next and from one row to the next, in units of
// 2^-32 pixels: the fractions of the square roots of 5 and 7.
constexpr uint32_t SCATTER_ALONG_Y[2] = {1013904243, 2773480762};

// The places of the numbers of a ray among its RAY_FLOATS numbers.
enum {
    // The origin in index space [3].
    ORIGIN = 0,
    // The direction in index space [3].
    DIRECTION = 3,
    // 1 / direction [3], and 0 where the direction is 0.
    INVERSE = 6,
    // The length of the direction, dithered by DITHER.
    LENGTH = 9,
    // 1/2 plus the jitter: the number that is added before a number of samples is rounded down.
    ROUNDING_OFFSET = 10,
    // The length of the ray for a depth of 1.
    LENGTH_PER_DEPTH = 11,
    // The number of numbers of a ray.
    RAY_FLOATS = 12,
};
// The alpha, or number, of a place without a ray in `found` of a tile: nothing is drawn there.
constexpr float NEVER = __builtin_inff();

// A rectangle of rays in a grid, without the column `right` and the row `bottom`.
struct Window {
    int64_t left, top, right, bottom;
};

// Memory for the rays of a tile, which tiles use one after the other, and for their spans: the parts inside a brick.
//
// Clipping leaves a ray from a start to an end, less a range for each removed box.
struct Tile {
    // The side of a tile, in rays.
    int64_t side;
    // The number of rays of a tile, and of the lanes that may be loaded behind the last ray.
    int64_t room;
    // The number of boxes that clip the volume.
    int64_t num_boxes;
    // [RAY_FLOATS, room]: the numbers of rays.
    Buffer<double> rays;
    // [2, room]: the starts of rays, then their ends; a start moves on as the parts of its ray are drawn.
    Buffer<double> bounds;
    // [boxes, 2, room]: where rays enter each removed box, and leave it; infinity and -infinity for a ray that misses it.
    Buffer<double> removed;
    // [room]: the alpha of each ray before the next brick, or the largest number of a search.
    Buffer<float> found;
    // [room, SPAN_FLOATS]: the spans.
    Buffer<float> spans;
    // [room]: the position of each ray's RGBA in the image.
    Buffer<int64_t> places;
    // Memory for sorting spans by a number that is at most `largest`.
    Buffer<int64_t> counts;
    // The first ray of each row of pixels.
    Buffer<int64_t> row_starts;
    // [room]: the ray of each span.
    Buffer<int32_t> pixels;
    // [room]: the numbers of spans, spans with few samples first.
    Buffer<int32_t> order;
    // [room]: the row of each ray in the grid.
    Buffer<int32_t> rows;
    // [room]: the column of each ray in the grid.
    Buffer<int32_t> columns;

    Tile(const Grid& grid, const RaySetup& setup, int64_t largest)
        : side(grid.side), room(side * side + most(LANES, CLIPPED)),
          num_boxes(setup.clip.exists ? setup.clip.value.boxes.shape[0] : 0), rays(RAY_FLOATS * room),
          bounds(2 * room), removed(2 * num_boxes * room), found(room), spans(SPAN_FLOATS * room), places(room),
          counts(largest + 2), row_starts(side + 1), pixels(room), order(room),
          rows(room), columns(room) {}

    explicit operator bool() const {
        return rays && bounds && removed && found && spans && places && counts && row_starts && pixels && order && rows &&
            columns;
    }
};

// The origins, the directions and the inverses of the directions of rays along one axis.
struct Along {
    Doubles origin, direction, inverse;
};

// The positions along rays, one ray in each lane, at which they enter and leave a set of points.
template <class V>
struct RangeOf {
    V enter, leave;
};
using Range = RangeOf<Doubles>;

INLINE Along ray_along(const Tile& tile, int64_t pixel, int axis) {
    return {
        load<Doubles>(tile.rays, pixel + (ORIGIN + axis) * tile.room),
        load<Doubles>(tile.rays, pixel + (DIRECTION + axis) * tile.room),
        load<Doubles>(tile.rays, pixel + (INVERSE + axis) * tile.room),
    };
}

// Return the jitter of pixels, from 0 to 1, as in renderer/bricks/sampling.py.
INLINE Doubles jitter_of(ClippedInts column, ClippedInts row) {
    ClippedInts whole = column * (int32_t)JITTER_PER_PX[0] + row * (int32_t)JITTER_PER_PX[1];
    return __builtin_convertvector(whole >> 8 & 0xFFFFFF, Doubles) / 16777216.0;
}

// The heights of rays along the normal of a slab, the space between two parallel planes.
template <class V>
struct Heights {
    // The heights of the origins.
    V origin;
    // The change of height along the direction.
    V speed;
};

// Clip rays to the space between two parallel planes; a ray that lies in a plane belongs to the space above it.
template <class V>
INLINE RangeOf<V> clip_slab(RangeOf<V> range, V origin, V inverse, double lowest, double highest) {
    using Number = __remove_cvref(decltype(origin[0]));
    const Number low = (Number)lowest, high = (Number)highest;
    V one = (low - origin) * inverse, other = (high - origin) * inverse;
    V near = max_of(range.enter, min_of(one, other)), far = min_of(range.leave, max_of(one, other));
    auto is_parallel = mask_of(inverse == (Number)0), is_inside = mask_of(origin >= low) & mask_of(origin < high);
    return {where(is_parallel, range.enter, near),
            where(is_parallel, where(is_inside, range.leave, in_all<V>(-INFINITE)), far)};
}

// Clip rays to the intersection of slabs [k, 8], as in ClipRegion. heights_of: returns the Heights of rays for a slab.
template <class V, class HeightsOf>
INLINE RangeOf<V> clip_slabs(const Array<const double, 2>& slabs, RangeOf<V> range, HeightsOf heights_of) {
    for (int64_t k = 0; k < slabs.shape[0]; k++) {
        auto slab = slabs[k];
        auto [origin, speed] = heights_of(slab);
        V zero = in_all<V>(0), inverse = where(mask_of(speed == zero), zero, 1 / speed);
        range = clip_slab(range, origin, inverse, slab[3], slab[4]);
    }
    return range;
}

// Return where rays enter and leave a box; infinity and -infinity for a ray that misses it. slabs: the three slabs whose
// intersection is the box. heights_of: returns the Heights of rays for a slab.
template <class V, class HeightsOf>
INLINE RangeOf<V> cross_box(const Array<const double, 2>& slabs, HeightsOf heights_of) {
    V never = in_all<V>(INFINITE);
    auto [enter, leave] = clip_slabs(slabs, RangeOf<V>{-never, never}, heights_of);
    auto is_hit = mask_of(enter < leave);
    return {where(is_hit, enter, never), where(is_hit, leave, -never)};
}

// Return the first part of a range that is in none of the removed boxes; it is empty if nothing remains. removed: returns
// where rays enter and leave a box, as `cross_box`.
template <class V, class Removed>
INLINE RangeOf<V> first_part(RangeOf<V> range, int64_t num_boxes, Removed removed) {
    for (int64_t again = 0; again < num_boxes; again++) {  // again, because another box may begin where one ends
        for (int64_t box = 0; box < num_boxes; box++) {
            auto [enter, leave] = removed(box);
            range.enter = where(mask_of(enter <= range.enter) & mask_of(range.enter < leave), leave, range.enter);
        }
    }
    RangeOf<V> part = range;
    for (int64_t box = 0; box < num_boxes; box++) {
        V enter = removed(box).enter;
        part.leave = where(mask_of(enter > part.enter) & mask_of(enter < part.leave), enter, part.leave);
    }
    return part;
}

// Find the parts of CLIPPED rays that clipping leaves. start: the position along rays where they begin. pixel: the first
// ray.
INLINE void clip_rays(const ClipRegion& clip, double start, const Tile& tile, int64_t pixel) {
    Along x = ray_along(tile, pixel, 0), y = ray_along(tile, pixel, 1), z = ray_along(tile, pixel, 2);
    auto heights_of = [&](const auto& slab) {
        return Heights<Doubles>{slab[0] * x.origin + slab[1] * y.origin + slab[2] * z.origin,
                                slab[0] * x.direction + slab[1] * y.direction + slab[2] * z.direction};
    };
    Range range = clip_slabs(clip.slabs, Range{in_all<Doubles>(start), in_all<Doubles>(INFINITE)}, heights_of);
    store(tile.bounds, pixel, range.enter);
    store(tile.bounds, pixel + tile.room, range.leave);
    for (int64_t box = 0; box < tile.num_boxes; box++) {
        range = cross_box<Doubles>(clip.boxes[box], heights_of);
        store(tile.removed, pixel + 2 * box * tile.room, range.enter);
        store(tile.removed, pixel + (2 * box + 1) * tile.room, range.leave);
    }
}

// Return the position of scattered rays in their pixels, along one axis: from -1/2 to 1/2 pixels from the middle.
template <class V, class Ints>
INLINE V scatter_of(Ints column, Ints row, const uint32_t (&per_px)[2]) {
    Ints whole = column * (int32_t)per_px[0] + row * (int32_t)per_px[1];
    return __builtin_convertvector(whole >> 8 & 0xFFFFFF, V) / 16777216.0 - 0.5;
}

// Positions of rays in the picture, in pixels.
template <class V>
struct Position {
    V x, y;
};

// Return the positions in the picture of the rays in rows and columns of a grid.
//
// The rays of a pixel are a small grid with sheared rows and columns, so that no two rays have the same x or y: as an edge
// along an axis moves through the pixel, it passes the rays one by one.
template <class V, class Ints>
INLINE Position<V> position_px(const Grid& grid, Ints column, Ints row) {
    double per_ray = 1.0 / (double)grid.rays_across, step = (double)grid.stride * per_ray;
    int32_t across = (int32_t)grid.rays_across;
    auto shift = [&](Ints along) { return (__builtin_convertvector(along % across, V) + 0.5) * per_ray - 0.5; };
    V x = __builtin_convertvector(column, V) * step + 0.5 * per_ray + per_ray * shift(row);
    V y = __builtin_convertvector(row, V) * step + 0.5 * per_ray - per_ray * shift(column);
    if (grid.is_scattered)
        x += scatter_of<V>(column, row, SCATTER_ALONG_X), y += scatter_of<V>(column, row, SCATTER_ALONG_Y);
    return {x, y};
}

// Return the index of a pixel's first ray among the rays of a grid, below 0 if the pixel is not drawn.
INLINE int64_t place_of_pixel(const Grid& grid, int64_t row, int64_t column) {
    return grid.places.exists ? grid.places.value(row, column) : row * grid.shape[1] + column;
}

// Return the index of a ray among the rays of a grid by its row and column, below 0 if it is not drawn.
INLINE int64_t place_of(const Grid& grid, int64_t row, int64_t column) {
    int64_t across = grid.rays_across, first = place_of_pixel(grid, row / across, column / across);
    return first < 0 ? first : first + row % across * across + column % across;
}

// List the rays of a window that are drawn, pixel by pixel, with the numbers that one of their channels has in the image.
// Return the number of rays.
INLINE int64_t list_rays(const Grid& grid, Window window, const Tile& tile, int channel) {
    int64_t across = grid.rays_across, num = 0;
    for (int64_t row = window.top / across; row * across < window.bottom; row++) {
        tile.row_starts[row - window.top / across] = num;
        for (int64_t column = window.left / across; column * across < window.right; column++) {
            int64_t first = place_of_pixel(grid, row, column);
            if (first < 0) continue;
            for (int64_t ray = 0; ray < across * across; ray++, num++) {
                tile.rows[num] = (int32_t)((row + grid.first_row) * across + ray / across);
                tile.columns[num] = (int32_t)(column * across + ray % across);
                tile.places[num] = 4 * (first + ray);
                tile.found[num] = grid.rays(first + ray, channel);
            }
        }
    }
    tile.row_starts[(window.bottom - window.top) / across] = num;
    for (int64_t k = num; k < num + CLIPPED; k++) tile.rows[k] = tile.columns[k] = 0, tile.found[k] = NEVER;
    return num;
}

// Set up the rays of a window that are drawn. channel: the channel of the image for `found`. Return the number of rays.
INLINE int64_t set_up_rays(const Grid& grid, const RaySetup& rays, Window window, const Tile& tile, int channel) {
    int32_t stride = (int32_t)grid.stride;
    int64_t num = list_rays(grid, window, tile, channel);
    for (int64_t begin = 0; begin < num; begin += CLIPPED) {
        ClippedInts column = load<ClippedInts>(tile.columns, begin), row = load<ClippedInts>(tile.rows, begin);
        auto [x, y] = position_px<Doubles>(grid, column, row);
        x -= rays.center_px[0], y -= rays.center_px[1];
        Doubles square = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            const double *origin = rays.origins + 3 * axis, *direction = rays.directions + 3 * axis;
            Doubles speed = direction[0] + direction[1] * x + direction[2] * y;
            store(tile.rays, begin + (ORIGIN + axis) * tile.room, origin[0] + origin[1] * x + origin[2] * y);
            store(tile.rays, begin + (DIRECTION + axis) * tile.room, speed);
            store(tile.rays, begin + (INVERSE + axis) * tile.room,
                  where(mask_of(speed == 0.0), in_all<Doubles>(0.0), 1.0 / speed));
            square += speed * speed;
        }
        Doubles jitter = jitter_of(column * stride, row * stride);
        store(tile.rays, begin + LENGTH * tile.room, root(square) * (1.0 + DITHER * (jitter - 0.5)));
        store(tile.rays, begin + ROUNDING_OFFSET * tile.room, 0.5 + jitter);
        square = rays.slope_per_px * rays.slope_per_px * (x * x + y * y);
        store(tile.rays, begin + LENGTH_PER_DEPTH * tile.room, root(1.0 + square));
        if (rays.clip.exists) clip_rays(rays.clip.value, rays.start, tile, begin);
    }
    return num;
}

// Take the next part of rays that clipping leaves inside a brick; it is empty if nothing remains. range: where rays enter
// and leave the brick. has_more: set to whether a ray of `hit` has another part behind this one.
INLINE Range take_part(const Tile& tile, Range range, ClippedMask hit, int64_t pixel, ClippedMask& has_more) {
    Doubles start = load<Doubles>(tile.bounds, pixel), end = load<Doubles>(tile.bounds, pixel + tile.room);
    range = {max_of(range.enter, start), min_of(range.leave, end)};
    Range part = first_part(range, tile.num_boxes, [&](int64_t box) {
        int64_t place = pixel + 2 * box * tile.room;
        return Range{load<Doubles>(tile.removed, place), load<Doubles>(tile.removed, place + tile.room)};
    });
    hit &= mask_of(part.leave > part.enter);
    store(tile.bounds, pixel, where(hit, part.leave, start));
    has_more = hit & mask_of(part.leave < range.leave);
    return part;
}
