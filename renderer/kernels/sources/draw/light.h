// Compute light and extinction that depend on the view or on the length of the gradient. Each lane has a sample of its own.
//
// Light by Lambert's law from a fixed direction is `light_factor` in sample.h instead, which costs less time.
#pragma once
#include "draw/sample.h"

// A gradient counts as 0 if all of its components are at most this, so that the reciprocal of its length is finite; the
// largest gradients are about 1 long.
constexpr float FLAT = 0x1p-120f;

INLINE Floats dot(const Three& one, const Three& other) {
    return fma(one.x, other.x, fma(one.y, other.y, one.z * other.z));
}

// The directions that light depends on: unit vectors in the world, one in each lane.
struct Ways {
    // The direction to the light.
    Three to_light;
    // The direction halfway between the light and the viewer; 0 if they are opposite.
    Three to_halfway;
    // The direction to the viewer.
    Three to_viewer;
};

// Return the directions for rays. direction: the direction of the rays in index space, of any length.
INLINE Ways aim(const Light& light, const Three& direction) {
    auto along = [&](const float* row) {
        return -dot(direction, {in_all<Floats>(row[0]), in_all<Floats>(row[1]), in_all<Floats>(row[2])});
    };
    const auto& rows = light.world_from_index;
    Floats x = along(rows), y = along(rows + 3), z = along(rows + 6), length = root(dot({x, y, z}, {x, y, z}));
    x = x / length, y = y / length, z = z / length;
    if (light.is_camera) return {{x, y, z}, {x, y, z}, {x, y, z}};
    const auto& toward = light.toward;
    Three half = {x + toward[0], y + toward[1], z + toward[2]};
    length = root(dot(half, half));
    Floats zero = x * 0.0f, scale = where(mask_of(length > 0.0f), 1.0f / length, in_all<Floats>(0.0f));
    half = {half.x * scale, half.y * scale, half.z * scale};
    return {{zero + toward[0], zero + toward[1], zero + toward[2]}, half, {x, y, z}};
}

// Return the position of texel 0 of a brick in the light grid along an axis, in cells.
INLINE float place_brick(const Light& light, const Box& box, int axis) {
    return (float)(light.first_cell[axis] + 1.0 / light.grid.cell_size * (box.corner[axis] - TEXEL_OFFSET));
}

INLINE Floats byte_of(Ints four, int shift) { return to_float32((four >> shift) & 255); }

// Interpolate between eight shares, stored as bytes of which 255 is 1. near, far: four bytes each, packed into an integer.
INLINE Floats interpolate_bytes(Ints near, Ints far, const Three& shares) {
    auto face = [&](Ints four) {
        return lerp(shares.y, lerp(shares.x, byte_of(four, 0), byte_of(four, 8)),
                    lerp(shares.x, byte_of(four, 16), byte_of(four, 24)));
    };
    return lerp(shares.z, face(near), face(far)) * (float)(1.0 / 255);
}

// The shares of the ambient and of the diffuse light that reach samples.
struct Arriving {
    Floats ambient, diffuse;
};

// Return the shares of the light that reach samples. texel: the positions of samples in a brick, in texels. origin: the
// position of texel 0 in the light grid along each axis, from `place_brick`.
INLINE Arriving arriving_shares(const Light& light, const Three& texel, const float (&origin)[3]) {
    Arriving shares = {texel.x * 0.0f + 1.0f, texel.x * 0.0f + 1.0f};
    const LightGrid& grid = light.grid;
    if (grid.corners.shape[0] > 0) {
        float occlusion_strength = (float)grid.occlusion_strength, shadow_strength = (float)grid.shadow_strength;
        const auto& nums = (occlusion_strength > 0.0f ? grid.occlusion : grid.shadow).shape;  // the number of cells along z, y, x
        auto place_along = [&](Floats along, int axis) {
            Floats place = max_of(in_all<Floats>(0.5f), fma(along, (float)(1.0 / grid.cell_size), origin[axis]));
            return min_of(place, in_all<Floats>((float)nums[2 - axis] - 1.5f));
        };
        Floats u = place_along(texel.x, 0), v = place_along(texel.y, 1), w = place_along(texel.z, 2);
        Ints i = to_int32(u), j = to_int32(v), k = to_int32(w);
        Ints at = (k * (int32_t)nums[1] + j) * (int32_t)nums[2] + i;
        Three inside = {u - to_float32(i), v - to_float32(j), w - to_float32(k)};
        int32_t num_numbers = 2 * ((occlusion_strength > 0.0f) + (shadow_strength > 0.0f));
        auto [near, far, next_near, next_far] = load_four(grid.corners, at * num_numbers);
        if (occlusion_strength > 0.0f) {
            shares.ambient = fma(occlusion_strength, interpolate_bytes(near, far, inside) - 1.0f, 1.0f);
            near = next_near, far = next_far;
        }
        if (shadow_strength > 0.0f)
            shares.diffuse = fma(shadow_strength, interpolate_bytes(near, far, inside) - 1.0f, 1.0f);
    }
    return shares;
}

// Return x^exponent for x from 0 to 1, and 0 for 0. The relative error is below 1e-5 for results above 1e-4.
// It is computed as exp(exponent ln x), with x = 2^e m and m from sqrt(1/2) to sqrt(2), and the series of artanh for ln
// m.
INLINE Floats power(Floats x, float exponent) {
    Ints bits = float32_to_bits(x);
    Ints e = (bits - 0x3F3504F3) >> 23;  // subtracts the bits of sqrt(1/2)
    Floats m = bits_to_float32(bits - (e << 23));
    Floats ratio = (m - 1.0f) / (m + 1.0f), square = ratio * ratio;
    Floats series = fma(square, fma(square, fma(square, 2.0f / 7.0f, 2.0f / 5.0f), 2.0f / 3.0f), 2.0f);
    Floats logarithm = fma(to_float32(e), LN_2, ratio * series), one, other;
    exp_factors(max_of(in_all<Floats>(0.0f), -logarithm * exponent), one, other);
    return where(mask_of(x > 0.0f), one * other, in_all<Floats>(0.0f));
}

// Return the factor on extinction for gradients of this length. factors: as in Light.
INLINE Floats factor_at(Floats length, const Array<const float, 2>& factors) {
    Floats factor = in_all<Floats>(factors(0, 1));
    for (int64_t k = 0; k < factors.shape[0]; k++)
        factor = where(mask_of(length >= factors(k, 0)), fma(length - factors(k, 0), factors(k, 2), factors(k, 1)),
                       factor);
    return factor;
}

// The light on samples, one in each lane.
struct Lit {
    // A factor on the colour.
    Floats factor;
    // The white light of the highlight, which is added to the colour.
    Floats shine;
    // The length of the gradient.
    Floats length;

    // Return the sum of this light and a share of another, with the gradient of the other.
    INLINE Lit plus(Floats share, const Lit& other) const {
        return {fma(share, other.factor, factor), fma(share, other.shine, shine), other.length};
    }
};

// Return the light for a gradient in texels: Lambert's law, highlights (Blinn 1977) and silhouettes.
INLINE Lit lit_at(const Three& gradient, const Ways& ways, const Arriving& arriving, const Shading& shading) {
    auto [x, y, z] = gradient;
    Floats zero = in_all<Floats>(0.0f), largest = max_of(magnitude(x), magnitude(y));
    largest = max_of(largest, magnitude(z));
    Mask is_steep = mask_of(largest > FLAT);
    Floats scale = where(is_steep, 1.0f / largest, zero);  // so that squares neither overflow nor vanish
    x = x * scale, y = y * scale, z = z * scale;
    Floats length = root(dot({x, y, z}, {x, y, z}));
    scale = where(is_steep, -1.0f / length, zero);
    Floats to_light = dot({x, y, z}, ways.to_light) * scale, to_halfway = dot({x, y, z}, ways.to_halfway) * scale;
    if (shading.two_sided) to_light = magnitude(to_light), to_halfway = magnitude(to_halfway);
    Floats lit = fma(max_of(zero, to_light), shading.diffuse * arriving.diffuse, shading.ambient * arriving.ambient);
    Floats shine = zero;
    if (shading.specular > 0.0f) {
        shine = power(max_of(zero, to_halfway), shading.shininess) * shading.specular * arriving.diffuse;
        shine = where(mask_of(to_light > 0.0f), shine, zero);
    }
    if (shading.silhouette > 0.0f) {
        Floats across = max_of(zero, 1.0f - magnitude(dot({x, y, z}, ways.to_viewer) * scale));
        Floats kept = where(is_steep, fma(across * across * across, -shading.silhouette, 1.0f), zero + 1.0f);
        lit *= kept, shine *= kept;
    }
    return {lit, shine, largest * length};
}

// Return samples with their light, and with the factor on extinction by the length of the gradient.
INLINE Sample illuminate(Sample sample, const Lit& lit, const Light& light) {
    sample.r *= lit.factor, sample.g *= lit.factor, sample.b *= lit.factor;
    if (light.shading.specular > 0.0f) sample.r += lit.shine, sample.g += lit.shine, sample.b += lit.shine;
    if (light.factors.shape[0] > 0) sample.tau *= factor_at(lit.length, light.factors);
    return sample;
}
