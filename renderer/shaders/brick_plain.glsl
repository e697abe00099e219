// (tau c, tau) at a place of the atlas of scalars.
uniform sampler3D atlas;
uniform sampler2D table;         // (tau c, tau), 1 / model unit
uniform vec2 entry_of_texel;     // factor and offset from a scalar's texel to the table's coordinate

vec4 look_up(vec3 texel) {
    float entry = textureLod(atlas, texel, 0.0).r * entry_of_texel.x + entry_of_texel.y;
    return textureLod(table, vec2(entry, 0.5), 0.0);
}
