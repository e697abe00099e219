// Express the trilinear field along a ray through a cell as a cubic polynomial, and find where it crosses knots.
#pragma once
#include "arrays.h"

namespace truth {

struct Point {
    double x, y, z;
};

// Coefficients of 1, t, t^2 and t^3.
struct Cubic {
    double a, b, c, d;
};

INLINE double dot(Point one, Point other) {
    return one.x * other.x + one.y * other.y + one.z * other.z;
}

INLINE double absolute(double x) {
    return __builtin_fabs(x);
}

INLINE double lerp(double start, double end, double fraction) {
    return start + (end - start) * fraction;
}

INLINE double value_at(const Cubic& f, double t) {
    return f.a + t * (f.b + t * (f.c + t * f.d));
}

// The trilinear field of 8 corners, x fastest, along entry + extent * t, in cell coordinates.
//
// Edges along x are linear in t, faces quadratic, the cell cubic. Differences of corners keep the value of a constant
// cell exact, which decides on which side of a step it lies.
INLINE Cubic cubic_in_cell(const double* corners, Point entry, Point extent) {
    auto [u, v, w] = entry;
    auto [du, dv, dw] = extent;
    double edge_0 = lerp(corners[0], corners[1], u), edge_1 = lerp(corners[2], corners[3], u);
    double edge_2 = lerp(corners[4], corners[5], u), edge_3 = lerp(corners[6], corners[7], u);
    double rise_0 = (corners[1] - corners[0]) * du, rise_1 = (corners[3] - corners[2]) * du;
    double rise_2 = (corners[5] - corners[4]) * du, rise_3 = (corners[7] - corners[6]) * du;
    double face_0 = lerp(edge_0, edge_1, v), face_1 = lerp(edge_2, edge_3, v);
    double line_0 = lerp(rise_0, rise_1, v) + (edge_1 - edge_0) * dv;
    double line_1 = lerp(rise_2, rise_3, v) + (edge_3 - edge_2) * dv;
    double square_0 = (rise_1 - rise_0) * dv, square_1 = (rise_3 - rise_2) * dv;
    return {
        lerp(face_0, face_1, w),
        lerp(line_0, line_1, w) + (face_1 - face_0) * dw,
        lerp(square_0, square_1, w) + (line_1 - line_0) * dw,
        (square_1 - square_0) * dw,
    };
}

// The same cubic in x, with t = start + width * x.
INLINE Cubic restrict_cubic(const Cubic& f, double start, double width) {
    double first = f.b + start * (2.0 * f.c + start * 3.0 * f.d), second = f.c + start * 3.0 * f.d;
    return {value_at(f, start), first * width, second * width * width, f.d * width * width * width};
}

// How many of the ascending knots are at or below a value.
inline int64_t num_below(const Array<const double, 1>& knots, double value) {
    int64_t low = 0, high = knots.shape[0];
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (knots[middle] <= value) low = middle + 1;
        else high = middle;
    }
    return low;
}

// Insert t into the first `count` splits, which ascend, if it lies inside the cell; return the new count.
inline int64_t insert_split(const Array<double, 1>& splits, int64_t count, double t) {
    if (!(0.0 < t && t < 1.0)) return count;
    int64_t slot = count;
    for (; slot > 0 && splits[slot - 1] > t; slot--) splits[slot] = splits[slot - 1];
    splits[slot] = t;
    return count + 1;
}

// Where the slope of a cubic changes its sign, ascending; -1 for each missing place.
struct Turns {
    double first, second;
};

INLINE Turns stationary_points(const Cubic& f) {
    double a = 3.0 * f.d, b = 2.0 * f.c, c = f.b;
    double largest = most(most(absolute(a), absolute(b)), absolute(c));
    if (largest == 0.0) return {-1.0, -1.0};
    a /= largest, b /= largest, c /= largest;  // so that squares neither overflow nor vanish
    double square = b * b - 4.0 * a * c;
    if (square <= 0.0) return {-1.0, -1.0};
    double q = -0.5 * (b + __builtin_copysign(__builtin_sqrt(square), b));  // avoids cancellation
    // Only quotients inside (-1, 1) matter: none overflows.
    double one = absolute(q) < absolute(a) ? q / a : -1.0, two = absolute(c) < absolute(q) ? c / q : -1.0;
    return {least(one, two), most(one, two)};
}

// The t in [start, end], where the cubic is monotone and passes through `knot`, at which it equals it.
inline double crossing(const Cubic& f, double knot, double start, double end) {
    bool is_rising = value_at(f, end) > knot;
    double rounding = 0x1p-52 * (absolute(f.a) + absolute(f.b) + absolute(f.c) + absolute(f.d));
    double t = 0.5 * (start + end);
    for (int k = 0; k < 80; k++) {
        double excess = value_at(f, t) - knot;
        // Otherwise, Newton often leaves the bracket by a bit, and bisection follows.
        if (absolute(excess) <= rounding) return t;
        if ((excess > 0.0) == is_rising) end = t;
        else start = t;
        double slope = f.b + t * (2.0 * f.c + t * 3.0 * f.d);
        double next = slope != 0.0 ? t - excess / slope : -1.0;
        if (!(start < next && next < end)) next = 0.5 * (start + end);  // Newton left the bracket: bisect
        if (absolute(next - t) <= 1e-15) return next;
        t = next;
    }
    return t;
}

// Add every t in (0, 1) at which the cubic passes through one of the ascending knots to the first `count` splits.
inline int64_t add_crossings(const Cubic& f, const Array<const double, 1>& knots, const Array<double, 1>& splits,
                             int64_t count) {
    auto [first, second] = stationary_points(f);
    const double candidates[] = {first, second, 1.0};
    double start = 0.0;
    for (double candidate : candidates) {
        if (!(start < candidate && candidate <= 1.0)) continue;
        double at_start = value_at(f, start), at_end = value_at(f, candidate);
        double low = least(at_start, at_end), high = most(at_start, at_end);
        for (int64_t k = num_below(knots, low); k < knots.shape[0] && knots[k] < high; k++)
            if (k == 0 || knots[k] != knots[k - 1])
                count = insert_split(splits, count, crossing(f, knots[k], start, candidate));
        start = candidate;
    }
    return count;
}

}  // namespace truth
