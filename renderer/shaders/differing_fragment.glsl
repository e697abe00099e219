// Which blocks between four nodes of a lattice are not to be interpolated.
uniform sampler2D image;
uniform float spread;            // nodes that differ by no more in any channel are alike

out float differs;

void main() {
    ivec2 low = ivec2(gl_FragCoord.xy), high = min(low + 1, textureSize(image, 0) - 1);
    vec4 a = texelFetch(image, low, 0);
    vec4 b = texelFetch(image, ivec2(high.x, low.y), 0);
    vec4 c = texelFetch(image, ivec2(low.x, high.y), 0);
    vec4 d = texelFetch(image, high, 0);
    vec4 range = max(max(a, b), max(c, d)) - min(min(a, b), min(c, d));
    differs = any(greaterThan(range, vec4(spread))) ? 1.0 : 0.0;
}
