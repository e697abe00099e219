// The exact table of a transfer function, in float64 (TransferTable in renderer/transfer/piecewise.py).
#pragma once
#include "kernels.h"

constexpr int64_t GUIDE_SIZE = 1024;
constexpr double MAX_NORMALIZED_SCALAR = 1 << 20;

struct Channels {
    double r, g, b, a;
};

// The four channels of a scaled and clamped scalar in segment k.
INLINE Channels evaluate_segment(const Array<const double, 2>& rows, int64_t k, double inside) {
    const double* row = &rows(k, 0);
    double t = (inside - row[0]) / row[1];
    return {row[2] + t * row[6], row[3] + t * row[7], row[4] + t * row[8], row[5] + t * row[9]};
}

// The four channels of a scalar that is not NaN.
INLINE Channels evaluate(const TransferTable& curve, double scalar) {
    const auto& values = curve.values;
    double inside = least(most(scalar, values[0]), values[values.shape[0] - 1]) * curve.scale;
    int64_t bucket = least((int64_t)((inside - curve.rows(0, 0)) * curve.buckets_per_unit), GUIDE_SIZE - 1);
    int64_t k = (int64_t)curve.guide[bucket], end = (int64_t)curve.guide[bucket + 3];
    while (k < end) {
        int64_t middle = (k + end) / 2;
        if (values[middle] <= scalar) k = middle + 1;
        else end = middle;
    }
    return evaluate_segment(curve.rows, k, inside);
}

// Whether any scalar from `low` to `high` is visible, by the visibility breakpoints.
INLINE bool is_range_visible(const Array<const double, 1>& breakpoints, double low, double high) {
    int64_t num = 0, end = breakpoints.shape[0];  // those at or below `low`
    while (num < end) {
        int64_t middle = (num + end) / 2;
        if (breakpoints[middle] <= low) num = middle + 1;
        else end = middle;
    }
    return num & 1 || (num < breakpoints.shape[0] && breakpoints[num] <= high);
}
