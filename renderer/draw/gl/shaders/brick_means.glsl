// (tau c, tau) at a place of the atlas of means.
uniform sampler3D atlas;
uniform float depth_of_spacing;  // 1 / model unit for 1 / finest spacing

vec4 look_up(vec3 texel) {
    return depth_of_spacing * textureLod(atlas, texel, 0.0);
}
