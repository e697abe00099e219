in vec4 vertex_color;
out vec4 color;

void main() {
    color = vertex_color;
}
