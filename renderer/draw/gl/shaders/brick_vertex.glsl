// One quad of two triangles over a brick's rectangle.

uniform float stride_px;         // between the pixels of the grid
uniform vec2 grid_size;          // its columns and rows

in vec4 rectangle_px;            // left, top, right, bottom
in vec3 box_low;                 // index coordinates relative to the volume's centre
in vec3 box_high;
in vec3 first_corner;            // of the brick, in the same coordinates
in vec3 first_texel;             // of the brick's first cell in its atlas
in float cells_per_voxel;
in float step_cells;

flat out vec3 brick_low;
flat out vec3 brick_high;
flat out vec3 brick_corner;
flat out vec3 brick_texel;
flat out vec2 brick_steps;

void main() {
    brick_low = box_low;
    brick_high = box_high;
    brick_corner = first_corner;
    brick_texel = first_texel;
    brick_steps = vec2(cells_per_voxel, step_cells);
    // The grid's pixels inside, and those that rounding may have moved outside. Pixel 0 is that of the image.
    vec2 low = clamp(ceil((rectangle_px.xy - 0.5 - RECTANGLE_ROUNDING_PX) / stride_px), vec2(0.0), grid_size);
    vec2 high = clamp(floor((rectangle_px.zw - 0.5 + RECTANGLE_ROUNDING_PX) / stride_px) + 1.0, low, grid_size);
    if (any(equal(low, high))) {
        gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
        return;
    }
    int corner = gl_VertexID % 6;
    vec2 side = vec2(corner == 1 || corner == 2 || corner == 4, corner == 2 || corner == 4 || corner == 5);
    gl_Position = vec4(2.0 * mix(low, high, side) / grid_size - 1.0, 0.0, 1.0);
}
