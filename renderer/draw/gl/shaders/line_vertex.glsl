// One edge of a cell as a quad of two triangles around its visible part: drivers draw GL's own lines differently.
// Lengths are model units, image coordinates are pixels with row 0 at the top. The depth axis points away from the eye.

uniform mat3 view_rotation;      // model to (right, up, depth)
uniform vec3 view_translation;
uniform bool perspective;
uniform float scale_px;          // focal length, or pixels per model unit
uniform vec2 size_px;
uniform float near_depth;
uniform float voxel_side;
uniform vec3 level_colors[NUM_LEVEL_COLORS];

in vec3 start;
in vec3 end;
in float level;

flat out vec4 line_px;           // both ends
flat out vec2 line_side_px;      // of the cell, at the depths of both ends
flat out vec4 line_color_cover;  // colour, opacity by the side in pixels

// Half the width of a line and of the slope of its coverage, and a little for rounding.
const float REACH_PX = 1.5;

vec2 shares = vec2(0.0, 1.0);    // the visible part of the way from start to end

// Cut away the part of the edge in which a function that is linear along it is negative (Liang and Barsky 1984).
void clip(float at_start, float at_end) {
    float slope = at_end - at_start;
    if (slope > 0.0) shares.x = max(shares.x, -at_start / slope);
    else if (slope < 0.0) shares.y = min(shares.y, -at_start / slope);
    else if (at_start < 0.0) shares.y = -1.0;
}

void main() {
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    line_px = vec4(0.0);
    line_side_px = vec2(0.0);
    line_color_cover = vec4(0.0);

    vec3 a = view_rotation * start + view_translation, b = view_rotation * end + view_translation;
    float nearest = perspective ? max(near_depth, MIN_LINE_DEPTH) : near_depth;
    clip(a.z - nearest, b.z - nearest);
    // Clip to the image, too: coordinates far outside would cost precision inside.
    vec2 room = (0.5 * size_px + REACH_PX) / scale_px;
    vec2 limit_a = perspective ? room * a.z : room, limit_b = perspective ? room * b.z : room;
    clip(limit_a.x - a.x, limit_b.x - b.x);
    clip(limit_a.x + a.x, limit_b.x + b.x);
    clip(limit_a.y - a.y, limit_b.y - b.y);
    clip(limit_a.y + a.y, limit_b.y + b.y);
    if (shares.x >= shares.y) return;

    vec3 p = mix(a, b, shares.x), q = mix(a, b, shares.y);
    vec2 magnification = perspective ? scale_px / vec2(p.z, q.z) : vec2(scale_px);
    vec2 p_px = 0.5 * size_px + magnification.x * vec2(p.x, -p.y);
    vec2 q_px = 0.5 * size_px + magnification.y * vec2(q.x, -q.y);
    float side = voxel_side * exp2(level);

    line_px = vec4(p_px, q_px);
    line_side_px = side * magnification;
    line_color_cover = vec4(level_colors[min(int(level), NUM_LEVEL_COLORS - 1)], LINE_COVER * side);
    vec2 along = q_px - p_px;
    along = dot(along, along) > 0.0 ? normalize(along) * REACH_PX : vec2(REACH_PX, 0.0);
    vec2 across = vec2(-along.y, along.x);
    int corner = gl_VertexID % 6;
    bool is_end = corner == 1 || corner == 2 || corner == 4;
    bool is_left = corner == 2 || corner == 4 || corner == 5;
    vec2 at_px = (is_end ? q_px + along : p_px - along) + (is_left ? across : -across);
    gl_Position = vec4(2.0 * at_px / size_px - 1.0, 0.0, 1.0);
}
