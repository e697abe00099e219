// Light the surfaces of matter that scatters light. Each lane has a sample of its own.
//
// A sample of albedo a, in mean radiance phi, is a surface to the share w, and shows
//
//     (1 - w) a phi + w (c E(n) / pi + highlights)
//
// c is the reflectance of surfaces of the albedo, with which opaque matter shows the same colour as without surfaces in even
// light. E(n) is the irradiance of a plane whose normal is n. The share w is the scene's share times the change of opacity between the points one finest spacing before and behind the sample along the
// gradient, with OPACITY_SPACINGS as the length that is opaque; n points to less opacity. Of labels, the change is LABEL_GAIN times the gradient of smoothed opacities. A face
// that clipping cuts is a surface between nothing and the sample's opacity. The truth has the same definition
// (renderer/kernels/sources/truth/truth_surface.h).
#pragma once
#include "draw/faces.h"
#include "draw/radiance.h"

// The factor on the gradient of the smoothed opacities of labels, over the finest spacing. It is 5/16 beside a flat border
// between nothing and an opaque label.
constexpr float LABEL_GAIN = 3.2f;
// The length, in finest spacings, whose opacity tells surfaces, as in renderer/transfer/piecewise.py.
constexpr float OPACITY_SPACINGS = 4.0f;

// The light that surfaces reflect, one in each lane.
struct Reflected {
    // The share of the sample that is a surface.
    Floats share;
    // The light of this share, red, green, blue.
    Three light;

    // Return the sum of this light and a share of another.
    INLINE Reflected plus(Floats part, const Reflected& other) const {
        return {fma(part, other.share, share),
                {fma(part, other.light.x, light.x), fma(part, other.light.y, light.y), fma(part, other.light.z, light.z)}};
    }
};

// The light at samples on surfaces.
struct SurfacePoint {
    const SurfaceCells& cells;
    // The mean radiance.
    Three radiance;
    // The mean radiance, without the key light that arrives straight.
    Three scattered;
    // The numbers of cells: the mean radiance, the share of the key light, and the flux along x (r, g, b), y and z.
    ManyNumbers numbers;
    // The share of the key light that arrives straight.
    Floats key_share;
    // The reflectance of surfaces of the sample's albedo.
    Three reflectance;
    // The unit vector halfway between the directions to the key light and to the viewer.
    Three halfway;

    INLINE Floats flux_of(int axis, int channel) const {
        const int number = 4 + 3 * axis + channel;
        const auto& [a, b, c, d] = numbers.fours[number / 4];
        return number % 4 == 0 ? a : number % 4 == 1 ? b : number % 4 == 2 ? c : d;
    }

    // Return the light that a surface reflects. gradient: a vector against the normal, of any length. change: the change
    // of opacity, from 0 to 1.
    INLINE Reflected reflected(const Three& gradient, Floats change) const {
        const Floats zero = in_all<Floats>(0.0f);
        Floats largest = max_of(max_of(magnitude(gradient.x), magnitude(gradient.y)), magnitude(gradient.z));
        const Mask is_steep = mask_of(largest > FLAT);
        Floats scale = where(is_steep, -1.0f / largest, zero);  // so that squares neither overflow nor vanish
        Three normal = {gradient.x * scale, gradient.y * scale, gradient.z * scale};
        scale = where(is_steep, 1.0f / root(dot(normal, normal)), zero);
        normal = {normal.x * scale, normal.y * scale, normal.z * scale};
        auto along = [&](const float (&way)[3]) { return fma(normal.x, way[0], fma(normal.y, way[1], normal.z * way[2])); };
        const Floats to_key = max_of(zero, along(cells.key));
        Floats shine = zero;
        const Mask is_lit = mask_of(to_key > 0.0f);
        if (cells.specular > 0.0f && any_of(is_lit)) {
            shine = power(max_of(zero, dot(normal, halfway)), cells.shininess) * cells.specular;
            shine = where(is_lit, shine * key_share, zero);
        }
        const Floats share = where(is_steep, cells.share * change, zero), of_key = key_share * to_key;
        auto shown = [&](int channel, Floats around, Floats factor) {
            Floats across = fma(normal.x, flux_of(0, channel), fma(normal.y, flux_of(1, channel), normal.z * flux_of(2, channel)));
            Floats irradiance = fma(of_key, cells.key_light[channel], max_of(zero, fma(2.0f, across, around)));
            return share * fma(factor, irradiance, shine * cells.key_light[channel]);
        };
        const auto& [red, green, blue] = scattered;
        return {share, {shown(0, red, reflectance.x), shown(1, green, reflectance.y), shown(2, blue, reflectance.z)}};
    }

    // Return a sample, whose colour is its albedo, with the light that it shows. reflected: the light of its surfaces.
    INLINE Sample shown(Sample sample, const Reflected& reflected) const {
        const Floats rest = 1.0f - reflected.share;
        sample.r = fma(rest * sample.r, radiance.x, reflected.light.x);
        sample.g = fma(rest * sample.g, radiance.y, reflected.light.y);
        sample.b = fma(rest * sample.b, radiance.z, reflected.light.z);
        return sample;
    }
};

// Return the reflectance of surfaces of matter of an albedo, as `surface_reflectance` (renderer/transfer/albedos.py) does.
INLINE Floats surface_reflectance(Floats albedo) {
    const Floats s = root(max_of(in_all<Floats>(0.0f), 1.0f - albedo));
    return fma(s, -0.139f, 1.0f) * (1.0f - s) * fma(s, 1.68f, 1.0f) / fma(s, 1.17f, 1.0f);
}

// Return the light at samples. texel: their positions in the brick, in texels. sample: their albedos. to_viewer: the unit
// vectors to the viewer. needed: the samples that count.
INLINE SurfacePoint surface_point(const BrickRadiance& radiance, const Three& texel, const Sample& sample,
                                  const Three& to_viewer, Mask needed) {
    const SurfaceCells& cells = radiance.grid->surface.value;
    const ManyNumbers numbers = look_up_all(radiance.grid->cells, place_in(radiance, texel), needed);
    const auto& [red, green, blue, share] = numbers.fours[0];
    auto rest = [&](Floats all, int channel) { return fma(share, -0.25f * cells.key_light[channel], all); };
    Three halfway = {to_viewer.x + cells.key[0], to_viewer.y + cells.key[1], to_viewer.z + cells.key[2]};
    const Floats length = root(dot(halfway, halfway));
    const Floats scale = where(mask_of(length > 0.0f), 1.0f / length, in_all<Floats>(0.0f));
    halfway = {halfway.x * scale, halfway.y * scale, halfway.z * scale};
    return {
        cells, {red, green, blue}, {rest(red, 0), rest(green, 1), rest(blue, 2)},
        numbers, share,
        {surface_reflectance(sample.r), surface_reflectance(sample.g), surface_reflectance(sample.b)}, halfway,
    };
}

// Return the change of opacity at samples of a field along the gradient; below 0 if opacity falls with the scalar.
INLINE Floats rise_of_opacity(const Field& field, Floats scalar, const Three& gradient) {
    const Floats change = root(dot(gradient, gradient)) * field.light.value.change_per_length;
    if (field.is_labels) return min_of(in_all<Floats>(1.0f), LABEL_GAIN * change);
    auto opacity_at = [&](Floats at) {
        const Floats place = min_of(max_of(in_all<Floats>(0.0f), at * (float)GUIDE_SIZE), in_all<Floats>((float)GUIDE_SIZE));
        const Ints low = min_of(to_int32(place), in_all<Ints>(GUIDE_SIZE - 1));
        Floats one, next;
        load_pairs(field.pieces.opacities, low, one, next);
        return lerp(place - to_float32(low), one, next);
    };
    return opacity_at(scalar + change) - opacity_at(scalar - change);
}
