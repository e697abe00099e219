// One point, or one quad of two triangles where the driver's points are too small, over the rectangle of a brick's box.

uniform bool quads;
uniform float stride_px;         // between the nodes of the lattice that is drawn
uniform vec2 num_nodes;          // along both axes

in vec4 rectangle_px;            // left, top, right, bottom
in vec3 box_low;                 // index coordinates relative to the volume's centre
in vec3 box_high;
in vec3 first_corner;            // of the brick, there too
in vec3 first_texel;             // of the brick's first cell in its atlas
in vec3 kind;                    // cells per voxel; longest step in cells; 1 for the atlas of means, 0 for that of scalars

flat out vec3 brick_low;
flat out vec3 brick_high;
flat out vec3 brick_corner;
flat out vec3 brick_texel;
flat out vec3 brick_kind;

void main() {
    brick_low = box_low;
    brick_high = box_high;
    brick_corner = first_corner;
    brick_texel = first_texel;
    brick_kind = kind;
    // Half a pixel more, for rounding. Node 0 is at the centre of pixel 0, which on its lattice is at 1/2, too.
    vec2 low = clamp(floor((rectangle_px.xy - 1.0) / stride_px + 0.5), vec2(0.0), num_nodes);
    vec2 high = clamp(ceil(rectangle_px.zw / stride_px + 0.5), vec2(0.0), num_nodes);
    vec2 place = 0.5 * (low + high);
    gl_PointSize = max(high.x - low.x, high.y - low.y) + 1.0;
    if (quads) {
        int corner = gl_VertexID % 6;
        vec2 side = vec2(corner == 1 || corner == 2 || corner == 4, corner == 2 || corner == 4 || corner == 5);
        place = mix(low, high, side);
    }
    gl_Position = vec4(2.0 * place / num_nodes - 1.0, 0.0, 1.0);
}
