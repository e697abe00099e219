// Place one point around each footprint, or one quad of two triangles if the splat is larger than the driver's points.

uniform bool quads;
uniform float cutoff;            // radius of the footprint, in standard deviations

flat out vec2 splat_px;
flat out vec3 splat_inverse;     // xx, yx, yy of the lower triangular matrix from pixels to standard deviations
flat out vec4 splat_color_depth; // colour, optical depth at weight 1

void main() {
    Footprint footprint = project();
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    gl_PointSize = 1.0;
    splat_px = vec2(0.0);
    splat_inverse = vec3(0.0);
    splat_color_depth = vec4(0.0);
    if (!footprint.visible) return;

    vec3 root = footprint.root;
    splat_px = footprint.center_px;
    splat_inverse = vec3(1.0, -root.y / root.z, root.x / root.z) / root.x;
    splat_color_depth = vec4(areas.rgb / areas.w, footprint.unit_depth);

    // Half a pixel more, so that rounding the corners loses no pixel.
    vec2 reach_px = cutoff * vec2(root.x, length(root.yz)) + 0.5;
    vec2 in_tile_px = splat_px - corner_px;
    vec2 low = in_tile_px - reach_px, high = in_tile_px + reach_px;
    if (any(lessThan(high, vec2(0.0))) || any(greaterThan(low, tile_px))) return;
    vec2 at_px;
    if (quads) {
        int corner = gl_VertexID % 6;
        vec2 side = vec2(corner == 1 || corner == 2 || corner == 4, corner == 2 || corner == 4 || corner == 5);
        at_px = clamp(mix(low, high, side), vec2(0.0), tile_px);
    } else {
        // GL drops a point whose centre is outside the tile: it moves to the border, where its square still covers the
        // visible part of the footprint.
        at_px = clamp(in_tile_px, vec2(0.0), tile_px);
        gl_PointSize = 2.0 * max(reach_px.x, reach_px.y);
    }
    gl_Position = vec4(2.0 * at_px / tile_px - 1.0, 0.0, 1.0);
}
