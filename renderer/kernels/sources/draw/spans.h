// The tiles of a pixel grid, and spans: the parts of the rays of a tile that are inside a brick.
#pragma once
#include "pyramid/brick_layout.h"
#include "draw/rays.h"

// The position of a brick's lowest corner, in texels from the centre of texel 0.
constexpr double TEXEL_OFFSET = HALO - 0.5;
// The lowest position of a sample in a brick, in texels: a quarter of a texel outside of the brick. Samples are clamped to
// it because, in extremely wide views, rounding may move a ray out of the texels of its brick.
constexpr double MIN_TEXEL = -0.25 + TEXEL_OFFSET;
// The highest position of a sample in a brick, in texels: a quarter of a texel outside of the brick.
constexpr double MAX_TEXEL = BRICK_SIZE + 0.25 + TEXEL_OFFSET;
// The place in a span of the number by which spans are sorted, which is the last one.
constexpr int LAST = 7;

// The box of a brick, as in BrickView (renderer/draw/bricks/brick_cache.py). Positions are in voxels from the volume's
// centre.
struct Box {
    // The lowest corner of the visible bounds.
    double low[3];
    // The highest corner of the visible bounds.
    double high[3];
    // The lowest corner of the brick's first cell.
    double corner[3];
    // The number of cells along the side of a voxel.
    double scale;
    // The length of a step, in cells.
    double step;
};

INLINE Box box_of(const Array<const double, 2>& boxes, int64_t brick) {
    Box box;
    __builtin_memcpy(&box, boxes[brick].data, sizeof box);
    return box;
}

// Return the number of tiles of a grid along an axis: 0 for rows, 1 for columns.
INLINE int64_t tiles_along(const Grid& grid, int axis) {
    return (grid.shape[axis] * grid.rays_across + grid.side - 1) / grid.side;
}

// Return whether the shapes of a grid's arrays fit together, `tiles` are numbers of tiles, and each brick over them is one
// that can be drawn. Only bricks over these tiles are looked at: there may be far more others.
template <class CanBeDrawn>
inline bool is_consistent(const Grid& grid, const Array<const int64_t, 1>& tiles, CanBeDrawn can_be_drawn) {
    const auto& [side, stride, rays_across, is_scattered, first_row, shape, rectangles, starts, numbers, places, rays] = grid;
    if (side < 1 || stride < 1 || rays_across < 1 || side % rays_across != 0 || shape[0] < 1 || shape[1] < 1) return false;
    if (places.exists && (places.value.shape[0] != shape[0] || places.value.shape[1] != shape[1])) return false;
    if (!places.exists && (rays_across > 1 || rays.shape[0] != shape[0] * shape[1])) return false;
    int64_t num_tiles = tiles_along(grid, 0) * tiles_along(grid, 1);
    if (starts.shape[0] != num_tiles + 1) return false;
    for (int64_t k = 0; k < tiles.shape[0]; k++) {
        if (tiles[k] < 0 || tiles[k] >= num_tiles) return false;
        int64_t begin = starts[tiles[k]], end = starts[tiles[k] + 1];
        if (begin < 0 || end > numbers.shape[0]) return false;
        for (int64_t at = begin; at < end; at++)
            if (numbers[at] < 0 || numbers[at] >= rectangles.shape[0] || !can_be_drawn(numbers[at])) return false;
    }
    return true;
}

// Return the rays of a tile.
INLINE Window window_of(const Grid& grid, int64_t number) {
    int64_t side = grid.side, in_row = tiles_along(grid, 1);
    int64_t top = number / in_row * side, left = number % in_row * side;
    return {left, top, least(left + side, grid.shape[1] * grid.rays_across),
            least(top + side, grid.shape[0] * grid.rays_across)};
}

// Return the rays of a tile that a brick may cover, in rows and columns from the tile's first ray.
INLINE Window covered_by(const Grid& grid, int64_t brick, Window tile) {
    auto rectangle = grid.rectangles[brick];
    return {most(tile.left, rectangle[0]) - tile.left, most(tile.top, rectangle[1]) - tile.top,
            least(tile.right, rectangle[2]) - tile.left, least(tile.bottom, rectangle[3]) - tile.top};
}

// Set `first` to the position of the first sample along an axis, in texels of the brick, and `step` to the way to the next
// sample. begin, end: the positions of the first and the last sample along the ray. per_interval: 1 / the number of
// intervals between samples. corner, scale: of the brick's Box.
INLINE void first_and_step(const Along& ray, Doubles begin, Doubles end, Doubles per_interval, double corner,
                           double scale, ClippedFloats& first, ClippedFloats& step) {
    auto texel_at = [&](Doubles way) {  // clamped to the positions of texels of the brick; NaN becomes the lowest one
        Doubles texel = (ray.origin + way * ray.direction - corner) * scale + TEXEL_OFFSET;
        return min_of(max_of(in_all<Doubles>(MIN_TEXEL), texel), in_all<Doubles>(MAX_TEXEL));
    };
    Doubles one = texel_at(begin), other = texel_at(end);
    first = __builtin_convertvector(one, ClippedFloats);
    step = __builtin_convertvector((other - one) * per_interval, ClippedFloats);
}

// The SPAN_FLOATS numbers of a span, one span in each lane.
struct Span {
    // The first four numbers.
    Four<ClippedFloats> low;
    // The last four numbers.
    Four<ClippedFloats> high;
};

// Append a span for each ray of `hit` to the `num` spans of a tile, and return the new number of spans. There must be room
// for one span more.
template <int... LANE>
INLINE int64_t append(const Tile& tile, int64_t num, ClippedMask hit, int64_t pixel, const Span& span, Lanes<LANE...>) {
    const auto& [low, high] = span;
    auto low_rows = transpose(low.a, low.b, low.c, low.d), high_rows = transpose(high.a, high.b, high.c, high.d);
    auto append_lane = [&]<int NUMBER>() {
        tile.pixels[num] = (int32_t)pixel + NUMBER;
        store(tile.spans, SPAN_FLOATS * num, join(row_of<NUMBER>(low_rows), row_of<NUMBER>(high_rows)));
        num += hit[NUMBER];
    };
    (append_lane.template operator()<LANE>(), ...);
    return num;
}

// Sort spans by their last numbers, such as numbers of samples, so that spans that are marched in step end together.
inline void sort_spans(const Tile& tile, int64_t num) {
    const Array<int64_t, 1> starts = tile.counts;
    const Array<int32_t, 1> order = tile.order;
    if (num <= LANES) {
        for (int32_t k = 0; k < num; k++) order[k] = k;
        return;
    }
    auto last = [spans = (Array<float, 1>)tile.spans](int64_t k) { return (int64_t)spans[SPAN_FLOATS * k + LAST]; };
    int64_t largest = 0;
    for (int64_t k = 0; k < num; k++) largest = most(largest, last(k));
    for (int64_t count = 0; count < largest + 2; count++) starts[count] = 0;
    for (int64_t k = 0; k < num; k++) starts[last(k) + 1]++;
    for (int64_t count = 1; count <= largest; count++) starts[count] += starts[count - 1];
    for (int32_t k = 0; k < num; k++) order[starts[last(k)]++] = k;
}

// The rays of a tile that a brick may cover, as pieces of the list of the tile's rays.
struct Segments {
    // The number of segments.
    int64_t num;
    // The first ray of the first segment.
    int64_t first;
    // The distance from one segment to the next, in rays.
    int64_t step;
    // The number of rays of a segment.
    int64_t length;
};

// Return the rays of a tile that a brick may cover. If all rays of the tile are drawn, one for each pixel, they are listed
// row by row, and each row is a segment; otherwise all rays of the rows that the brick covers are one segment. covered: the
// window of the brick in the tile. num: the number of rays of the tile.
INLINE Segments segments_of(const Grid& grid, Window covered, Window window, const Tile& tile, int64_t num) {
    int64_t width = window.right - window.left, height = window.bottom - window.top, across = grid.rays_across;
    if (num == width * height && across == 1)
        return {most<int64_t>(covered.bottom - covered.top, 0), covered.top * width + covered.left, width,
                covered.right - covered.left};
    if (covered.bottom <= covered.top || covered.right <= covered.left) return {0, 0, 0, 0};
    int64_t begin = tile.row_starts[covered.top / across], end = tile.row_starts[(covered.bottom + across - 1) / across];
    return {1, begin, 0, end - begin};
}

// Find the spans inside a brick of the rays that go on, sort them, and call `draw` with their number. If boxes clip rays, a
// span ends where a box begins; the parts behind the boxes are the spans of further calls.
//
// goes_on: returns which rays go on, from the numbers in `found` of the tile. span_of: makes a span from the range in which
// a ray is inside the brick.
template <class GoesOn, class SpanOf, class Draw>
INLINE void for_spans(const Box& box, const RaySetup& rays, Segments segments, const Tile& tile, GoesOn goes_on,
                      SpanOf span_of, Draw draw) {
    for (bool has_more = true; has_more;) {
        int64_t num = 0;
        has_more = false;
        for (int64_t row = 0; row < segments.num; row++) {
            for (int64_t column = 0; column < segments.length; column += CLIPPED) {
                int64_t pixel = segments.first + row * segments.step + column;
                ClippedMask hit = mask_of(lane_numbers<ClippedInts>() < (int32_t)(segments.length - column));
                hit &= goes_on(load<ClippedFloats>(tile.found, pixel));
                if (!any_of(hit)) continue;
                const Along along[] = {ray_along(tile, pixel, 0), ray_along(tile, pixel, 1), ray_along(tile, pixel, 2)};
                Range range = {in_all<Doubles>(rays.start), in_all<Doubles>(INFINITE)};
                for (int axis = 0; axis < 3; axis++)
                    range = clip_slab(range, along[axis].origin, along[axis].inverse, box.low[axis], box.high[axis]);
                if (rays.clip.exists) {
                    ClippedMask have_more;
                    range = take_part(tile, range, hit, pixel, have_more);
                    has_more |= any_of(have_more);
                }
                hit &= mask_of(range.leave > range.enter);
                if (!any_of(hit)) continue;
                num = append(tile, num, hit, pixel, span_of(along, range, hit, pixel), UpTo<CLIPPED>());
            }
        }
        if (num == 0) continue;
        sort_spans(tile, num);
        draw(num);
    }
}
