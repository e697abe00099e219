// Alpha of a Gaussian footprint at a pixel's centre, premultiplied (splats.GaussianFootprint).

uniform float cutoff;
uniform float decay;
uniform vec3 coefficients;

flat in vec2 splat_px;
flat in vec3 splat_conic;
flat in vec4 splat_color_depth;
out vec4 color;

void main() {
    vec2 offset = gl_FragCoord.xy - splat_px;
    float square = splat_conic.x * offset.x * offset.x + 2.0 * splat_conic.y * offset.x * offset.y
        + splat_conic.z * offset.y * offset.y;
    if (square > cutoff * cutoff) discard;
    float weight = exp(-decay * square) * (coefficients.x + square * (coefficients.y + square * coefficients.z));
    float alpha = opacity_of_depth(splat_color_depth.w * weight);
    color = vec4(splat_color_depth.rgb * alpha, alpha);
}
