// Make a finer grid from a coarser one. Pixels of the coarse grid stay, and blocks between four similar ones are
// interpolated. The rest is cleared and drawn: its depth is far.
uniform sampler2D coarse;        // linear between its pixels
uniform sampler2D refinement_mask;  // by block, at its lowest pixel: above 0 where it is drawn
uniform int shift;               // 2^shift is the ratio of the strides

out vec4 color;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    ivec2 block = pixel >> shift, offset = pixel - (block << shift);
    bool is_drawn = texelFetch(refinement_mask, block, 0).r > 0.0 && any(notEqual(offset, ivec2(0)));
    vec2 position = (vec2(pixel) / float(1 << shift) + 0.5) / vec2(textureSize(coarse, 0));
    color = is_drawn ? vec4(0.0) : textureLod(coarse, position, 0.0);
    gl_FragDepth = is_drawn ? 1.0 : 0.0;
}
