// Sample the fields of layers in a brick, and classify and light the samples: in each lane a sample of its own.
#pragma once
#include "light.h"

// Floats behind the last texel that loads of whole rows touch.
constexpr int READ_BEHIND = 2;

// What the texels of a brick are, and how it is lit: means need no classification. SEVERAL: those of several layers.
enum Kind { MEANS, UNLIT, LAMBERT, LIT, SEVERAL };

// Where samples are in a brick: the texel at or below, and how far they are from it; their numbers, of which
// `begin + number * step` are their texels; how many steps long each is; which of them count.
struct Places {
    Ints at;
    Three shares;
    Floats number;
    Three begin, step;
    Floats width;
    Mask active;
};

// What the light of a field has in common along rays through a brick.
struct Lighting {
    Ways ways;
    float origin[3];
};

// direction: of rays, in index space, of any length.
INLINE Lighting lighting_of(const Light& light, const Box& box, const Three& direction) {
    return {aim(light, direction), {place_brick(light, box, 0), place_brick(light, box, 1), place_brick(light, box, 2)}};
}

// Samples, a factor on their colours, and which of them show anything.
struct Classified {
    Sample sample;
    Floats light;
    Mask visible;
};

// texels: of the brick, and what follows.
template <Kind KIND>
INLINE Classified sample_field(const Field& field, const LaneTable& table, const Texels& texels, const Places& places,
                               const Lighting& lighting) {
    const auto& [at, shares, number, begin, step, width, active] = places;
    Classified found = {{}, in_all<Floats>(1.0f), active};
    if constexpr (KIND == MEANS) {
        found.sample = sample_rgba(texels, at, shares);
        found.visible = active & mask_of(found.sample.tau > 0.0f);
        return found;
    }
    Corners corners = load_corners(texels, at);
    Floats scalar = interpolate(corners, shares);
    found.visible = active & mask_of(scalar >= field.pieces.lowest_visible);
    if (!any_of(found.visible)) return found;
    found.sample = classify(table, scalar);
    found.visible = active & mask_of(found.sample.tau > 0.0f);
    Mask are_divided = found.visible & ~are_all_present(corners);
    if (field.has_absent && any_of(are_divided)) {
        found.sample.tau *= share_of_data(texels, are_divided, places.number, begin, step, width);
        found.visible &= mask_of(found.sample.tau > 0.0f);
    }
    if (!any_of(found.visible)) return found;
    if constexpr (KIND == LAMBERT) found.light = light_factor(sample_gradient(texels, at, shares), field.lambert);
    if constexpr (KIND == LIT) {
        const Light& light = field.light.value;
        Three texel = {fma(number, step.x, begin.x), fma(number, step.y, begin.y), fma(number, step.z, begin.z)};
        Arriving arriving = arriving_shares(light, texel, lighting.origin);
        found.sample = illuminate(found.sample, sample_gradient(texels, at, shares), lighting.ways, arriving, light);
    }
    return found;
}

INLINE Kind kind_of(const Field& field, bool is_mean) {
    return is_mean ? MEANS : field.light.exists ? LIT : field.is_lit ? LAMBERT : UNLIT;
}

// A LaneTable of each field. False where there is no memory for them.
struct LaneTables : Buffer<LaneTable> {
    explicit LaneTables(const Array<const Field, 1>& fields) : Buffer<LaneTable>(fields.shape[0]) {
        for (int64_t k = 0; *this && k < fields.shape[0]; k++) data[k] = LaneTable(fields[k].pieces);
    }
};

// The texels of a brick in a field, and what follows.
INLINE Texels texels_of(const Field& field, int64_t brick, bool is_mean) {
    return rest_of(is_mean ? field.means : field.scalars, field.texel_offsets[brick]);
}

// From a sample's extinction to what it is in a model unit.
INLINE float extinction_scale(const LayerBricks& bricks, int64_t number, bool is_mean) {
    return is_mean ? bricks.spacings_per_model_unit : bricks.spacings_per_model_unit * bricks.fields[number].weight;
}

// Add what a layer has at samples to the sums of all layers' extinctions, and of extinctions times colours.
INLINE void add_sample(Sample& sum, const Classified& found, float scale, bool is_mean) {
    Floats zero = in_all<Floats>(0.0f), tau = where(found.visible, found.sample.tau * scale, zero);
    Floats weight = is_mean ? where(found.visible, in_all<Floats>(scale), zero) : tau * found.light;
    sum.tau += tau;
    sum.r = fma(weight, found.sample.r, sum.r), sum.g = fma(weight, found.sample.g, sum.g);
    sum.b = fma(weight, found.sample.b, sum.b);
}

// The sums of all layers' extinctions, and of extinctions times colours, at samples.
//
// NUM: of layers, all of them without light; 0 for any. With their number known, tables stay in registers: two layers
// take 1.4 of the time of one, and else 2.2.
template <int NUM>
INLINE Sample sum_of_fields(const LayerBricks& bricks, const LaneTable* tables, int64_t brick,
                            [[maybe_unused]] const Box& box, const Places& places,
                            [[maybe_unused]] const Three& direction) {
    Floats zero = in_all<Floats>(0.0f);
    Sample sum = {zero, zero, zero, zero};
    if constexpr (NUM > 0) {
#pragma clang loop unroll(full)
        for (int number = 0; number < NUM; number++) {
            const Field& field = bricks.fields[number];
            Classified found = sample_field<UNLIT>(field, tables[number], texels_of(field, brick, false), places, {});
            add_sample(sum, found, extinction_scale(bricks, number, false), false);
        }
        return sum;
    }
    bool is_mean = bricks.is_mean[brick];
    for (int64_t number = 0; number < (is_mean ? 1 : bricks.fields.shape[0]); number++) {
        const Field& field = bricks.fields[number];
        Texels texels = texels_of(field, brick, is_mean);
        Kind kind = kind_of(field, is_mean);
        Classified found = kind == MEANS ? sample_field<MEANS>(field, tables[number], texels, places, {})
            : kind == UNLIT              ? sample_field<UNLIT>(field, tables[number], texels, places, {})
            : kind == LAMBERT            ? sample_field<LAMBERT>(field, tables[number], texels, places, {})
                                         : sample_field<LIT>(field, tables[number], texels, places,
                                                             lighting_of(field.light.value, box, direction));
        if (any_of(found.visible)) add_sample(sum, found, extinction_scale(bricks, number, is_mean), is_mean);
    }
    return sum;
}

// Whether all bricks have texels, each scalar a piece of the table, and the light grid all its cells.
inline bool is_complete(const Field& field, const Array<const bool, 1>& is_mean, bool is_first) {
    if (!match(field.texel_offsets, is_mean)) return false;
    for (int64_t brick = 0; brick < is_mean.shape[0]; brick++) {
        if (is_mean[brick] && !is_first) continue;
        bool has_channels = kind_of(field, is_mean[brick]) != UNLIT;
        int64_t num = has_channels ? 4 * TEXELS_PER_BRICK + READ_BEHIND : TEXELS_PER_BRICK;
        int64_t size = (is_mean[brick] ? field.means : field.scalars).shape[0], offset = field.texel_offsets[brick];
        if (offset < 0 || offset > size - num) return false;
    }
    const auto& [rows, guide, lowest_visible] = field.pieces;
    int64_t num = rows.shape[0];
    if (num < 1 || rows.shape[1] != PIECE_FLOATS || guide.shape[0] != GUIDE_SIZE) return false;
    if (rows(num - 1, 0) < INFINITE) return false;
    for (int64_t bucket = 0; bucket < GUIDE_SIZE; bucket++)
        if (guide[bucket] < 0 || guide[bucket] >= num) return false;
    if (!field.light.exists) return true;
    const auto& [occlusion, shadow, corners, cell_size, occlusion_strength, shadow_strength] = field.light.value.grid;
    int64_t num_corners = 2;  // of the cells, each of which has two for a grid, and behind the last one
    if ((float)occlusion_strength > 0.0f) num_corners += 2 * occlusion.size();
    if ((float)shadow_strength > 0.0f) num_corners += 2 * shadow.size();
    return corners.shape[0] == 0 || corners.shape[0] >= num_corners;
}

inline bool is_complete(const LayerBricks& bricks) {
    if (bricks.fields.shape[0] < 1 || !match(bricks.is_mean, bricks.boxes)) return false;
    for (int64_t number = 0; number < bricks.fields.shape[0]; number++)
        if (!is_complete(bricks.fields[number], bricks.is_mean, number == 0)) return false;
    return true;
}
