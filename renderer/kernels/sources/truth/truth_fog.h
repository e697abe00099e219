// The share of a fog's colour along rays, by its definition.
#pragma once
#include "truth/truth_layer.h"
#include "truth/kernels.h"

namespace truth {

// Return the light of a point of a ray in fog. s: the length along the ray up to the point.
INLINE Color in_fog(const Maybe<RayFog>& fog, int64_t ray, double s, Color light) {
    if (!fog.exists) return light;
    const RayFog& of = fog.value;
    const double share = least(most(0.0, of.shares(ray, 0) + s * of.shares(ray, 1)), 1.0);
    return lerp(light, Color{of.color[0], of.color[1], of.color[2]}, share);
}

// Return whether there is a share for each of some rays.
inline bool fit(const Maybe<RayFog>& fog, int64_t num_rays) { return !fog.exists || fog.value.shares.shape[0] == num_rays; }

}  // namespace truth
