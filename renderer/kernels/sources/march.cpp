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

// Of a ray in a brick; only rays that rounding moves beyond their brick would have more.
constexpr int MAX_SAMPLES = 4095;
constexpr int CACHE_LINE_BYTES = 64;
// Floats behind the last texel that loads of whole rows touch.
constexpr int READ_BEHIND = 2;

// Load the visible texels of a brick into the cache while another brick is drawn. Where few pixels are drawn, each
// texel is read a few times only, and half of the time would be waiting.
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

// Spans of rays inside a brick: the first sample [3], in texels of the brick; the step to the next one [3]; the length
// of a segment, in model units; the number of the last sample.
INLINE Span span_of(const Box& box, const Tile& tile, const Along (&along)[3], Range range, ClippedMask hit,
                    int64_t pixel) {
    auto number_of_ray = [&](int number) { return load<Doubles>(tile.rays, pixel + number * tile.room); };
    Doubles length = where(hit, range.leave - range.enter, in_all<Doubles>(0.0));
    Doubles fractional = length * (box.scale / box.step) * number_of_ray(LENGTH);
    fractional += number_of_ray(ROUNDING_OFFSET);
    fractional = min_of(max_of(fractional, in_all<Doubles>(1.0)), in_all<Doubles>(MAX_SAMPLES));
    ClippedInts num_samples = __builtin_convertvector(fractional, ClippedInts);
    num_samples = where(mask_of((num_samples & 3) == 0), num_samples + 1, num_samples);
    Doubles count = __builtin_convertvector(num_samples, Doubles);
    Doubles segment = length * (1.0 / count);
    Doubles begin = range.enter + 0.5 * segment, end = range.leave - 0.5 * segment;
    Doubles per_interval = 1.0 / max_of(count - 1.0, in_all<Doubles>(1.0));
    Span span;
    auto& [low, high] = span;
    first_and_step(along[0], begin, end, per_interval, box.corner[0], box.scale, low.a, low.d);
    first_and_step(along[1], begin, end, per_interval, box.corner[1], box.scale, low.b, high.a);
    first_and_step(along[2], begin, end, per_interval, box.corner[2], box.scale, low.c, high.b);
    high.c = __builtin_convertvector(segment * number_of_ray(LENGTH_PER_DEPTH), ClippedFloats);
    high.d = __builtin_convertvector(num_samples - 1, ClippedFloats);
    return span;
}

// Composite colours, premultiplied RGBA, under the pixels of `num` spans from `first` on.
template <int... LANE>
INLINE void composite_under(const Four<Floats>& colors, int64_t first, int64_t num, const Tile& tile,
                            const Array<float, 1>& pixels, Lanes<LANE...>) {
    auto rows = transpose(colors.a, colors.b, colors.c, colors.d);
    auto composite = [&]<int NUMBER>() {
        using Color = Vector<float, 4>;
        Color color = row_of<NUMBER>(rows);
        if (NUMBER < num && color[3] > 0.0f) {
            int32_t pixel = tile.pixels[tile.order[first + NUMBER]];
            int64_t place = tile.places[pixel];
            Color transmittance = 1.0f - tile.found[pixel];
            store(pixels, place, fused(transmittance, color, load<Color>(pixels, place)));
            tile.found[pixel] = pixels[place + 3];
        }
    };
    (composite.template operator()<LANE>(), ...);
}

// What the texels of a brick are, and how it is lit: means need no classification.
enum Kind { MEANS, UNLIT, LAMBERT, LIT };

// Composite the samples of spans under the pixels of a tile; rays end behind `termination_alpha`.
// texels: of the brick, and what follows. pixels: of the image. scene: but for them.
//
// Indices are valid: samples are clamped to the brick (`first_and_step`), and float32 rounds the last one by less than
// a quarter of a texel; scalars are finite, so that the search ends at the last piece; lanes without a ray have a span
// of zeros or of another brick, whose texels are at the same places.
template <Kind KIND>
void march(Texels texels, const DrawTiles& scene, const LaneTable& table, const Box& box, int64_t num,
           const Tile& tile, Array<float, 1> pixels) {
    const Light& light = scene.light.value;
    float origin[3] = {};
    for (int axis = 0; KIND == LIT && axis < 3; axis++) origin[axis] = place_brick(light, box, axis);
    for (int64_t first = 0; first < num; first += LANES) {
        Ints order = load<Ints>(tile.order, first);
        auto [x, y, z, step_x] = load_four(tile.spans, order * SPAN_FLOATS);
        auto [step_y, step_z, length, last] = load_four(rest_of(tile.spans, 4), order * SPAN_FLOATS);
        Three begin = {x, y, z}, step = {step_x, step_y, step_z}, shares;
        Ways ways;
        if constexpr (KIND == LIT) {
            Ints at = gather(tile.pixels, order);
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
                if (!any_of(active & mask_of(scalar >= scene.pieces.lowest_visible))) continue;
                sample = classify(table, scalar);
                visible = active & mask_of(sample.tau > 0.0f);
                Mask are_divided = visible & ~are_all_present(corners);
                if (scene.has_absent && any_of(are_divided)) {
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
            Floats depth = where(visible, sample.tau, zero) * scene.spacings_per_model_unit * length;
            Floats weight = (1.0f - alpha) * opacity_of_depth(depth);
            alpha += weight;
            if constexpr (KIND == MEANS) weight = where(visible, weight / sample.tau, zero);
            if constexpr (KIND == LAMBERT) weight *= light_factor(sample_gradient(texels, at, shares), scene.lambert);
            red = fma(weight, sample.r, red), green = fma(weight, sample.g, green), blue = fma(weight, sample.b, blue);
            alive &= mask_of(alpha <= scene.termination_alpha);
        }
        composite_under({red, green, blue, alpha}, first, num - first, tile, pixels, UpTo<LANES>());
    }
}

// Composite the bricks over a tile, front to back.
void draw_tile(const DrawTiles& scene, const LaneTable& table, const Tile& tile, int64_t number) {
    const Grid& grid = scene.grid;
    const Array<float, 1> pixels = {grid.image.data, {grid.image.size()}};
    auto texels_of = [&](int64_t brick) {
        return rest_of(scene.is_mean[brick] ? scene.means : scene.scalars, grid.texel_offsets[brick]);
    };
    Window window = window_of(grid, number);
    set_up_rays(grid, window, tile, 3);
    for (int64_t k = grid.starts[number]; k < grid.starts[number + 1]; k++) {
        if (grid.stride > 1 && k + 1 < grid.starts[number + 1]) {
            int64_t following = grid.numbers[k + 1];
            prefetch_brick(box_of(grid, following), texels_of(following), scene.is_mean[following] ? 4 : 1);
        }
        int64_t brick = grid.numbers[k];
        Box box = box_of(grid, brick);
        auto march_kind = scene.is_mean[brick] ? march<MEANS>
            : scene.light.exists               ? march<LIT>
            : scene.is_lit                     ? march<LAMBERT>
                                               : march<UNLIT>;
        for_spans(
            box, grid.rays, covered_by(grid, brick, window), tile,
            [&](ClippedFloats alphas) { return mask_of(alphas <= scene.termination_alpha); },
            [&](const auto&... clipped) __attribute__((always_inline)) { return span_of(box, tile, clipped...); },
            [&](int64_t num) { march_kind(texels_of(brick), scene, table, box, num, tile, pixels); });
    }
}

// Whether all bricks have texels, each scalar a piece of the table, and the light grid all its cells.
bool is_complete(const DrawTiles& scene) {
    for (int64_t brick = 0; brick < scene.is_mean.shape[0]; brick++) {
        bool is_mean = scene.is_mean[brick], has_channels = is_mean || scene.light.exists || scene.is_lit;
        int64_t num = has_channels ? 4 * TEXELS_PER_BRICK + READ_BEHIND : TEXELS_PER_BRICK;
        int64_t size = (is_mean ? scene.means : scene.scalars).shape[0], offset = scene.grid.texel_offsets[brick];
        if (offset < 0 || offset > size - num) return false;
    }
    const auto& [rows, guide, lowest_visible] = scene.pieces;
    int64_t num = rows.shape[0];
    if (num < 1 || rows.shape[1] != PIECE_FLOATS || guide.shape[0] != GUIDE_SIZE) return false;
    if (rows(num - 1, 0) < INFINITE) return false;
    for (int64_t bucket = 0; bucket < GUIDE_SIZE; bucket++)
        if (guide[bucket] < 0 || guide[bucket] >= num) return false;
    if (!scene.light.exists) return true;
    const auto& [occlusion, shadow, corners, cell_size, occlusion_strength, shadow_strength] = scene.light.value.grid;
    int64_t num_corners = 2;  // of the cells, each of which has two for a grid, and behind the last one
    if ((float)occlusion_strength > 0.0f) num_corners += 2 * occlusion.size();
    if ((float)shadow_strength > 0.0f) num_corners += 2 * shadow.size();
    return corners.shape[0] == 0 || corners.shape[0] >= num_corners;
}

}  // namespace

// Composite bricks under some tiles of the image.
Status draw_tiles(const DrawTiles* arguments) {
    const Grid& grid = arguments->grid;
    const auto& tiles = arguments->tiles;
    if (!is_consistent(grid, tiles) || !match(arguments->is_mean, grid.boxes) || !is_complete(*arguments))
        return OUT_OF_BOUNDS;
    const Tile tile(grid, MAX_SAMPLES - 1);
    if (!tile) return NO_MEMORY;
    const LaneTable table(arguments->pieces);
    for (int64_t k = 0; k < tiles.shape[0]; k++) draw_tile(*arguments, table, tile, tiles[k]);
    return DONE;
}
