// (tau c, tau) at a place of the atlas of means, for pictures that have bricks of them: others are drawn faster without.
#define WITH_MEANS

uniform sampler3D means;
uniform vec3 mean_scale;         // 1 / texels of the atlas
uniform float depth_of_mean;     // 1 / model unit for a stored mean

vec4 mean_at(vec3 texel) {
    return depth_of_mean * textureLod(means, texel * mean_scale, 0.0);
}
