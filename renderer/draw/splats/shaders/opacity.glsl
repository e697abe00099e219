// Return 1 - exp(-x) for x >= 0, relative error below 3e-7.
float opacity_of_depth(float x) {
    vec4 c = OPACITY_SERIES;
    float series = 1.0 - x * (c.x - x * (c.y - x * (c.z - x * c.w)));
    return x < 0.5 ? x * series : 1.0 - exp(-x);
}
