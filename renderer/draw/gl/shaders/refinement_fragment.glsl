// Mark the blocks between four pixels of a grid that are not interpolated.
uniform sampler2D image;
uniform float difference_threshold;

out float is_refined;

ivec2 last;

vec4 pixel(ivec2 at) {
    return texelFetch(image, clamp(at, ivec2(0), last), 0);
}

// Twice the distance of b from the line between its neighbours.
vec4 bend(vec4 a, vec4 b, vec4 c) {
    return abs(a - 2.0 * b + c);
}

// The larger of the bends at a pixel along its row and its column.
vec4 bend_at(ivec2 at, vec4 here) {
    vec4 along_row = bend(pixel(at - ivec2(1, 0)), here, pixel(at + ivec2(1, 0)));
    return max(along_row, bend(pixel(at - ivec2(0, 1)), here, pixel(at + ivec2(0, 1))));
}

void main() {
    last = textureSize(image, 0) - 1;
    ivec2 low = ivec2(gl_FragCoord.xy), high = low + 1;
    ivec2 right = ivec2(high.x, low.y), below = ivec2(low.x, high.y);
    vec4 a = pixel(low), b = pixel(right), c = pixel(below), d = pixel(high);
    vec4 range = max(max(a, b), max(c, d)) - min(min(a, b), min(c, d));
    is_refined = 0.0;
    if (any(greaterThan(range, vec4(difference_threshold)))) {
        vec4 bends = max(max(bend_at(low, a), bend_at(right, b)), max(bend_at(below, c), bend_at(high, d)));
        if (any(greaterThan(bends, vec4(difference_threshold)))) is_refined = 1.0;
    }
}
