// 1 - exp(-x) for x >= 0 without cancellation for thin splats: relative error below 1e-6 by either branch.
float opacity_of_depth(float x) {
    return x < 0.03 ? x * (1.0 - x * (0.5 - x * (1.0 / 6.0 - x * (1.0 / 24.0)))) : 1.0 - exp(-x);
}
