// The share of a fog's colour that samples show by their depth. Each lane has a sample of its own.
#pragma once
#include "draw/sample.h"

// A fog, as it lies in a brick.
struct BrickFog {
    // The colour of the fog; null without fog.
    const float* color;
    // The change of the share per texel along x, y and z.
    float per_texel[3];
    // The share at texel 0.
    float origin;

    // Return the share of the fog's colour that the light of steps has. texel: the middles of the steps, in texels of the
    // brick. step: the vectors along the steps, in texels. depth: the optical depths of the steps.
    //
    // Light comes from nearer than the middle of a step, as matter hides matter behind it: from 1/2 - depth / 12 of the
    // step for small depths, and from its beginning for large ones.
    INLINE Floats share(const Three& texel, const Three& step, Floats depth) const {
        auto along = [&](const Three& v) { return fma(v.x, per_texel[0], fma(v.y, per_texel[1], v.z * per_texel[2])); };
        Floats nearer = min_of(in_all<Floats>(0.5f), depth / (depth + 12.0f));
        Floats found = along(texel) + origin - nearer * along(step);
        return min_of(max_of(in_all<Floats>(0.0f), found), in_all<Floats>(1.0f));
    }
};

// Return how the fog of layers lies in a brick.
INLINE BrickFog fog_in(const LayerBricks& bricks, const Box& box) {
    BrickFog found = {};
    if (!bricks.fog.exists) return found;
    const FogRamp& fog = bricks.fog.value;
    found.color = fog.color;
    double origin = fog.share;
    for (int axis = 0; axis < 3; axis++) {
        found.per_texel[axis] = (float)(fog.per_index[axis] / box.scale);
        origin += fog.per_index[axis] * (box.corner[axis] - TEXEL_OFFSET / box.scale);
    }
    found.origin = (float)origin;
    return found;
}
