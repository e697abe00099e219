// Compute the premultiplied colour of a Gaussian footprint at a pixel's centre (splats.GaussianFootprint).

uniform float cutoff;
uniform float decay;
uniform vec3 coefficients;
uniform float rim;
uniform vec2 corner_px;          // first column and row of the tile

flat in vec2 splat_px;
flat in vec3 splat_inverse;
flat in vec4 splat_color_depth;
out vec4 color;

void main() {
    vec2 offset = gl_FragCoord.xy + corner_px - splat_px;
    vec2 deviations = vec2(splat_inverse.x * offset.x, splat_inverse.y * offset.x + splat_inverse.z * offset.y);
    float square = dot(deviations, deviations);
    if (square > cutoff * cutoff) discard;
    float weight = exp(-decay * square) * (coefficients.x + square * (coefficients.y + square * coefficients.z));
    float alpha = opacity_of_depth(splat_color_depth.w * max(weight - rim, 0.0));  // rounding may make the difference negative
    color = vec4(splat_color_depth.rgb * alpha, alpha);
}
