// (tau c, tau) at a place of the atlas of scalars and gradients, lit by Lambert's law.
uniform sampler3D atlas;         // the scalar, and its gradient in the world times any factor
uniform sampler2D table;         // (tau c, tau), 1 / model unit
uniform vec2 entry_of_texel;     // factor and offset from a scalar's texel to the table's coordinate
uniform vec3 light;              // to the light, unit length
uniform vec2 ambient_diffuse;

vec4 look_up(vec3 texel) {
    vec4 field = textureLod(atlas, texel, 0.0);
    vec4 extinction = textureLod(table, vec2(field.r * entry_of_texel.x + entry_of_texel.y, 0.5), 0.0);
    float largest = max(abs(field.y), max(abs(field.z), abs(field.w)));
    float lit = ambient_diffuse.x;
    if (largest > 0.0) lit += ambient_diffuse.y * max(0.0, -dot(normalize(field.yzw / largest), light));
    return vec4(extinction.rgb * lit, extinction.a);
}
