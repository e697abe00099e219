// March rays through bricks: a pixel grid, tile by tile, brick by brick, LANES pixels in step.
//
//     rays of a tile -> their spans inside a brick, sorted by numbers of samples -> marched in step
//     -> composited under the pixels of the tile
//
// The pixels of a tile stay in the processor's cache while all bricks over it are drawn, front to back. No two threads
// write to one pixel, so that images do not depend on the number of threads. Rays, and where they meet bricks, are
// float64; samples are float32. There are only sums, products, quotients and roots of IEEE 754, and `fma`, which rounds
// once: the result is the same bytes on every machine.
#include "light.h"
#include "sample.h"
#include "spans.h"

namespace {

constexpr int MAX_SAMPLES = 4095;  // as in renderer/draw/constants.py
constexpr int CACHE_LINE_BYTES = 64;
// Floats behind the last texel that loads of whole rows touch.
constexpr int READ_BEHIND = 2;

// Load the visible texels of a brick into the cache while another brick is drawn. Where few pixels are drawn, each texel
// is read a few times only, and half of the time would be waiting.
void prefetch_brick(const Box& box, const Texels& texels, int64_t texel_floats) {
    auto first = [&](int axis) { return (int64_t)((box.low[axis] - box.corner[axis]) * box.scale + TEXEL_OFFSET); };
    auto end = [&](int axis) {
        int64_t last = (int64_t)((box.high[axis] - box.corner[axis]) * box.scale + TEXEL_OFFSET + 1);
        return least(last, (int64_t)PADDED_BRICK_SIZE - 1) + 1;
    };
    int64_t row_bytes = PADDED_BRICK_SIZE * texel_floats * 4;
    for (int64_t plane = first(2); plane < end(2); plane++) {
        const char* of_plane = (const char*)texels.data + plane * PADDED_BRICK_SIZE * row_bytes;
        for (int64_t at = first(1) * row_bytes; at < end(1) * row_bytes; at += CACHE_LINE_BYTES)
            __builtin_prefetch(of_plane + at);
    }
}

// Write the spans of rays inside a brick, and return their number. is_whole: whether they are all that there is to
// draw; else, with CUTS, a span ends where a removed box begins, and the next call finds what is behind that box.
//
// A span is: the first sample [3], in texels of the brick; the step to the next one [3]; the length of a segment, in
// model units; the number of the last sample.
template <bool CUTS>
int64_t clip_rays(const Box& box, double start, Kept kept, Window window, float termination_alpha,
                  Tile tile, Spans spans, bool& is_whole) {
    double samples_per_length = box.scale / box.step;
    int64_t num = 0;
    is_whole = true;
    for (int64_t row = window.top; row < window.bottom; row++) {
        for (int64_t column = window.left; column < window.right; column += CLIPPED) {
            int64_t pixel = row * tile.side + column;
            auto number_of_ray = [&](int number) { return load<Doubles>(tile.rays, pixel + number * tile.room); };
            ClippedMask hit = mask_of(lane_numbers<ClippedInts>() < (int32_t)(window.right - column));
            hit &= mask_of(load<ClippedFloats>(tile.alphas, pixel) <= termination_alpha);
            if (!any_of(hit)) continue;
            const Along along[3] = {ray_along(tile, pixel, 0), ray_along(tile, pixel, 1), ray_along(tile, pixel, 2)};
            Range range;
            if (!clip_to_brick<CUTS>(box, start, kept, tile, pixel, along, hit, range, is_whole)) continue;
            Doubles length = where(hit, range.leave - range.enter, in_all<Doubles>(0.0));
            Doubles fractional = length * samples_per_length * number_of_ray(LENGTH);
            fractional += number_of_ray(ROUNDING_OFFSET);
            fractional = min_of(max_of(fractional, in_all<Doubles>(1.0)), in_all<Doubles>(MAX_SAMPLES));
            ClippedInts num_samples = __builtin_convertvector(fractional, ClippedInts);
            num_samples = where(mask_of((num_samples & 3) == 0), num_samples + 1, num_samples);
            Doubles count = __builtin_convertvector(num_samples, Doubles);
            Doubles segment = length * (1.0 / count);
            Doubles begin = range.enter + 0.5 * segment, end = range.leave - 0.5 * segment;
            Doubles per_interval = 1.0 / max_of(count - 1.0, in_all<Doubles>(1.0));
            Four<ClippedFloats> low, high;
            first_and_step(along[0], begin, end, per_interval, box.corner[0], box.scale, low.a, low.d);
            first_and_step(along[1], begin, end, per_interval, box.corner[1], box.scale, low.b, high.a);
            first_and_step(along[2], begin, end, per_interval, box.corner[2], box.scale, low.c, high.b);
            high.c = __builtin_convertvector(segment * number_of_ray(LENGTH_PER_DEPTH), ClippedFloats);
            high.d = __builtin_convertvector(num_samples - 1, ClippedFloats);
            num = append(spans, num, hit, pixel, low, high, UpTo<CLIPPED>());
        }
    }
    return num;
}

// Composite colours, premultiplied RGBA, under the pixels of `num` spans from `first` on.
template <int... LANE>
INLINE void composite_under(const Four<Floats>& colors, const Spans& spans, int64_t first, int64_t num,
                            const Tile& tile, const Array<float, 1>& pixels, Lanes<LANE...>) {
    auto rows = transpose(colors.a, colors.b, colors.c, colors.d);
    auto composite = [&]<int NUMBER>() {
        using Color = Vector<float, 4>;
        Color color = row_of<NUMBER>(rows);
        if (NUMBER < num && color[3] > 0.0f) {
            int32_t pixel = spans.pixels[spans.order[first + NUMBER]];
            int64_t place = tile.places[pixel];
            Color transmittance = 1.0f - tile.alphas[pixel];
            store(pixels, place, fused(transmittance, color, load<Color>(pixels, place)));
            tile.alphas[pixel] = pixels[place + 3];
        }
    };
    (composite.template operator()<LANE>(), ...);
}

// What the texels of a brick are, and how it is lit: means need no classification.
enum Kind { MEANS, UNLIT, LAMBERT, LIT };

struct Scene {
    const Field& field;
    const LaneTable table;
    const Light& light;
};

// Composite the samples of spans under the pixels of a tile; rays end behind `termination_alpha`.
// texels: of the brick, and what follows. pixels: of the image.
//
// Indices are valid: samples are clamped to the brick (`first_and_step`), and float32 rounds the last one by less than a
// quarter of a texel; scalars are finite, so that the search ends at the last piece; lanes without a ray have a span of
// zeros or of another brick, whose texels are at the same places.
template <Kind KIND>
void march(Texels texels, const Scene& scene, const Box& box, Spans spans, int64_t num, Tile tile,
           Array<float, 1> pixels) {
    const Field& field = scene.field;
    const Light& light = scene.light;
    float origin[3] = {};
    for (int axis = 0; KIND == LIT && axis < 3; axis++) origin[axis] = place_brick(light, box, axis);
    for (int64_t first = 0; first < num; first += LANES) {
        Ints order = load<Ints>(spans.order, first);
        auto [x, y, z, step_x] = load_four(spans.rows, order * SPAN_FLOATS);
        auto [step_y, step_z, length, last] = load_four(rest_of(spans.rows, 4), order * SPAN_FLOATS);
        Three begin = {x, y, z}, step = {step_x, step_y, step_z}, shares;
        Ways ways;
        if constexpr (KIND == LIT) {
            Ints at = gather(spans.pixels, order);
            auto along = [&](int axis) {
                auto directions = rest_of(tile.rays, (DIRECTION + axis) * tile.room);
                return __builtin_convertvector(gather(directions, at), Floats);
            };
            ways = aim(light, {along(0), along(1), along(2)});
        }
        Floats zero = in_all<Floats>(0.0f), red = zero, green = zero, blue = zero, alpha = zero;
        Mask alive = mask_of(lane_numbers<Ints>() < (int32_t)least(num - first, (int64_t)LANES));
        for (float number = 0.0f;; number += 1.0f) {
            Mask active = alive & mask_of(last >= number);
            if (!any_of(active)) break;
            Floats here = min_of(last, in_all<Floats>(number));
            Ints at = cell_at(here, begin, step, shares);
            Sample sample;
            Mask visible;
            if constexpr (KIND == MEANS) {
                sample = sample_rgba(texels, at, shares);
                visible = active & mask_of(sample.tau > 0.0f);
            } else {
                Corners corners = load_corners(texels, at);
                Floats scalar = interpolate(corners, shares);
                if (!any_of(active & mask_of(scalar >= field.pieces.lowest_visible))) continue;
                sample = classify(scene.table, scalar);
                visible = active & mask_of(sample.tau > 0.0f);
                Mask are_divided = visible & ~are_all_present(corners);
                if (field.has_absent && any_of(are_divided)) {
                    sample.tau *= share_of_data(texels, are_divided, here, begin, step);
                    visible &= mask_of(sample.tau > 0.0f);
                }
            }
            if (!any_of(visible)) continue;
            if constexpr (KIND == LIT) {
                Three texel = {fma(here, step.x, x), fma(here, step.y, y), fma(here, step.z, z)};
                Arriving arriving = arriving_shares(light, texel, origin);
                sample = illuminate(sample, sample_gradient(texels, at, shares), ways, arriving, light);
            }
            Floats depth = where(visible, sample.tau, zero) * field.spacings_per_model_unit * length;
            Floats weight = (1.0f - alpha) * opacity_of_depth(depth);
            alpha += weight;
            if constexpr (KIND == MEANS) weight = where(visible, weight / sample.tau, zero);
            if constexpr (KIND == LAMBERT) weight *= light_factor(sample_gradient(texels, at, shares), field.light);
            red = fma(weight, sample.r, red), green = fma(weight, sample.g, green), blue = fma(weight, sample.b, blue);
            alive &= mask_of(alpha <= field.termination_alpha);
        }
        composite_under({red, green, blue, alpha}, spans, first, num - first, tile, pixels, UpTo<LANES>());
    }
}

// Composite the bricks over a tile, front to back.
void draw_tile(const DrawTiles& arguments, const Scene& scene, const Tile& tile, const Spans& spans, const Kept& kept,
               int64_t number) {
    const Grid& grid = arguments.grid;
    const RaySetup& rays = grid.rays;
    const Field& field = scene.field;
    const TileBins& bins = grid.bins;
    const Array<float, 1> pixels = {grid.image.data, {grid.image.size()}};
    auto is_mean = [&](int64_t brick) { return arguments.is_mean[brick]; };
    auto texels_of = [&](int64_t brick) {
        return rest_of(is_mean(brick) ? field.means : field.scalars, grid.texel_offsets[brick]);
    };
    Window window = window_of(grid, number);
    set_up_rays(grid, window, tile);
    if (rays.cuts.exists) cut_rays(rays.cuts.value, rays.start, window, tile, kept);
    for (int64_t k = bins.starts[number]; k < bins.starts[number + 1]; k++) {
        if (grid.stride > 1 && k + 1 < bins.starts[number + 1]) {
            int64_t following = bins.numbers[k + 1];
            prefetch_brick(box_of(grid, following), texels_of(following), is_mean(following) ? 4 : 1);
        }
        int64_t brick = bins.numbers[k];
        Box box = box_of(grid, brick);
        Window covered = covered_by(grid, brick, window);
        auto march_kind = is_mean(brick) ? march<MEANS>
            : arguments.light.exists     ? march<LIT>
            : field.is_lit              ? march<LAMBERT>
                                         : march<UNLIT>;
        auto clip = rays.cuts.exists ? clip_rays<true> : clip_rays<false>;
        for (bool is_whole = false; !is_whole;) {  // one part of every ray after the other
            int64_t num = clip(box, rays.start, kept, covered, field.termination_alpha, tile, spans, is_whole);
            if (num == 0) continue;
            sort_spans(spans, num);
            march_kind(texels_of(brick), scene, box, spans, num, tile, pixels);
        }
    }
}

// Whether all bricks have texels, each scalar a piece of the table, and the light field all its cells.
bool is_complete(const DrawTiles& arguments) {
    const auto& [grid, is_mean, field, light, tiles] = arguments;
    if (is_mean.shape[0] != grid.boxes.shape[0]) return false;
    for (int64_t brick = 0; brick < is_mean.shape[0]; brick++) {
        bool has_channels = is_mean[brick] || light.exists || field.is_lit;
        int64_t num = has_channels ? 4 * TEXELS_PER_BRICK + READ_BEHIND : TEXELS_PER_BRICK;
        int64_t size = (is_mean[brick] ? field.means : field.scalars).shape[0], offset = grid.texel_offsets[brick];
        if (offset < 0 || offset > size - num) return false;
    }
    const auto& [rows, guide, lowest_visible] = field.pieces;
    int64_t num = rows.shape[0];
    if (num < 1 || rows.shape[1] != PIECE_FLOATS || guide.shape[0] != GUIDE_SIZE) return false;
    if (rows(num - 1, 0) < INFINITE) return false;
    for (int64_t bucket = 0; bucket < GUIDE_SIZE; bucket++)
        if (guide[bucket] < 0 || guide[bucket] >= num) return false;
    if (!light.exists) return true;
    const Light& one = light.value;
    if (one.factors.shape[1] != 3) return false;
    const auto& [occlusion, shadow, corners, cell_size, occlusion_strength, shadow_strength] = one.field;
    int64_t num_corners = 2;  // of the cells, each of which has two for a grid, and behind the last one
    if ((float)occlusion_strength > 0.0f) num_corners += 2 * occlusion.size();
    if ((float)shadow_strength > 0.0f) num_corners += 2 * shadow.size();
    return corners.shape[0] == 0 || corners.shape[0] >= num_corners;
}

}  // namespace

// Composite bricks under some tiles of the image.
Status draw_tiles(const DrawTiles* arguments) {
    const auto& [grid, is_mean, field, light, tiles] = *arguments;
    if (!is_consistent(grid, tiles) || !is_complete(*arguments)) return OUT_OF_BOUNDS;
    TileMemory memory(grid, MAX_SAMPLES - 1);
    if (!memory) return NO_MEMORY;
    const Scene scene = {field, LaneTable(field.pieces), light.value};
    for (int64_t k = 0; k < tiles.shape[0]; k++)
        draw_tile(*arguments, scene, memory.tile(), memory.spans(), memory.kept(), tiles[k]);
    return DONE;
}
