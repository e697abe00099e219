// Return (tau c, tau) at a position in the atlas of means.
uniform sampler3D atlas;
uniform float spacings_per_model_unit;  // 1 / model unit for 1 / finest spacing

vec4 look_up(vec3 texel) {
    return spacings_per_model_unit * textureLod(atlas, texel, 0.0);
}
