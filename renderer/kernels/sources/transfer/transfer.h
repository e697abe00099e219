// The exact table of a transfer function, in float64 (TransferTable in kernels.h).
#pragma once
#include "transfer/kernels.h"
#include "base/lanes.h"
#include "base/maths.h"

// The number of buckets of a guide, an index by which a scalar's segment of a transfer function is found quickly. The
// number is the same in renderer/transfer/piecewise.py.
constexpr int64_t GUIDE_SIZE = 1024;
// The largest magnitude of a normalized scalar, in widths of the range to which scalars are normalized; larger ones are
// clamped. The number is the same in renderer/transfer/piecewise.py.
constexpr double MAX_NORMALIZED_SCALAR = 0x1p20;
// The least optical depth or opacity that is visible; smaller ones count as 0. The number is the same in
// renderer/transfer/transfer_function.py.
constexpr double VISIBILITY_THRESHOLD = 0x1p-80;

// Four channels, such as (tau c, tau): three for colour, then extinction or opacity.
using Channels = Vector<double, 4>;

INLINE bool fits(const TransferTable& curve) {
    int64_t num = curve.values.shape[0];
    return num > 0 && has_shape(curve.rows, num + 1, 10) && has_shape(curve.guide, GUIDE_SIZE + 3);
}

// Return how many of the ascending values are at or below a scalar: at least `low`, at most `high`.
INLINE int64_t num_at_or_below(const Array<const double, 1>& values, double scalar, int64_t low, int64_t high) {
    while (low < high) {
        int64_t middle = (low + high) / 2;
        if (values[middle] <= scalar) low = middle + 1;
        else high = middle;
    }
    return low;
}

// Return the four channels of a scaled and clamped scalar in segment k.
INLINE Channels evaluate_segment(const Array<const double, 2>& rows, int64_t k, double inside) {
    const double* row = &rows(k, 0);
    double t = (inside - row[0]) / row[1];
    return load<Channels>(row, 2) + t * load<Channels>(row, 6);
}

// Return the four channels of a scalar that is not NaN.
INLINE Channels evaluate(const TransferTable& curve, double scalar) {
    const auto& values = curve.values;
    double inside = least(most(scalar, values[0]), values[values.shape[0] - 1]) * curve.scale;
    int64_t bucket = least((int64_t)((inside - curve.rows(0, 0)) * curve.buckets_per_unit), GUIDE_SIZE - 1);
    int64_t low = (int64_t)curve.guide[bucket], high = (int64_t)curve.guide[bucket + 3];
    return evaluate_segment(curve.rows, num_at_or_below(values, scalar, low, high), inside);
}

// Return a voxel's four channels without light: (tau c, tau) or, with opacities, (a c, a); 0 for NaN.
INLINE Channels classify_scalar(const TransferTable& curve, bool is_opacity, double scalar) {
    if (is_nan(scalar)) return {};
    Channels channels = evaluate(curve, scalar);
    double weight = is_opacity ? -expm1_of(-channels.a) : channels.a;
    if (!(weight >= VISIBILITY_THRESHOLD)) weight = 0;
    channels.a = 1;
    return weight * channels;
}

// Return whether any scalar from `low` to `high` is visible: the min-max test (renderer/transfer/transfer_function.py).
INLINE bool is_range_visible(const Array<const double, 1>& breakpoints, double low, double high) {
    int64_t num = num_at_or_below(breakpoints, low, 0, breakpoints.shape[0]);
    return num % 2 == 1 || (num < breakpoints.shape[0] && breakpoints[num] <= high);
}
