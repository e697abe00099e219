// March rays through bricks: the rays of a grid, tile by tile and brick by brick, LANES rays in step.
//
//     rays of a tile -> their spans inside a brick, sorted by numbers of samples -> marched in step
//     -> composited under the pixels of the tile
//
// The pixels of a tile stay in the processor's cache while all bricks over it are drawn, front to back. No two threads
// write to one pixel, so that images do not depend on the number of threads. Rays, and the points where they enter and
// leave bricks, are float64; samples are float32. Only sums, products, quotients and roots of IEEE 754 are used, and `fma`,
// which rounds once: the result is the same bytes on every machine.
#include "draw/kernels.h"
#include "base/stopping.h"
#include "draw/fields.h"
#include "draw/fog.h"
#include "draw/passing.h"

namespace {

// The most samples of a ray in a brick; only rays that rounding moves beyond their brick would have more.
constexpr int MAX_SAMPLES = 4095;
// The number of bytes that the processor loads into its cache at once.
constexpr int CACHE_LINE_BYTES = 64;

// Load the visible texels of a brick into the processor's cache while another brick is drawn.
//
// num_channels: the number of float32 numbers of a texel that is no voxel.
void prefetch_brick(const Box& box, const BrickTexels& texels, int64_t num_channels) {
    const int64_t side = texels.side(), around = 2 * texels.margin();
    const int64_t row_bytes = side * (texels.rules == nullptr ? 4 * num_channels : texels.rules->voxel_texels.value.num_bytes);
    auto first = [&](int axis) { return (int64_t)((box.low[axis] - box.corner[axis]) * box.scale + TEXEL_OFFSET); };
    auto end = [&](int axis) {
        int64_t last = (int64_t)((box.high[axis] - box.corner[axis]) * box.scale + TEXEL_OFFSET + 1);
        return least(last + around, side - 1) + 1;
    };
    for (int64_t plane = first(2); plane < end(2); plane++) {
        const char* of_plane = (const char*)texels.words.data + plane * side * row_bytes;
        for (int64_t at = first(1) * row_bytes; at < end(1) * row_bytes; at += CACHE_LINE_BYTES)
            __builtin_prefetch(of_plane + at);
    }
}

// Prefetch the texels of all layers of a brick that are read only a few times: on a subsampled grid, or if they are voxels.
// Up to half of the time would otherwise be spent waiting for them.
void prefetch_layers(ShownLayers& shown, int64_t brick, const Array<const double, 2>& boxes, bool is_subsampled) {
    shown.choose(brick);
    for (int64_t layer = 0; layer < shown.num; layer++) {
        if (!shown.has_texels(layer, brick)) continue;
        BrickTexels texels = shown.texels(layer, brick);
        if (is_subsampled || texels.rules != nullptr)
            prefetch_brick(box_of(boxes, brick), texels, shown.has_means(layer) ? 4 : 1);
    }
}

// Return the spans of rays inside a brick, one in each lane: the first sample [3], in texels of the brick; the step to the
// next sample [3]; the length of a segment, in model units; the number of the last sample.
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
                            const Array<float, 1>& pixels, bool is_additive, Lanes<LANE...>) {
    auto rows = transpose(colors.a, colors.b, colors.c, colors.d);
    auto composite = [&]<int NUMBER>() {
        using Color = Vector<float, 4>;
        Color color = row_of<NUMBER>(rows);
        if (NUMBER < num && color[3] > 0.0f) {
            int32_t pixel = tile.pixels[tile.order[first + NUMBER]];
            int64_t place = tile.places[pixel];
            Color transmittance = is_additive ? 1.0f : 1.0f - tile.found[pixel];
            store(pixels, place, fused(transmittance, color, load<Color>(pixels, place)));
            tile.found[pixel] = pixels[place + 3];
        }
    };
    (composite.template operator()<LANE>(), ...);
}

// Composite the samples of `num` spans in a brick under the pixels of a tile. Rays end beyond the scene's
// `termination_alpha`. pixels: the image.
//
// Indices into texels and tables are valid: samples are clamped to the brick (`first_and_step`), and float32 rounds the
// last sample by less than a quarter of a texel; scalars are finite, so that the search for a piece of the transfer function
// ends at the last piece; lanes without a ray have a span of zeros or of another brick, whose texels have the same places.
template <Kind KIND, int NUM = 1>
void march(const DrawTiles& scene, const ShownLayers& shown, int64_t brick, const Box& box, int64_t num,
           const Tile& tile, Array<float, 1> pixels) {
    const Field& field = *shown.fields[0];
    const LaneTable& table = *shown.of_fields[0];
    BrickTexels texels = shown.texels(0, brick);
    float scale = shown.scale(0);
    [[maybe_unused]] bool is_cut = shown.is_cut(0, brick);
    [[maybe_unused]] bool passes_over = box.step <= LONGEST_PASSED_STEP && !field.is_labels;
    const Faces all = shown.all_faces();
    const BrickRadiance radiance = radiance_in(*shown.bricks, box);
    const BrickFog fog = fog_in(*shown.bricks, box);
    const bool are_albedos = shown.are_albedos();
    for (int64_t first = 0; first < num; first += LANES) {
        Ints order = load<Ints>(tile.order, first);
        auto [x, y, z, step_x] = load_four(tile.spans, order * SPAN_FLOATS);
        auto [step_y, step_z, length, last] = load_four(rest_of(tile.spans, 4), order * SPAN_FLOATS);
        Three direction;
        Lighting lighting = {shown.faces(0, brick, all), {}, {}, {}};
        if constexpr (KIND == LIT || KIND == SURFACE || KIND == SEVERAL) {
            Ints at = gather(tile.pixels, order);
            auto along = [&](int axis) {
                auto directions = rest_of(tile.rays, (DIRECTION + axis) * tile.room);
                return __builtin_convertvector(gather(directions, at), Floats);
            };
            direction = {along(0), along(1), along(2)};
        }
        Three way = {};
        if (are_albedos) {
            Ints at = gather(tile.pixels, order);
            auto number_of_ray = [&](int number) {
                return __builtin_convertvector(gather(rest_of(tile.rays, number * tile.room), at), Floats);
            };
            Floats texels_per_direction = length * (float)box.scale / number_of_ray(LENGTH_PER_DEPTH);
            way = {number_of_ray(DIRECTION) * texels_per_direction, number_of_ray(DIRECTION + 1) * texels_per_direction,
                   number_of_ray(DIRECTION + 2) * texels_per_direction};
        }
        if constexpr (KIND == LIT || KIND == SURFACE)
            lighting = lighting_of(field.light.value, box, direction, lighting.faces, radiance);
        Floats zero = in_all<Floats>(0.0f), red = zero, green = zero, blue = zero, alpha = zero, fogged = zero;
        Mask alive = mask_of(lane_numbers<Ints>() < (int32_t)least(num - first, (int64_t)LANES));
        Places places = {{}, {}, {}, {x, y, z}, {step_x, step_y, step_z}, in_all<Floats>(1.0f), alive};
        const RaySamples samples(places.begin, places.step, last);
        for (Floats number = zero, next;; number = next) {
            places.active = alive & mask_of(last >= number);
            if (!any_of(places.active)) break;
            places.number = min_of(last, number);
            places.cell = cell_at(places.number, places.begin, places.step, places.shares);
            next = number + 1.0f;
            Sample sample;
            Floats depth, light;
            Mask visible;
            if constexpr (KIND == SEVERAL) {
                sample = sum_of_layers<NUM>(shown, brick, box, places, direction, radiance);
                visible = mask_of(sample.tau > 0.0f), depth = sample.tau * length;
            } else {
                auto follow = [&](const Scalars& scalars) {
                    if (passes_over && any_of(places.active & ~scalars.visible))
                        next = where(scalars.visible, next,
                                     next_visible(samples, number, places.cell, scalars, field.pieces.lowest_visible));
                };
                auto [found, factor, shown] = sample_field<KIND>(field, table, texels, places, lighting, box, is_cut, follow);
                sample = found, light = factor, visible = shown;
                depth = where(visible, sample.tau, zero) * scale * length;
            }
            if (!any_of(visible)) continue;
            if (are_albedos) scatter(radiance, seen_texels(places, way, depth), sample);
            Floats weight = scene.is_additive ? depth : (1.0f - alpha) * opacity_of_depth(depth);
            alpha += weight;
            if (fog.color != nullptr) {
                Floats of_fog = weight * fog.share(texels_of(places), places.step, depth);
                fogged += where(visible, of_fog, zero), weight -= of_fog;
            }
            if constexpr (KIND == MEANS || KIND == SEVERAL) weight = where(visible, weight / sample.tau, zero);
            if constexpr (KIND == LAMBERT) weight *= light;
            red = fma(weight, sample.r, red), green = fma(weight, sample.g, green), blue = fma(weight, sample.b, blue);
            alive &= mask_of(alpha <= scene.termination_alpha);
        }
        if (fog.color != nullptr) {
            red = fma(fogged, fog.color[0], red), green = fma(fogged, fog.color[1], green);
            blue = fma(fogged, fog.color[2], blue);
        }
        composite_under({red, green, blue, alpha}, first, num - first, tile, pixels, scene.is_additive, UpTo<LANES>());
    }
}

// Return the function that marches rays through a brick, for the layers that show anything in it.
auto march_of(const ShownLayers& shown) {
    Kind kind = shown.kind(0);
    if (shown.num == 1)
        return kind == MEANS ? march<MEANS>
            : kind == UNLIT  ? march<UNLIT>
            : kind == LAMBERT ? march<LAMBERT>
            : kind == LIT     ? march<LIT>
                              : march<SURFACE>;
    int64_t num = shown.are_plain() ? shown.num : 0;
    return num == 2 ? march<SEVERAL, 2> : num == 3 ? march<SEVERAL, 3> : num == 4 ? march<SEVERAL, 4> : march<SEVERAL, 0>;
}

// Composite the bricks over a tile, front to back. Return whether the tile was finished, and drawing not stopped.
bool draw_tile(const DrawTiles& scene, ShownLayers& shown, const Tile& tile, int64_t number) {
    const Grid& grid = scene.grid;
    const RaySetup& rays = scene.bricks.rays;
    const auto& boxes = scene.bricks.boxes;
    const Array<float, 1> pixels = {grid.rays.data, {grid.rays.size()}};
    Window window = window_of(grid, number);
    int64_t num_rays = set_up_rays(grid, rays, window, tile, 3);
    if (num_rays == 0) return true;
    for (int64_t k = grid.starts[number]; k < grid.starts[number + 1]; k++) {
        if (is_stopped()) return false;
        if (k + 1 < grid.starts[number + 1]) prefetch_layers(shown, grid.numbers[k + 1], boxes, grid.stride > 1);
        int64_t brick = grid.numbers[k];
        shown.choose(brick);
        if (shown.num == 0) continue;
        Box box = box_of(boxes, brick);
        auto march_brick = march_of(shown);
        for_spans(
            box, rays, segments_of(grid, covered_by(grid, brick, window), window, tile, num_rays), tile,
            [&](ClippedFloats alphas) { return mask_of(alphas <= scene.termination_alpha); },
            [&](const auto&... clipped) __attribute__((always_inline)) { return span_of(box, tile, clipped...); },
            [&](int64_t num) {
                shown.meet(brick);
                march_brick(scene, shown, brick, box, num, tile, pixels);
            });
    }
    return true;
}

}  // namespace

// Composite bricks under some tiles of the image, or add up their light if nothing is absorbed.
Status draw_tiles(const DrawTiles* arguments) {
    const auto& [grid, bricks, termination_alpha, is_additive, tiles] = *arguments;
    if (!match(bricks.is_mean, grid.rectangles) || !is_complete(bricks)) return OUT_OF_BOUNDS;
    if (!is_consistent(grid, tiles, [&](int64_t brick) { return can_be_drawn(bricks, brick); })) return OUT_OF_BOUNDS;
    const Tile tile(grid, bricks.rays, MAX_SAMPLES - 1);
    const ShownGroups shown({&bricks, {1}});
    if (!tile || !shown) return NO_MEMORY;
    for (int64_t k = 0; k < tiles.shape[0]; k++)
        if (!draw_tile(*arguments, shown.groups[0], tile, tiles[k])) return STOPPED;
    return DONE;
}
