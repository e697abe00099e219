// The transfer function by the scalars of texels, as renderer/transfer/piecewise.py has it.
uniform sampler2D guide;         // where to begin to look, for equal parts of the range
uniform sampler2D pieces;        // three rows for every PIECES_IN_ROW of them: (c, tau) at the origin; slopes; end, origin

const int PIECES_IN_ROW = 1024;

vec4 piece(int k, int row) {
    return texelFetch(pieces, ivec2(k % PIECES_IN_ROW, k / PIECES_IN_ROW * 3 + row), 0);
}

// (c, tau times the finest spacing).
vec4 classified(float u) {
    int parts = textureSize(guide, 0).x;
    int k = int(texelFetch(guide, ivec2(int(clamp(u * float(parts), 0.0, float(parts - 1))), 0), 0).r);
    vec4 bounds = piece(k, 2);
    while (u >= bounds.x) bounds = piece(++k, 2);
    return piece(k, 0) + (u - bounds.y) * piece(k, 1);
}
