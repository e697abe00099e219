// Find the most extreme scalar along rays through bricks: LANES rays in step, from cell to cell.
//
// Between eight voxels the field along a ray is a cubic polynomial, whose extremes are known: nothing falls between samples.
// Scalars are mapped to numbers whose maximum is sought. A pixel keeps the largest number so far; bricks and cells whose
// numbers are all smaller are passed over. Bricks with the largest upper bounds come first, and a tile ends when none of
// its remaining bricks can change it. If the extremum is coloured by its depth, bricks come front to back, and the first of
// equal maxima counts.
//
// If some of the eight voxels have no data, the way of a ray through the cell is divided at the points where another voxel
// becomes the nearest.
#include "draw/kernels.h"
#include "base/stopping.h"
#include "draw/atlas.h"
#include "draw/sample.h"
#include "draw/spans.h"

namespace {

// The most cells that a ray meets in a brick: it crosses at most 17 faces between cells along each axis, as it passes
// through the brick and half of its halo.
constexpr int MAX_CELLS = 3 * (PADDED_BRICK_SIZE - 1) + 1;
// The number of the last cell between texels along each axis of a brick.
constexpr int32_t LAST_CELL_OF_ROW = PADDED_BRICK_SIZE - 2;
// A ray that moves by less than this along an axis, in texels of a brick, counts as parallel to the faces of its cells.
constexpr float MIN_EXTENT = 1e-12;
// After this many bricks of a tile, the search looks whether the remaining bricks can change any of the tile's pixels.
constexpr int BRICKS_BETWEEN_LOOKS = 4;

// Return the smallest number that the pixels of a tile have found so far.
float least_found(int64_t num_rays, const Tile& tile) {
    float found = NEVER;
    for (int64_t ray = 0; ray < num_rays; ray++) found = least(found, tile.found[ray]);
    return found;
}

// Return the spans of rays inside a brick, one in each lane: where they begin [3] and their extents [3], in texels of the
// brick; 0; about how many cells they cross.
INLINE Span span_of(const Box& box, const Along (&along)[3], Range range, ClippedMask hit) {
    ClippedFloats begin[3], extent[3], zero = 0.0f;
    for (int axis = 0; axis < 3; axis++)
        first_and_step(along[axis], range.enter, range.leave, in_all<Doubles>(1.0), box.corner[axis], box.scale,
                       begin[axis], extent[axis]);
    ClippedFloats faces = magnitude(extent[0]) + magnitude(extent[1]) + magnitude(extent[2]);
    ClippedFloats num_cells = __builtin_convertvector(__builtin_convertvector(faces, ClippedInts), ClippedFloats);
    return {{begin[0], begin[1], begin[2], extent[0]}, {extent[1], extent[2], zero, where(hit, num_cells, zero)}};
}

// The largest number on the way of each ray through a cell, and its position, as a share of the way.
struct Largest {
    Floats number, share;
};

// Return a / b, clamped to [0, 1]; where b is 0, a clamped to [0, 1].
INLINE Floats quotient(Floats a, Floats b) {
    Floats zero = in_all<Floats>(0.0f), one = in_all<Floats>(1.0f);
    return min_of(max_of(a / where(mask_of(b == 0.0f), one, b), zero), one);
}

// Return the largest number on the way `entry + extent q` through a cell, with q in [0, 1], and its q.
//
// The trilinear field along the way is a + q (b + q (c + q d)). Its extremes are at the ends or where its slope is 0.
INLINE Largest largest_in_cell(const Corners& corners, const Three& entry, const Three& extent) {
    const auto& [c000, c100, c010, c110, c001, c101, c011, c111] = corners;
    const auto& [u, v, w] = entry;
    const auto& [du, dv, dw] = extent;
    Floats zero = in_all<Floats>(0.0f), one = in_all<Floats>(1.0f);
    Floats x00 = c100 - c000, x10 = c110 - c010, x01 = c101 - c001, x11 = c111 - c011;
    Floats y00 = fma(u, x00, c000), y10 = fma(u, x10, c010), y01 = fma(u, x01, c001), y11 = fma(u, x11, c011);
    Floats rise0 = y10 - y00, rise1 = y11 - y01, twist0 = x10 - x00, twist1 = x11 - x01;
    Floats z0 = fma(v, rise0, y00), z1 = fma(v, rise1, y01);
    Floats slope0 = fma(dv, rise0, du * fma(v, twist0, x00)), slope1 = fma(dv, rise1, du * fma(v, twist1, x01));
    Floats bend0 = du * dv * twist0, bend1 = du * dv * twist1;
    Floats a = fma(w, z1 - z0, z0);
    Floats b = fma(dw, z1 - z0, fma(w, slope1 - slope0, slope0));
    Floats c = fma(dw, slope1 - slope0, fma(w, bend1 - bend0, bend0));
    Floats d = dw * (bend1 - bend0);
    Floats end = a + (b + (c + d)), share = where(mask_of(end > a), one, zero), best = max_of(end, a);
    // b + 2 c q + 3 d q^2 = 0, without cancellation; any q in [0, 1] gives a number of the field.
    Floats triple = 3.0f * d, discriminant = root(max_of(fma(c, c, -(triple * b)), zero));
    Floats sum = -(c + where(mask_of(c < 0.0f), -discriminant, discriminant));
    const Floats turns[2] = {quotient(sum, triple), quotient(b, sum)};
    for (Floats q : turns) {
        Floats number = fma(q, fma(q, fma(q, d, c), b), a);
        share = where(mask_of(number > best), q, share), best = max_of(number, best);
    }
    return {best, share};
}

INLINE Mask is_flat(Floats extent) { return mask_of(magnitude(extent) < MIN_EXTENT); }

// Return where a ray passes the plane in the middle of a cell, as a share of its way through the cell; 0 or 1 if it passes
// the plane outside of the cell.
INLINE Floats middle(Floats entry, Floats extent) {
    Floats zero = in_all<Floats>(0.0f), one = in_all<Floats>(1.0f);
    Mask flat = is_flat(extent);
    return min_of(max_of(where(flat, zero, (0.5f - entry) / where(flat, one, extent)), zero), one);
}

// Return the largest number on the way through a cell at points whose nearest voxel has data; minus infinity if there is no
// such point. found: the result of `largest_in_cell`, which is kept if all eight voxels have data.
INLINE Largest largest_of_data(const Texels& texels, Ints at, const Corners& corners, const Three& entry,
                               const Three& extent, Largest found) {
    Mask is_whole = are_all_present(load_corners(texels, at));
    if (!any_of(~is_whole)) return found;
    Floats zero = in_all<Floats>(0.0f), one = in_all<Floats>(1.0f);
    Floats x = middle(entry.x, extent.x), y = middle(entry.y, extent.y), z = middle(entry.z, extent.z);
    Floats low = min_of(x, y), high = max_of(x, y);
    const Floats ends[5] = {zero, min_of(low, z), max_of(low, min_of(high, z)), max_of(high, z), one};
    Floats best = where(is_whole, found.number, in_all<Floats>(-NEVER));
    Floats place = where(is_whole, found.share, zero);
    auto along = [&](Floats share) -> Three {
        return {fma(share, extent.x, entry.x), fma(share, extent.y, entry.y), fma(share, extent.z, entry.z)};
    };
    for (int part = 0; part < 4; part++) {
        Floats begin = ends[part], width = ends[part + 1] - begin, half = (begin + ends[part + 1]) * 0.5f;
        Largest here =
            largest_in_cell(corners, along(begin), {width * extent.x, width * extent.y, width * extent.z});
        Mask counts = mask_of(width > 0.0f) & are_present(texels, at, along(half)) & ~is_whole;
        counts &= mask_of(here.number > best);
        best = where(counts, here.number, best);
        place = where(counts, fma(here.share, width, begin), place);
    }
    return {best, place};
}

// The way of rays along one axis of a brick.
struct Axis {
    // The texel at which the span of a ray begins, and the way to its end, in texels.
    Floats first, extent;
    // The cell in which a ray is now.
    Ints cell;

    INLINE Floats at(Floats share) const { return fma(share, extent, first); }
    INLINE Floats in_cell(Floats share) const { return at(share) - to_float32(cell); }
    INLINE void clamp() { cell = min_of(max_of(cell, in_all<Ints>(0)), in_all<Ints>(LAST_CELL_OF_ROW)); }

    // Return where rays leave their cells along this axis, as a share of the span; 2 if they never do.
    INLINE Floats leave() const {
        Floats one = in_all<Floats>(1.0f);
        Floats face = to_float32(cell) + where(mask_of(extent > 0.0f), one, in_all<Floats>(0.0f));
        Mask flat = is_flat(extent);
        return where(flat, in_all<Floats>(2.0f), (face - first) / where(flat, one, extent));
    }

    INLINE void move(Mask has_left) {
        Ints step = where(mask_of(extent > 0.0f), in_all<Ints>(1), in_all<Ints>(-1));
        cell = where(has_left, cell + step, cell);
    }
};

// Search the cells of spans for numbers larger than those that their pixels have found so far.
//
// texels: the texels of the brick, and those after them. num: the number of spans. nearness: the nearness to the eye of the
// brick's texel 0, from 0 to 1. pixels: the image.
void search_spans(const BrickTexels& texels, const SearchRules& rules, double nearness, int64_t num, const Tile& tile,
                  const Array<float, 1>& pixels) {
    const float offset = rules.offset, slope = rules.slope, slack = rules.slack, min_rise = rules.min_rise;
    const float ceiling = rules.ceiling;
    const double* forward = rules.forward;
    Floats zero = in_all<Floats>(0.0f);
    for (int64_t first = 0; first < num; first += LANES) {
        Ints order = load<Ints>(tile.order, first);
        auto [begin_x, begin_y, begin_z, extent_x] = load_four(tile.spans, order * SPAN_FLOATS);
        auto [extent_y, extent_z, unused, num_cells] = load_four(rest_of(tile.spans, 4), order * SPAN_FLOATS);
        Axis x = {begin_x, extent_x, to_int32(begin_x)}, y = {begin_y, extent_y, to_int32(begin_y)};
        Axis z = {begin_z, extent_z, to_int32(begin_z)};
        Floats best = gather(tile.found, gather(tile.pixels, order)), near = zero, t = zero;
        Mask active = mask_of(lane_numbers<Ints>() < (int32_t)least(num - first, (int64_t)LANES));
        for (int cells = 0; cells < MAX_CELLS; cells++) {
            x.clamp(), y.clamp(), z.clamp();
            Floats leave_x = x.leave(), leave_y = y.leave(), leave_z = z.leave();
            Floats out = min_of(min_of(leave_x, leave_y), min_of(leave_z, in_all<Floats>(1.0f)));
            const Cell cell = {x.cell, y.cell, z.cell};
            auto [a, b, c, d, e, f, g, h] = load_corners(texels, cell);
            auto turned = [&](Floats scalar) { return fma(scalar, in_all<Floats>(slope), in_all<Floats>(offset)); };
            Corners corners = {turned(a), turned(b), turned(c), turned(d), turned(e), turned(f), turned(g), turned(h)};
            Floats below = max_of(max_of(corners.a, corners.b), max_of(corners.c, corners.d));
            Floats above = max_of(max_of(corners.e, corners.f), max_of(corners.g, corners.h));
            Mask may_rise = active & mask_of(max_of(below, above) > best + slack);
            if (any_of(may_rise)) {
                Floats length = max_of(out - t, zero);
                Three entry = {x.in_cell(t), y.in_cell(t), z.in_cell(t)};
                Three extent = {length * x.extent, length * y.extent, length * z.extent};
                Largest largest = largest_in_cell(corners, entry, extent);
                if (rules.has_absent)
                    largest = largest_of_data(texels.words, cell.at(PADDED_BRICK_SIZE), corners, entry, extent, largest);
                Mask is_larger = may_rise & mask_of(largest.number > best + min_rise);
                best = where(is_larger, largest.number, best);
                Floats place = fma(largest.share, length, t);
                Floats here = fma(z.at(place), in_all<Floats>((float)forward[2]), in_all<Floats>((float)nearness));
                here = fma(y.at(place), in_all<Floats>((float)forward[1]), here);
                near = where(is_larger, fma(x.at(place), in_all<Floats>((float)forward[0]), here), near);
                active &= mask_of(best < ceiling);
            }
            active &= mask_of(out < 1.0f);
            if (!any_of(active)) break;
            x.move(mask_of(leave_x <= out)), y.move(mask_of(leave_y <= out)), z.move(mask_of(leave_z <= out));
            t = out;
        }
        for (int lane = 0; lane < least(num - first, (int64_t)LANES); lane++) {
            int32_t pixel = tile.pixels[tile.order[first + lane]];
            if (best[lane] > tile.found[pixel]) {
                float number = least(best[lane], ceiling);
                tile.found[pixel] = number;
                pixels[tile.places[pixel]] = number, pixels[tile.places[pixel] + 1] = near[lane];
            }
        }
    }
}

// Search the bricks over a tile. Return whether the search was finished, and not stopped.
//
// finder: finds the texels of bricks.
bool draw_tile(const DrawExtremes& search, const Tile& tile, TexelFinder& finder, int64_t number) {
    const Grid& grid = search.grid;
    const Array<float, 1> pixels = {grid.rays.data, {grid.rays.size()}};
    const double* forward = search.rules.forward;
    bool by_depth = forward[0] != 0.0 || forward[1] != 0.0 || forward[2] != 0.0;
    Window window = window_of(grid, number);
    int64_t num_rays = set_up_rays(grid, search.rays, window, tile, 0);
    if (num_rays == 0) return true;
    for (int64_t k = grid.starts[number]; k < grid.starts[number + 1]; k++) {
        if (is_stopped()) return false;
        int64_t brick = grid.numbers[k];
        if (offset_of(search.voxels, brick) == NOTHING) continue;
        float limit = least((float)search.tops[brick] - search.rules.slack, search.rules.ceiling);
        bool is_look = search.rules.is_sorted && (k - grid.starts[number]) % BRICKS_BETWEEN_LOOKS == 0;
        if (is_look && least_found(num_rays, tile) >= limit) break;
        Box box = box_of(search.boxes, brick);
        double nearer = 0.0;
        for (int axis = 0; axis < 3; axis++) nearer += forward[axis] * (box.corner[axis] - TEXEL_OFFSET);
        double nearness = by_depth ? 0.5 + nearer : 0.0;
        for_spans(
            box, search.rays, segments_of(grid, covered_by(grid, brick, window), window, tile, num_rays), tile,
            [&](ClippedFloats found) { return mask_of(found < limit); },
            [&](const auto& along, Range range, ClippedMask hit, int64_t) __attribute__((always_inline)) {
                return span_of(box, along, range, hit);
            },
            [&](int64_t num) {
                finder.meet(brick);
                search_spans(finder.texels(brick), search.rules, nearness, num, tile, pixels);
            });
    }
    return true;
}

}  // namespace

// Draw bricks into some tiles of the image. Its first channel gets the largest number of a ray; the second gets the nearness
// of this number, from 0 at the farthest point of the ball around the volume to 1 at the nearest; the others stay 0.
Status draw_extremes(const DrawExtremes* arguments) {
    const Grid& grid = arguments->grid;
    const auto& tiles = arguments->tiles;
    const AtlasTexels& voxels = arguments->voxels;
    if (!match(arguments->tops, grid.rectangles, arguments->boxes, voxels.offsets) || !is_consistent(voxels))
        return OUT_OF_BOUNDS;
    if (!have(voxels, false, arguments->rules.has_absent)) return OUT_OF_BOUNDS;
    if (!is_consistent(grid, tiles, [&](int64_t brick) { return can_be_drawn(voxels, brick, TEXELS_PER_BRICK); }))
        return OUT_OF_BOUNDS;
    const Tile tile(grid, arguments->rays, MAX_CELLS);
    const Buffer<double> scratch(scratch_size(arguments->voxels));
    const Buffer<float> own(own_size(arguments->voxels));
    if (!tile || !scratch || !own) return NO_MEMORY;
    TexelFinder finder = {&arguments->voxels, scratch.data, own, -1};
    for (int64_t k = 0; k < tiles.shape[0]; k++)
        if (!draw_tile(*arguments, tile, finder, tiles[k])) return STOPPED;
    return DONE;
}
