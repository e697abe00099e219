// Light the faces that clip planes and boxes cut, as the scene's key `cut_faces` (ShadingSpec) says. Each lane has a sample
// of its own.
#pragma once
#include "draw/light.h"

// The cut faces near a brick.
struct Faces {
    // The planes and boxes that clip the volume.
    const ClipRegion* clip;
    // The reciprocal of the distance from a face within which samples are lit by the face's normal, in units of the world.
    double per_length;
};

// Call `take(weight, normal)` for each plane or box that clips the volume near the samples. weight: how much of the light
// at a sample is that of the face, from 0 to 1. normal: the vector towards the face, in the world, of any length. at: the
// samples' positions in index space, from the volume's centre.
template <class Take>
INLINE void for_faces(const Faces& faces, const Three& at, Take take) {
    Floats zero = in_all<Floats>(0.0f);
    auto scaled = [&](double x) { return (float)(x * faces.per_length); };
    auto height = [&](const auto& slab) {
        return fma(scaled(slab[0]), at.x, fma(scaled(slab[1]), at.y, scaled(slab[2]) * at.z));
    };
    auto along = [&](const auto& slab, Floats length) {
        return Three{length * (float)slab[5], length * (float)slab[6], length * (float)slab[7]};
    };
    auto take_near = [&](Floats squared_distance, const Three& normal) {
        Floats rest = max_of(zero, 1.0f - squared_distance);
        if (any_of(mask_of(rest > 0.0f))) take(rest * rest * rest, normal);
    };
    for (int64_t k = 0; k < faces.clip->slabs.shape[0]; k++) {
        auto slab = faces.clip->slabs[k];
        Floats of_slab = height(slab), one = zero + 1.0f;
        for (int end = 0; end < 2; end++) {
            if (__builtin_isinf(slab[3 + end])) continue;
            Floats inside = max_of(zero, (of_slab - scaled(slab[3 + end])) * (end ? -1.0f : 1.0f));
            take_near(inside * inside, along(slab, end ? one : -one));
        }
    }
    for (int64_t box = 0; box < faces.clip->boxes.shape[0]; box++) {
        Three toward = {zero, zero, zero};
        for (int axis = 0; axis < 3; axis++) {
            auto slab = faces.clip->boxes[box][axis];
            Floats of_slab = height(slab), outside = max_of(zero, scaled(slab[3]) - of_slab);
            auto [x, y, z] = along(slab, outside - max_of(zero, of_slab - scaled(slab[4])));
            toward = {toward.x + x, toward.y + y, toward.z + z};
        }
        take_near(dot(toward, toward), toward);
    }
}

// Return the light at samples: the light by the gradient, mixed with the light by the normals of cut faces near the sample.
// lit: the light by the gradient. lit_of: a function that returns the light for a gradient.
template <class Light, class LitOf>
INLINE Light with_faces(const Faces& faces, const Three& at, const Light& lit, LitOf lit_of) {
    Floats zero = in_all<Floats>(0.0f), rest = zero + 1.0f, sum = zero;
    Light of_faces = {};
    for_faces(faces, at, [&](Floats weight, const Three& normal) {
        of_faces = of_faces.plus(weight, lit_of(Three{-normal.x, -normal.y, -normal.z}));
        rest *= 1.0f - weight, sum += weight;
    });
    Floats share = where(mask_of(sum > 0.0f), (1.0f - rest) / sum, zero);
    return Light{}.plus(share, of_faces).plus(rest, lit);
}
