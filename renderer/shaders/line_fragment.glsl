// A line one pixel wide: its opacity falls linearly to 0 at one pixel from its centre, round at the ends.

flat in vec4 line_px;
flat in vec2 line_alpha;
flat in vec3 line_color;
out vec4 color;

void main() {
    vec2 along = line_px.zw - line_px.xy, offset = gl_FragCoord.xy - line_px.xy;
    float square = dot(along, along);
    float share = square > 0.0 ? clamp(dot(offset, along) / square, 0.0, 1.0) : 0.0;
    float coverage = 1.0 - length(offset - share * along);
    if (coverage <= 0.0) discard;
    float alpha = coverage * mix(line_alpha.x, line_alpha.y, share);
    color = vec4(line_color * alpha, alpha);
}
