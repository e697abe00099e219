// A line one pixel wide: its opacity falls linearly to 0 at one pixel from its centre, round at the ends.

flat in vec4 line_px;
flat in vec2 line_side_px;
flat in vec4 line_color_cover;
out vec4 color;

void main() {
    vec2 along = line_px.zw - line_px.xy, offset = gl_FragCoord.xy - line_px.xy;
    float square = dot(along, along);
    float share = square > 0.0 ? clamp(dot(offset, along) / square, 0.0, 1.0) : 0.0;
    float coverage = 1.0 - length(offset - share * along);
    float side_px = mix(line_side_px.x, line_side_px.y, share);  // inverse depth is linear on the image
    if (coverage <= 0.0 || side_px < MIN_SIDE_PX) discard;
    float alpha = coverage * min(line_color_cover.w * side_px, LINE_OPACITY);
    color = vec4(line_color_cover.rgb * alpha, alpha);
}
