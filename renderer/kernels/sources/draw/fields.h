// Sample the fields of layers in a brick, and classify and light the samples. Each lane has a sample of its own.
#pragma once
#include "draw/atlas.h"
#include "draw/faces.h"
#include "draw/mask.h"
#include "draw/surface.h"

// The kinds of bricks, by the meaning of their texels and by their light.
enum Kind {
    // Texels are (tau c, tau), which need no classification and no light.
    MEANS,
    // Texels are scalars, without light.
    UNLIT,
    // Texels are scalars, with light by Lambert's law from a fixed direction.
    LAMBERT,
    // Texels are scalars, with light as in the record Light.
    LIT,
    // Texels are scalars in matter that scatters light, whose surfaces reflect light.
    SURFACE,
    // Several layers have texels, each of one of the other kinds.
    SEVERAL,
};

// The positions of samples in a brick, one sample in each lane.
struct Places {
    // The cell of the sample.
    Cell cell;
    // The distance of the sample from the cell's lowest texel along each axis, from 0 to 1.
    Three shares;
    // The number of the sample along its ray; it may be fractional.
    Floats number;
    // The position of sample 0 of the ray, in texels.
    Three begin;
    // The way from one sample of the ray to the next, in texels: sample `number` is at `begin + number * step`.
    Three step;
    // The length of the segment for which the sample stands, in steps.
    Floats width;
    // Whether the sample counts.
    Mask active;
};

// The part of a field's lighting that is the same for all samples of a lane's ray in a brick.
struct Lighting {
    // The cut faces; null if none is near.
    const Faces* faces;
    // The directions to the light and to the viewer.
    Ways ways;
    // The position of texel 0 of the brick in the light grid, in cells along x, y, z.
    float origin[3];
    // The light in matter that scatters it, with which surfaces are lit.
    const BrickRadiance* radiance;
};

// Return the lighting of rays in a brick. direction: the direction of the rays in index space, of any length.
INLINE Lighting lighting_of(const Light& light, const Box& box, const Three& direction, const Faces* faces,
                            const BrickRadiance& radiance) {
    return {faces, aim(light, direction),
            {place_brick(light, box, 0), place_brick(light, box, 1), place_brick(light, box, 2)}, &radiance};
}

// Classified samples of a layer, one in each lane.
struct Classified {
    // The extinction and the colour of the sample.
    Sample sample;
    // A factor on the colour.
    Floats light;
    // Whether the sample shows anything.
    Mask visible;
};

// Return the positions of samples, in texels.
INLINE Three texels_of(const Places& places) {
    const auto& [cell, shares, number, begin, step, width, active] = places;
    return {fma(number, step.x, begin.x), fma(number, step.y, begin.y), fma(number, step.z, begin.z)};
}

// Return the places whose light the segments of samples show, in texels. way: the way along a segment of the width 1, in
// texels; `step` of Places is 0 on rays with one sample. depth: the optical depths of the segments. Even matter of the depth t is seen at 1 / t - 1 / (exp(t) - 1) of a segment, on average over the light that it scatters: in
// the middle if it is clear, and in front if it is opaque. At the middle of long segments, opaque matter would be dark.
INLINE Three seen_texels(const Places& places, const Three& way, Floats depth) {
    Floats of_clear = fma(depth, (float)(-1.0 / 12), 0.5f), of_dense = 1.0f / depth - 1.0f / opacity_of_depth(depth) + 1.0f;
    Floats share = where(mask_of(depth > 0.25f), of_dense, of_clear);
    Floats behind = (share - 0.5f) * places.width;
    auto [x, y, z] = texels_of(places);
    return {fma(behind, way.x, x), fma(behind, way.y, y), fma(behind, way.z, z)};
}

// The scalars of samples, one in each lane.
struct Scalars {
    // The eight texels around the sample.
    Corners corners;
    // The scalar, interpolated between the texels.
    Floats scalar;
    // Whether the sample may show anything.
    Mask visible;
};

// Return the scalars of a field at samples. texels, is_cut: as in `sample_field`.
INLINE Scalars scalars_at(const Field& field, const BrickTexels& texels, const Places& places, const Box& box, bool is_cut) {
    const Cell& cell = places.cell;
    Corners corners = load_corners(texels, cell);
    Floats scalar = field.is_labels ? labels_at(texels.words, cell.at(PADDED_BRICK_SIZE), places.shares, corners, places.active)
                                    : interpolate(corners, places.shares);
    Mask visible = places.active & mask_of(scalar >= field.pieces.lowest_visible);
    if (is_cut && any_of(visible)) visible = are_in_mask(field.mask.value.grid, box, texels_of(places), visible);
    return {corners, scalar, visible};
}

// Return the classified samples of a field. texels: the texels of the brick, and those after them. is_cut: whether the
// field's mask hides a part of the brick. follow: a function that is called with the Scalars of texels that are scalars.
template <Kind KIND, class Follow>
INLINE Classified sample_field(const Field& field, const LaneTable& table, const BrickTexels& texels, const Places& places,
                               const Lighting& lighting, const Box& box, bool is_cut, Follow follow) {
    const auto& [cell, shares, number, begin, step, width, active] = places;
    Classified found = {{}, in_all<Floats>(1.0f), active};
    if constexpr (KIND == MEANS) {
        if (is_cut) found.visible = are_in_mask(field.mask.value.grid, box, texels_of(places), active);
        found.sample = sample_rgba(texels.words, cell.at(PADDED_BRICK_SIZE), shares);
        found.visible &= mask_of(found.sample.tau > 0.0f);
        return found;
    }
    Scalars scalars = scalars_at(field, texels, places, box, is_cut);
    follow(scalars);
    found.visible = scalars.visible;
    if (!any_of(found.visible)) return found;
    found.sample = classify(table, scalars.scalar);
    found.visible &= mask_of(found.sample.tau > 0.0f);
    Mask are_divided = found.visible & ~are_all_present(scalars.corners);
    if (field.has_absent && any_of(are_divided)) {
        found.sample.tau *= share_of_data(texels.words, are_divided, places.number, begin, step, width);
        found.visible &= mask_of(found.sample.tau > 0.0f);
    }
    if (!any_of(found.visible)) return found;
    auto cut = [&](const auto& by_gradient, auto lit_of) __attribute__((always_inline)) {
        if (lighting.faces == nullptr) return by_gradient;
        auto [x, y, z] = texels_of(places);
        auto origin = [&](int axis) { return (float)(box.corner[axis] - TEXEL_OFFSET); };
        return with_faces(*lighting.faces, {x + origin(0), y + origin(1), z + origin(2)}, by_gradient, lit_of);
    };
    auto lit = [&](auto lit_of) __attribute__((always_inline)) { return cut(lit_of(gradient_at(texels, cell, shares)), lit_of); };
    if constexpr (KIND == LAMBERT) {
        Floats zero = in_all<Floats>(0.0f);
        auto lit_of = [&](const Three& slope) { return Lit{light_factor(slope, field.lambert), zero, zero}; };
        found.light = lit(lit_of).factor;
    }
    if constexpr (KIND == LIT) {
        const Light& light = field.light.value;
        Arriving arriving = arriving_shares(light, texels_of(places), lighting.origin);
        auto lit_of = [&](const Three& slope) { return lit_at(slope, lighting.ways, arriving, light.shading); };
        found.sample = illuminate(found.sample, lit(lit_of), light);
    }
    if constexpr (KIND == SURFACE) {
        Three gradient = gradient_at(texels, cell, shares);
        const Floats rise = rise_of_opacity(field, scalars.scalar, gradient);
        if (lighting.faces == nullptr && !any_of(found.visible & mask_of(rise != 0.0f))) {
            scatter(*lighting.radiance, texels_of(places), found.sample);
            return found;
        }
        // The light is that in the middle of the segment, where the gradient is: at the place of `seen_texels`, pictures of
        // an engine are 0.00 to 0.03 dB nearer to paths, at 38.9 dB, and take 2 % more time.
        const SurfacePoint point = surface_point(*lighting.radiance, texels_of(places), found.sample, lighting.ways.to_viewer,
                                                 found.visible);
        const Mask falls = mask_of(rise < 0.0f);
        auto turned = [&](Floats along) { return where(falls, -along, along); };
        gradient = {turned(gradient.x), turned(gradient.y), turned(gradient.z)};
        const Floats own_opacity = opacity_of_depth(OPACITY_SPACINGS * found.sample.tau);
        auto of_face = [&](const Three& slope) { return point.reflected(slope, own_opacity); };
        found.sample = point.shown(found.sample, cut(point.reflected(gradient, magnitude(rise)), of_face));
    }
    return found;
}

// Return the classified samples of a field, as above, without a function that is called.
template <Kind KIND>
INLINE Classified sample_field(const Field& field, const LaneTable& table, const BrickTexels& texels, const Places& places,
                               const Lighting& lighting, const Box& box, bool is_cut) {
    return sample_field<KIND>(field, table, texels, places, lighting, box, is_cut, [](const Scalars&) {});
}

// The layers of one grid of voxels that show anything in a brick. The caller owns the memory.
struct ShownLayers {
    // The bricks of all layers on this grid.
    const LayerBricks* bricks;
    // The transfer tables of all layers, shown or not.
    LaneTable* tables;
    // The fields of the layers that show anything in the brick.
    const Field** fields;
    // The transfer table of each of `fields`.
    const LaneTable** of_fields;
    // What finds the texels of each layer, shown or not.
    TexelFinder* finders;
    // What finds the texels of each of `fields`.
    TexelFinder** finders_of_fields;
    // The number of layers that show anything in the brick.
    int64_t num;
    // Whether the texels of the brick are means over all layers.
    bool is_mean;

    // Return whether the texels of a layer are (tau c, tau): means, or voxels that are colours.
    INLINE bool has_means(int64_t number) const { return is_mean || fields[number]->has_colors; }

    // Choose the layers that show anything in a brick. In a brick of means, the first field holds the means of all
    // layers.
    INLINE void choose(int64_t brick) {
        is_mean = bricks->is_mean[brick], num = 0;
        for (int64_t number = 0; number < (is_mean ? 1 : bricks->fields.shape[0]); number++) {
            if (offset_of(bricks->fields[number].voxels, brick) == NOTHING) continue;
            fields[num] = &bricks->fields[number], of_fields[num] = &tables[number];
            finders_of_fields[num] = &finders[number];
            num++;
        }
    }

    // Return whether the texels of a layer in a brick are there.
    INLINE bool has_texels(int64_t number, int64_t brick) const {
        return offset_of(fields[number]->voxels, brick) > NOTHING;
    }

    // Make the texels of a brick that are missing, as a ray meets it.
    INLINE void meet(int64_t brick) const {
        for (int64_t number = 0; number < num; number++) finders_of_fields[number]->meet(brick);
    }

    // Return the texels of a brick that a ray has met, and those after them.
    INLINE BrickTexels texels(int64_t number, int64_t brick) const {
        if (is_mean) return {rest_of(fields[number]->means, fields[number]->voxels.offsets[brick])};
        return finders_of_fields[number]->texels(brick);
    }

    // Return the factor from a sample's extinction to the extinction per model unit.
    INLINE float scale(int64_t number) const {
        return is_mean ? bricks->spacings_per_model_unit : bricks->spacings_per_model_unit * fields[number]->weight;
    }

    INLINE Kind kind(int64_t number) const {
        const Field& field = *fields[number];
        if (has_means(number)) return MEANS;
        return reflects() ? SURFACE : field.light.exists ? LIT : field.is_lit ? LAMBERT : UNLIT;
    }

    // Return whether surfaces in the brick reflect light. Means have no surfaces.
    INLINE bool reflects() const { return bricks->radiance.exists && bricks->radiance.value.surface.exists && !is_mean; }

    // Return whether the colours of samples are still to be multiplied by the mean radiance: samples whose surfaces
    // reflect light have been.
    INLINE bool are_albedos() const { return bricks->radiance.exists && !reflects(); }

    // Return whether a mask hides a part of a layer in a brick of voxels. In a brick of means it does not: they are made
    // from the voxels that the mask shows.
    INLINE bool is_cut(int64_t number, int64_t brick) const {
        const auto& mask = fields[number]->mask;
        return mask.exists && mask.value.are_cut[brick];
    }

    INLINE Faces all_faces() const { return {&bricks->rays.clip.value, 1.0 / bricks->face_depth}; }

    // Return the cut faces, `all`, if they light a layer in a brick; otherwise null.
    INLINE const Faces* faces(int64_t number, int64_t brick, const Faces& all) const {
        return bricks->have_faces[brick] && fields[number]->lights_faces ? &all : nullptr;
    }

    // Return whether all shown layers are classified, and none is lit.
    INLINE bool are_plain() const {
        for (int64_t number = 0; number < num; number++)
            if (kind(number) != UNLIT) return false;
        return true;
    }
};

// Memory for the shown layers of several groups, each of the layers on one grid of voxels. It is false if there is no
// memory.
struct ShownGroups {
    Buffer<LaneTable> tables;
    Buffer<const Field*> fields;
    Buffer<const LaneTable*> of_fields;
    Buffer<TexelFinder> finders;
    Buffer<TexelFinder*> finders_of_fields;
    // Memory in which missing texels are made.
    Buffer<double> scratch;
    // The texels of a brick of each layer, for which the atlas has no room.
    Buffer<float> own;
    Buffer<ShownLayers> groups;

    explicit ShownGroups(const Array<const LayerBricks, 1>& all)
        : tables(over_fields(all, [](int64_t num, const Field&) { return num + 1; })), fields(tables.shape[0]),
          of_fields(tables.shape[0]), finders(tables.shape[0]), finders_of_fields(tables.shape[0]),
          scratch(over_fields(all, [](int64_t size, const Field& each) { return most(size, scratch_size(each.voxels)); })),
          own(over_fields(all, [](int64_t size, const Field& each) { return size + own_size(each.voxels); })),
          groups(all.shape[0]) {
        if (!*this) return;
        int64_t first = 0, first_own = 0;
        for (int64_t number = 0; number < all.shape[0]; number++) {
            const auto& layers = all[number].fields;
            groups[number] = {&all[number], &tables.data[first], &fields.data[first], &of_fields.data[first],
                              &finders.data[first], &finders_of_fields.data[first], 0, false};
            for (int64_t k = 0; k < layers.shape[0]; k++) {
                int64_t size = own_size(layers[k].voxels);
                tables[first + k] = LaneTable(layers[k].pieces);
                finders[first + k] = {&layers[k].voxels, scratch.data, {own.data + first_own, {size}}, -1};
                first_own += size;
            }
            first += layers.shape[0];
        }
    }

    explicit operator bool() const {
        return tables && fields && of_fields && finders && finders_of_fields && scratch && own && groups;
    }

    // Return the last number of a series that begins with 0: `next(number, field)` follows a number, for each field.
    template <class Next>
    static int64_t over_fields(const Array<const LayerBricks, 1>& all, Next next) {
        int64_t found = 0;
        for (int64_t number = 0; number < all.shape[0]; number++)
            for (int64_t k = 0; k < all[number].fields.shape[0]; k++) found = next(found, all[number].fields[k]);
        return found;
    }
};

// Add a layer's classified samples to the sums, over all layers, of extinctions and of extinctions times colours.
INLINE void add_sample(Sample& sum, const Classified& found, float scale, bool is_mean) {
    Floats zero = in_all<Floats>(0.0f), tau = where(found.visible, found.sample.tau * scale, zero);
    Floats weight = is_mean ? where(found.visible, in_all<Floats>(scale), zero) : tau * found.light;
    sum.tau += tau;
    sum.r = fma(weight, found.sample.r, sum.r), sum.g = fma(weight, found.sample.g, sum.g);
    sum.b = fma(weight, found.sample.b, sum.b);
}

// Return the sums, over all layers, of extinctions and of extinctions times colours at samples.
//
// NUM: the number of layers, if all of them are classified and unlit; 0 for layers of any number and kind. If the number
// is known at compile time, tables stay in registers: two layers take 1.4 times as long as one, and otherwise 2.2 times.
template <int NUM>
INLINE Sample sum_of_layers(const ShownLayers& shown, int64_t brick, const Box& box,
                            const Places& places, [[maybe_unused]] const Three& direction,
                            [[maybe_unused]] const BrickRadiance& radiance) {
    Floats zero = in_all<Floats>(0.0f);
    Sample sum = {zero, zero, zero, zero};
    if constexpr (NUM > 0) {
#pragma clang loop unroll(full)
        for (int k = 0; k < NUM; k++)
            add_sample(sum, sample_field<UNLIT>(*shown.fields[k], *shown.of_fields[k], shown.texels(k, brick), places, {}, box, shown.is_cut(k, brick)),
                       shown.scale(k), false);
        return sum;
    }
    for (int64_t k = 0; k < shown.num; k++) {
        const Field& field = *shown.fields[k];
        const LaneTable& table = *shown.of_fields[k];
        BrickTexels texels = shown.texels(k, brick);
        Kind kind = shown.kind(k);
        bool is_cut = shown.is_cut(k, brick);
        const Faces all = shown.all_faces(), *faces = shown.faces(k, brick, all);
        auto lighting = [&] { return lighting_of(field.light.value, box, direction, faces, radiance); };
        Classified found = kind == MEANS ? sample_field<MEANS>(field, table, texels, places, {}, box, is_cut)
            : kind == UNLIT              ? sample_field<UNLIT>(field, table, texels, places, {}, box, is_cut)
            : kind == LAMBERT            ? sample_field<LAMBERT>(field, table, texels, places, {faces, {}, {}, {}}, box, is_cut)
            : kind == LIT ? sample_field<LIT>(field, table, texels, places, lighting(), box, is_cut)
                          : sample_field<SURFACE>(field, table, texels, places, lighting(), box, is_cut);
        if (any_of(found.visible)) add_sample(sum, found, shown.scale(k), kind == MEANS);
    }
    return sum;
}

// Return whether the texels of a field in a brick are in an atlas, or can be made.
inline bool can_be_drawn(const Field& field, int64_t brick, bool is_mean) {
    bool has_channels = is_mean || field.has_colors || field.light.exists || field.is_lit;
    int64_t num = (has_channels ? 4 : 1) * TEXELS_PER_BRICK + (has_channels || field.is_labels) * READ_BEHIND;
    if (!is_mean) return can_be_drawn(field.voxels, brick, num);
    int64_t offset = offset_of(field.voxels, brick);
    return offset == NOTHING || (offset >= 0 && offset <= field.means.shape[0] - num);
}

// Return whether the arrays of a field are large enough: for all bricks, for a piece of the transfer function for each
// scalar, and for all cells of the light grid.
inline bool is_complete(const Field& field, const Array<const bool, 1>& is_mean) {
    if (!match(field.voxels.offsets, is_mean) || !is_consistent(field.voxels)) return false;
    bool is_lit = field.light.exists || field.is_lit, needs_numbers = field.is_labels || field.has_absent || field.has_colors;
    if (!have(field.voxels, is_lit, needs_numbers)) return false;
    const auto& [rows, guide, lowest_visible, opacities] = field.pieces;
    int64_t num = rows.shape[0];
    if (num < 1 || rows.shape[1] != PIECE_FLOATS || guide.shape[0] != GUIDE_SIZE) return false;
    if (rows(num - 1, 0) < INFINITE || opacities.shape[0] != GUIDE_SIZE + 1) return false;
    for (int64_t bucket = 0; bucket < GUIDE_SIZE; bucket++)
        if (guide[bucket] < 0 || guide[bucket] >= num) return false;
    if (field.mask.exists && !(field.mask.value.grid.planes.size() > 0 && match(field.mask.value.are_cut, is_mean)))
        return false;
    if (!field.light.exists) return true;
    const auto& [occlusion, shadow, corners, cell_size, occlusion_strength, shadow_strength] = field.light.value.grid;
    int64_t num_corners = 2;  // two for each cell of each grid, and two more
    if ((float)occlusion_strength > 0.0f) num_corners += 2 * occlusion.size();
    if ((float)shadow_strength > 0.0f) num_corners += 2 * shadow.size();
    return corners.shape[0] == 0 || corners.shape[0] >= num_corners;
}

// Return whether the arrays of bricks fit together.
inline bool is_complete(const LayerBricks& bricks) {
    if (bricks.fields.shape[0] < 1 || !match(bricks.is_mean, bricks.boxes, bricks.have_faces)) return false;
    if (bricks.radiance.exists && !is_complete(bricks.radiance.value)) return false;
    const bool reflects = bricks.radiance.exists && bricks.radiance.value.surface.exists;
    for (int64_t number = 0; number < bricks.fields.shape[0]; number++) {
        const Field& field = bricks.fields[number];
        if (!is_complete(field, bricks.is_mean) || (reflects && !field.light.exists)) return false;
    }
    return true;
}

// Return whether the texels of a brick are in an atlas, or can be made, for all layers.
inline bool can_be_drawn(const LayerBricks& bricks, int64_t brick) {
    bool is_mean = bricks.is_mean[brick];
    for (int64_t number = 0; number < bricks.fields.shape[0]; number++)
        if (!can_be_drawn(bricks.fields[number], brick, is_mean && number == 0)) return false;
    return true;
}
