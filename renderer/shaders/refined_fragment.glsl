// A finer lattice from a coarser one: nodes of the coarse one stay, and what lies between four that are alike is
// interpolated; the rest is cleared, and its depth is far, so that it is drawn.
uniform sampler2D coarse;
uniform int ratio;               // of the strides
uniform float spread;            // nodes that differ by no more are alike

out vec4 color;

void main() {
    ivec2 node = ivec2(gl_FragCoord.xy);
    ivec2 low = node / ratio, part = node - low * ratio;
    ivec2 high = min(low + 1, textureSize(coarse, 0) - 1);
    vec4 a = texelFetch(coarse, low, 0);
    vec4 b = texelFetch(coarse, ivec2(high.x, low.y), 0);
    vec4 c = texelFetch(coarse, ivec2(low.x, high.y), 0);
    vec4 d = texelFetch(coarse, high, 0);
    vec4 range = max(max(a, b), max(c, d)) - min(min(a, b), min(c, d));
    bool is_drawn = any(greaterThan(range, vec4(spread))) && any(notEqual(part, ivec2(0)));
    vec2 share = vec2(part) / float(ratio);
    color = is_drawn ? vec4(0.0) : mix(mix(a, b, share.x), mix(c, d, share.x), share.y);
    gl_FragDepth = is_drawn ? 1.0 : 0.0;
}
