// Express the trilinear field along a ray through a cell as a cubic polynomial, and find where it crosses knots.
#pragma once
#include "base/arrays.h"

namespace truth {

// A point or a vector: x, y, z.
using Point = double __attribute__((ext_vector_type(3)));
// A cubic polynomial: the coefficients of 1, t, t^2 and t^3.
using Cubic = double __attribute__((ext_vector_type(4)));

INLINE double dot(Point one, Point other) { return one.x * other.x + one.y * other.y + one.z * other.z; }

INLINE Point point_of(const double* numbers) { return {numbers[0], numbers[1], numbers[2]}; }

INLINE double absolute(double x) { return __builtin_fabs(x); }

template <class T>
INLINE T lerp(T start, T end, double fraction) { return start + (end - start) * fraction; }

INLINE double value_at(Cubic f, double t) { return f[0] + t * (f[1] + t * (f[2] + t * f[3])); }

// Return the trilinear field of 8 corners, x fastest, along entry + extent * t, in cell coordinates.
//
// The field is linear in t along edges, quadratic on faces, and cubic in the cell. Because it is computed from
// differences of corners, the value of a constant cell is exact, so that it lies on the right side of a step.
INLINE Cubic cubic_in_cell(const double* corners, Point entry, Point extent) {
    auto [u, v, w] = entry;
    auto [du, dv, dw] = extent;
    Cubic first = {corners[0], corners[2], corners[4], corners[6]};
    Cubic last = {corners[1], corners[3], corners[5], corners[7]};
    Cubic edges = lerp(first, last, u), rises = (last - first) * du;
    auto faces = lerp(edges.xz, edges.yw, v), squares = (rises.yw - rises.xz) * dv;
    auto lines = lerp(rises.xz, rises.yw, v) + (edges.yw - edges.xz) * dv;
    return {
        lerp(faces.x, faces.y, w),
        lerp(lines.x, lines.y, w) + (faces.y - faces.x) * dw,
        lerp(squares.x, squares.y, w) + (lines.y - lines.x) * dw,
        (squares.y - squares.x) * dw,
    };
}

// Return a cubic in t as a cubic in x, with t = start + width * x.
INLINE Cubic restrict_cubic(Cubic f, double start, double width) {
    auto [a, b, c, d] = f;
    double first = b + start * (2.0 * c + start * 3.0 * d), second = c + start * 3.0 * d;
    return {value_at(f, start), first * width, second * width * width, d * width * width * width};
}

// Return how many of the ascending knots are at or below a value.
inline int64_t num_below(const Array<const double, 1>& knots, double value) {
    int64_t low = 0, high = knots.shape[0];
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (knots[middle] <= value) low = middle + 1;
        else high = middle;
    }
    return low;
}

// Insert t into the first `count` splits, which ascend, if t lies inside the cell. Return the new count.
inline int64_t insert_split(const Array<double, 1>& splits, int64_t count, double t) {
    if (!(0.0 < t && t < 1.0)) return count;
    int64_t slot = count;
    for (; slot > 0 && splits[slot - 1] > t; slot--) splits[slot] = splits[slot - 1];
    splits[slot] = t;
    return count + 1;
}

// Return the two positions at which the slope of a cubic changes its sign, ascending, and then 1, the end of the cell.
// A position that does not exist is -1.
INLINE Point turns_and_end(Cubic f) {
    double a = 3.0 * f[3], b = 2.0 * f[2], c = f[1];
    double largest = most(most(absolute(a), absolute(b)), absolute(c));
    if (largest == 0.0) return {-1.0, -1.0, 1.0};
    a /= largest, b /= largest, c /= largest;  // so that squares neither overflow nor vanish
    double square = b * b - 4.0 * a * c;
    if (square <= 0.0) return {-1.0, -1.0, 1.0};
    double q = -0.5 * (b + __builtin_copysign(__builtin_sqrt(square), b));  // avoids cancellation
    // Only quotients inside (-1, 1) are taken, so none overflows.
    double one = absolute(q) < absolute(a) ? q / a : -1.0, two = absolute(c) < absolute(q) ? c / q : -1.0;
    return {least(one, two), most(one, two), 1.0};
}

// Return the t in [start, end] at which a cubic equals `knot`. The cubic is monotone in [start, end] and passes through
// the knot.
inline double crossing(Cubic f, double knot, double start, double end) {
    bool is_rising = value_at(f, end) > knot;
    double rounding = 0x1p-52 * (absolute(f[0]) + absolute(f[1]) + absolute(f[2]) + absolute(f[3]));
    double t = 0.5 * (start + end);
    for (int k = 0; k < 80; k++) {
        double excess = value_at(f, t) - knot;
        // Without this test, Newton's method often leaves the bracket by a bit, and bisection follows.
        if (absolute(excess) <= rounding) return t;
        if ((excess > 0.0) == is_rising) end = t;
        else start = t;
        double slope = f[1] + t * (2.0 * f[2] + t * 3.0 * f[3]);
        double next = slope != 0.0 ? t - excess / slope : -1.0;
        if (!(start < next && next < end)) next = 0.5 * (start + end);  // Newton's method left the bracket
        if (absolute(next - t) <= 1e-15) return next;
        t = next;
    }
    return t;
}

// Add each t in (0, 1) at which the cubic passes through a knot to the first `count` splits. Knots ascend.
inline int64_t add_crossings(Cubic f, const Array<const double, 1>& knots, const Array<double, 1>& splits,
                             int64_t count) {
    Point turns = turns_and_end(f);
    double start = 0.0;
    for (int turn = 0; turn < 3; turn++) {
        double end = turns[turn];
        if (!(start < end && end <= 1.0)) continue;
        double at_start = value_at(f, start), at_end = value_at(f, end);
        double low = least(at_start, at_end), high = most(at_start, at_end);
        for (int64_t k = num_below(knots, low); k < knots.shape[0] && knots[k] < high; k++)
            if (k == 0 || knots[k] != knots[k - 1])
                count = insert_split(splits, count, crossing(f, knots[k], start, end));
        start = end;
    }
    return count;
}

}  // namespace truth
