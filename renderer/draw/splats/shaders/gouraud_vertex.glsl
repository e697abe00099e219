// Compute the opacity of a vertex of the Gouraud footprint; OpenGL interpolates it over the triangles (Laur and Hanrahan
// 1991).

in vec2 mesh_vertex;             // position in the footprint, in standard deviations
in float mesh_weight;

out vec4 vertex_color;           // premultiplied RGBA

void main() {
    Footprint footprint = project();
    gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
    vertex_color = vec4(0.0);
    if (!footprint.visible) return;
    // The triangular root of the covariance takes the unit circle to the ellipse, continuously in the view.
    vec3 root = footprint.root;
    vec2 offset_px = vec2(root.x * mesh_vertex.x, root.y * mesh_vertex.x + root.z * mesh_vertex.y);
    float alpha = opacity_of_depth(footprint.unit_depth * mesh_weight);
    vertex_color = vec4(areas.rgb / areas.w * alpha, alpha);
    gl_Position = vec4(2.0 * (footprint.center_px - corner_px + offset_px) / tile_px - 1.0, 0.0, 1.0);
}
