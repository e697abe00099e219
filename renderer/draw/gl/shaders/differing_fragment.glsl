// Which blocks between four nodes of a lattice are not to be interpolated.
uniform sampler2D image;
uniform float spread;            // what differs by no more is alike

out float differs;

ivec2 last;

vec4 node(ivec2 at) {
    return texelFetch(image, clamp(at, ivec2(0), last), 0);
}

// How far b lies from the line between its neighbours, twice.
vec4 bend(vec4 a, vec4 b, vec4 c) {
    return abs(a - 2.0 * b + c);
}

// The most that a picture bends at a node, along rows or columns.
vec4 bend_at(ivec2 at, vec4 here) {
    vec4 along_row = bend(node(at - ivec2(1, 0)), here, node(at + ivec2(1, 0)));
    return max(along_row, bend(node(at - ivec2(0, 1)), here, node(at + ivec2(0, 1))));
}

void main() {
    last = textureSize(image, 0) - 1;
    ivec2 low = ivec2(gl_FragCoord.xy), high = low + 1;
    ivec2 right = ivec2(high.x, low.y), below = ivec2(low.x, high.y);
    vec4 a = node(low), b = node(right), c = node(below), d = node(high);
    vec4 range = max(max(a, b), max(c, d)) - min(min(a, b), min(c, d));
    differs = 0.0;
    if (any(greaterThan(range, vec4(spread)))) {
        vec4 bends = max(max(bend_at(low, a), bend_at(right, b)), max(bend_at(below, c), bend_at(high, d)));
        if (any(greaterThan(bends, vec4(spread)))) differs = 1.0;
    }
}
