// (tau c, tau) at a place of the atlas of means.
uniform sampler3D atlas;
uniform float depth_of_mean;     // 1 / model unit for a stored mean

vec4 look_up(vec3 texel) {
    return depth_of_mean * textureLod(atlas, texel, 0.0);
}
