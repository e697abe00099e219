// Make a finer grid from a coarser one. Pixels of the coarse grid stay, and blocks between four similar ones are
// interpolated. The rest is cleared and drawn: its depth is far.
uniform sampler2D coarse;        // linear between its pixels
uniform int shift;               // 2^shift is the ratio of the strides
uniform float difference_threshold;

out vec4 color;

ivec2 last;

vec4 pixel(ivec2 at) {
    return texelFetch(coarse, clamp(at, ivec2(0), last), 0);
}

// The larger of twice the distances of a pixel from the lines between its neighbours along its row and its column.
vec4 bend_at(ivec2 at, vec4 here) {
    vec4 along_row = abs(pixel(at - ivec2(1, 0)) - 2.0 * here + pixel(at + ivec2(1, 0)));
    return max(along_row, abs(pixel(at - ivec2(0, 1)) - 2.0 * here + pixel(at + ivec2(0, 1))));
}

// Return whether the four pixels around a block differ and bend too much for it to be interpolated.
bool is_refined(ivec2 low) {
    ivec2 high = low + 1, right = ivec2(high.x, low.y), below = ivec2(low.x, high.y);
    vec4 a = pixel(low), b = pixel(right), c = pixel(below), d = pixel(high);
    vec4 range = max(max(a, b), max(c, d)) - min(min(a, b), min(c, d));
    if (!any(greaterThan(range, vec4(difference_threshold)))) return false;
    vec4 bends = max(max(bend_at(low, a), bend_at(right, b)), max(bend_at(below, c), bend_at(high, d)));
    return any(greaterThan(bends, vec4(difference_threshold)));
}

void main() {
    last = textureSize(coarse, 0) - 1;
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 block = at >> shift, offset = at - (block << shift);
    bool is_drawn = any(notEqual(offset, ivec2(0))) && is_refined(block);
    vec2 position = (vec2(at) / float(1 << shift) + 0.5) / vec2(textureSize(coarse, 0));
    color = is_drawn ? vec4(0.0) : textureLod(coarse, position, 0.0);
    gl_FragDepth = is_drawn ? 1.0 : 0.0;
}
