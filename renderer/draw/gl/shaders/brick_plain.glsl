// Return (tau c, tau) at a position in the atlas of scalars.
uniform sampler3D atlas;
uniform float spacings_per_model_unit;  // 1 / model unit for 1 / finest spacing

vec4 look_up(vec3 texel) {
    vec4 field = classify(textureLod(atlas, texel, 0.0).r);
    return spacings_per_model_unit * field.a * vec4(field.rgb, 1.0);
}
