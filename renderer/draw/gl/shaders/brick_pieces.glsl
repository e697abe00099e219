// Evaluate the transfer function at the scalars of texels (renderer/transfer/piecewise.py).
uniform sampler2D guide;         // where to begin the search, for equal parts of the range
uniform sampler2D pieces;        // three rows for PIECES_IN_ROW of them: (c, tau) at the origin; slopes; end, origin

vec4 piece(int k, int row) {
    return texelFetch(pieces, ivec2(k % PIECES_IN_ROW, k / PIECES_IN_ROW * 3 + row), 0);
}

// Return (c, tau times the finest spacing).
vec4 classify(float u) {
    int num_buckets = textureSize(guide, 0).x;
    int k = int(texelFetch(guide, ivec2(int(clamp(u * float(num_buckets), 0.0, float(num_buckets - 1))), 0), 0).r);
    vec4 bounds = piece(k, 2);
    while (u >= bounds.x) bounds = piece(++k, 2);
    return piece(k, 0) + (u - bounds.y) * piece(k, 1);
}
