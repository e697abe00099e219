// A finer lattice from a coarser one: nodes of the coarse one stay, and what lies between four that are alike is
// interpolated; the rest is cleared, and its depth is far, so that it is drawn.
uniform sampler2D coarse;        // linear between its nodes
uniform sampler2D refinement_mask;     // by block, named by its lowest node: above 0 where its four nodes differ
uniform int shift;               // 2^shift is the ratio of the strides

out vec4 color;

void main() {
    ivec2 node = ivec2(gl_FragCoord.xy);
    ivec2 block = node >> shift, part = node - (block << shift);
    bool is_drawn = texelFetch(refinement_mask, block, 0).r > 0.0 && any(notEqual(part, ivec2(0)));
    vec2 place = (vec2(node) / float(1 << shift) + 0.5) / vec2(textureSize(coarse, 0));
    color = is_drawn ? vec4(0.0) : textureLod(coarse, place, 0.0);
    gl_FragDepth = is_drawn ? 1.0 : 0.0;
}
