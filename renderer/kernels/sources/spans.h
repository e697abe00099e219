// The tiles of a pixel grid, and spans: the parts of the rays of a tile that are inside a brick.
#pragma once
#include "rays.h"

constexpr int BRICK_SIZE = 16, HALO = 1, PADDED_BRICK_SIZE = BRICK_SIZE + 2 * HALO;
// From cells of a brick to the index of the texel at or below.
constexpr double TEXEL_OFFSET = HALO - 0.5;
// Where samples are: as MIN_SAMPLE_CELL and MAX_SAMPLE_CELL in renderer/draw/constants.py.
constexpr double MIN_TEXEL = -0.25 + TEXEL_OFFSET, MAX_TEXEL = BRICK_SIZE + 0.25 + TEXEL_OFFSET;
// The last number of a span, by which spans are sorted.
constexpr int SPAN_FLOATS = 8, LAST = 7;

// rows: of each span SPAN_FLOATS numbers. order: the numbers of spans, those with few samples first. starts: for sorting.
struct Spans {
    Array<float, 1> rows;
    Array<int32_t, 1> pixels, order;
    Array<int64_t, 1> starts;
};

// A box as in BrickView.
struct Box {
    double low[3], high[3], corner[3], scale, step;
};

INLINE Box box_of(const Grid& grid, int64_t brick) {
    Box box;
    __builtin_memcpy(&box, grid.boxes[brick].data, sizeof box);
    return box;
}

INLINE int64_t tiles_along(const Grid& grid, int axis) {
    return (grid.is_drawn.shape[axis] + grid.bins.side - 1) / grid.bins.side;
}

// Whether shapes fit together, and all numbers are of tiles and of bricks.
static bool is_consistent(const Grid& grid, const Array<const int64_t, 1>& tiles) {
    const auto& [bins, stride, rays, boxes, texel_offsets, is_drawn, image] = grid;
    if (bins.side < 1 || stride < 1 || boxes.shape[1] != sizeof(Box) / sizeof(double)) return false;
    if (bins.rectangles.shape[0] != boxes.shape[0] || bins.rectangles.shape[1] != 4) return false;
    if (texel_offsets.shape[0] != boxes.shape[0] || image.shape[2] != 4) return false;
    if (image.shape[0] != is_drawn.shape[0] || image.shape[1] != is_drawn.shape[1]) return false;
    const Cuts& cuts = rays.cuts.value;
    if (rays.cuts.exists && (cuts.slabs.shape[1] != 5 || cuts.boxes.shape[1] != 3 || cuts.boxes.shape[2] != 5))
        return false;
    int64_t num_tiles = tiles_along(grid, 0) * tiles_along(grid, 1);
    if (bins.starts.shape[0] != num_tiles + 1) return false;
    for (int64_t k = 0; k < tiles.shape[0]; k++) {
        if (tiles[k] < 0 || tiles[k] >= num_tiles) return false;
        int64_t begin = bins.starts[tiles[k]], end = bins.starts[tiles[k] + 1];
        if (begin < 0 || end > bins.numbers.shape[0]) return false;
        for (int64_t at = begin; at < end; at++)
            if (bins.numbers[at] < 0 || bins.numbers[at] >= boxes.shape[0]) return false;
    }
    return true;
}

// The memory for one tile after the other. largest: bound of the last number of spans.
struct TileMemory {
    int64_t side, room, num_boxes;
    Buffer<double> rays, bounds, removed;
    Buffer<float> alphas, rows;
    Buffer<int64_t> places, starts;
    Buffer<int32_t> pixels, order;

    TileMemory(const Grid& grid, int64_t largest)
        : side(grid.bins.side), room(side * side + most(LANES, CLIPPED)),
          num_boxes(grid.rays.cuts.exists ? grid.rays.cuts.value.boxes.shape[0] : 0), rays(RAY_FLOATS * room),
          bounds(2 * room), removed(2 * num_boxes * room), alphas(room), rows(SPAN_FLOATS * room), places(room),
          starts(largest + 2), pixels(room), order(room) {}

    explicit operator bool() const {
        return rays && bounds && removed && alphas && rows && places && starts && pixels && order;
    }
    Tile tile() const { return {side, room, rays, alphas, places}; }
    Kept kept() const { return {num_boxes, bounds, removed}; }
    Spans spans() const { return {rows, pixels, order, starts}; }
};

// The pixels of a tile.
INLINE Window window_of(const Grid& grid, int64_t number) {
    int64_t side = grid.bins.side, in_row = tiles_along(grid, 1);
    int64_t top = number / in_row * side, left = number % in_row * side;
    return {left, top, least(left + side, grid.is_drawn.shape[1]), least(top + side, grid.is_drawn.shape[0])};
}

// The pixels of a tile, counted from its first, that a brick may cover.
INLINE Window covered_by(const Grid& grid, int64_t brick, Window tile) {
    auto rectangle = grid.bins.rectangles[brick];
    return {most(tile.left, rectangle[0]) - tile.left, most(tile.top, rectangle[1]) - tile.top,
            least(tile.right, rectangle[2]) - tile.left, least(tile.bottom, rectangle[3]) - tile.top};
}

// Clip rays to a brick and, with CUTS, to the next part that is not cut away. False if none of them hits.
// is_whole: becomes false where there is more behind that part.
template <bool CUTS>
INLINE bool clip_to_brick(const Box& box, double start, const Kept& kept, const Tile& tile, int64_t pixel,
                          const Along (&along)[3], ClippedMask& hit, Range& range, bool& is_whole) {
    range = {in_all<Doubles>(start), in_all<Doubles>(INFINITE)};
    for (int axis = 0; axis < 3; axis++)
        range = clip_slab(range, along[axis].origin, along[axis].inverse, box.low[axis], box.high[axis]);
    if constexpr (CUTS) {
        ClippedMask has_more;
        range = take_part(kept, range, hit, tile.room, pixel, has_more);
        is_whole &= !any_of(has_more);
    }
    hit &= mask_of(range.leave > range.enter);
    return any_of(hit);
}

// The first sample along an axis, in texels of the brick, and the step to the next one. begin, end: where the first and
// the last sample are along the ray. per_interval: 1 / the number of intervals between samples.
INLINE void first_and_step(const Along& ray, Doubles begin, Doubles end, Doubles per_interval, double corner,
                           double scale, ClippedFloats& first, ClippedFloats& step) {
    auto texel_at = [&](Doubles way) {  // clamped to where a brick has texels; NaN becomes the lowest one
        Doubles texel = (ray.origin + way * ray.direction - corner) * scale + TEXEL_OFFSET;
        return min_of(max_of(in_all<Doubles>(MIN_TEXEL), texel), in_all<Doubles>(MAX_TEXEL));
    };
    Doubles one = texel_at(begin), other = texel_at(end);
    first = __builtin_convertvector(one, ClippedFloats);
    step = __builtin_convertvector((other - one) * per_interval, ClippedFloats);
}

// Append a span for each ray that hits, and return how many spans there are then; there is room for one more. The two
// Four have the numbers of a span.
template <int... LANE>
INLINE int64_t append(const Spans& spans, int64_t num, ClippedMask hit, int64_t pixel, const Four<ClippedFloats>& low,
                      const Four<ClippedFloats>& high, Lanes<LANE...>) {
    auto low_rows = transpose(low.a, low.b, low.c, low.d), high_rows = transpose(high.a, high.b, high.c, high.d);
    auto append_lane = [&]<int NUMBER>() {
        spans.pixels[num] = (int32_t)pixel + NUMBER;
        store(spans.rows, SPAN_FLOATS * num, join(row_of<NUMBER>(low_rows), row_of<NUMBER>(high_rows)));
        num += hit[NUMBER];
    };
    (append_lane.template operator()<LANE>(), ...);
    return num;
}

// Sort spans by their last numbers, so that those that are marched in step end together.
static void sort_spans(const Spans& spans, int64_t num) {
    const auto [rows, pixels, order, starts] = spans;
    if (num <= LANES) {
        for (int32_t k = 0; k < num; k++) order[k] = k;
        return;
    }
    auto last = [&](int64_t k) { return (int64_t)rows[SPAN_FLOATS * k + LAST]; };
    int64_t largest = 0;
    for (int64_t k = 0; k < num; k++) largest = most(largest, last(k));
    for (int64_t count = 0; count < largest + 2; count++) starts[count] = 0;
    for (int64_t k = 0; k < num; k++) starts[last(k) + 1]++;
    for (int64_t count = 1; count <= largest; count++) starts[count] += starts[count - 1];
    for (int32_t k = 0; k < num; k++) order[starts[last(k)]++] = k;
}
