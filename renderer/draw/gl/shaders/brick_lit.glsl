// Return (tau c, tau) at a position in the atlas of scalars and gradients, lit by Lambert's law.
uniform sampler3D atlas;         // the scalar, and its gradient in the world, scaled
uniform float spacings_per_model_unit;  // 1 / model unit for 1 / finest spacing
uniform vec3 light;              // to the light, unit length
uniform vec2 ambient_diffuse;

vec4 look_up(vec3 texel) {
    vec4 inside = textureLod(atlas, texel, 0.0);
    vec4 field = classify(inside.r);
    float largest = max(abs(inside.y), max(abs(inside.z), abs(inside.w)));
    float lit = ambient_diffuse.x;
    if (largest > 0.0) lit += ambient_diffuse.y * max(0.0, -dot(normalize(inside.yzw / largest), light));
    return spacings_per_model_unit * field.a * vec4(field.rgb * lit, 1.0);
}
