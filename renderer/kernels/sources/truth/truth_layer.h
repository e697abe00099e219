// Divide a ray through one layer into *pieces*, on which colour and extinction are polynomials.
//
// Along a ray inside one cell, the trilinear field is a cubic polynomial in the fraction t in [0, 1] of the segment.
// The cubic is split where it crosses a control value of the transfer function (and where the light grazes the
// surface). No thin shell can be missed, because crossings are computed and not sampled. In a volume of labels, the
// number is constant between the positions where another label wins (truth_labels.h). If voxels are colours, extinction
// and its products with colour are such cubics themselves, interpolated between lit voxels.
//
// Most cells show nothing. Whether a macrocell may show anything is found out when the first ray meets the macrocell.
#pragma once
#include "truth/truth_labels.h"
#include "truth/truth_light.h"

namespace truth {

// The states of a macrocell: not looked at yet, showing nothing, and maybe showing something.
enum : uint8_t { UNKNOWN, EMPTY, VISIBLE };

// The optical depth at which a ray ends, because its transmittance is 1e-12. If light adds up without absorption, rays
// do not end.
constexpr double MAX_OPTICAL_DEPTH = 27.631021115928547;

// A colour: red, green, blue.
using Color = Point;

// An interval of the transfer function: a row of Intervals.
struct Interval {
    Array<const double, 1> row;

    INLINE double origin() const { return row[8]; }
    INLINE double base() const { return row[3]; }
    INLINE double slope() const { return row[7]; }
    INLINE double num_opaque_below() const { return row[9]; }

    INLINE Color color(double value, double lit) const {
        return (point_of(&row[0]) + point_of(&row[4]) * (value - origin())) * lit;
    }

    INLINE bool has_extinction(double value) const { return base() + slope() * (value - origin()) > 0.0; }
};

// A piece of a segment, whose values all lie in one interval of the transfer function. A position in the piece is x,
// from 0 to 1.
struct Piece {
    // The interval of the transfer function that holds the values of the piece.
    Interval interval;
    // The number of the interval that holds the values of the piece.
    int64_t number;
    // The position on the segment, from 0 to 1, at which the piece starts.
    double start;
    // The extent of the piece, as a share of the segment.
    double extent;
    // The length of the piece, in voxels.
    double length_voxels;
    // The scalar as a cubic in x, times `Intervals.scale`.
    Cubic value;
    // The optical depth per unit of x, as a cubic in x.
    Cubic tau;

    // Return the part of the piece between two positions in x.
    INLINE Piece part(double from, double to) const {
        if (from == 0.0 && to == 1.0) return *this;
        double width = to - from;
        return {
            interval, number, start + from * extent, width * extent, width * length_voxels,
            restrict_cubic(value, from, width), restrict_cubic(tau, from, width) * width,
        };
    }

    // Return an upper bound of the optical depth: the largest Bernstein coefficient of its cubic.
    INLINE double depth_bound() const {
        auto [t0, t1, t2, t3] = tau;
        return most(most(most(t0, t0 + t1 / 3.0), t0 + (2.0 * t1 + t2) / 3.0), t0 + t1 + t2 + t3);
    }
};

// Return a cubic that should lie in [low, high] for x in [0, 1]; if it lies too far outside, return a constant in place
// of it.
//
// The cubic lies outside if the interval is narrower than the cubic's rounding errors. Extinction would then be
// extrapolated without bounds.
inline Cubic clamp_cubic(Cubic f, double low, double high) {
    auto [a, b, c, d] = f;
    // The other Bernstein coefficients of the cubic; the first one is a.
    double one = a + b / 3.0, two = a + (2.0 * b + c) / 3.0, three = a + b + c + d, room = high - low;
    if (least(least(least(a, one), two), three) >= low - room && most(most(most(a, one), two), three) <= high + room)
        return f;
    return {least(most(0.5 * (a + three), low), high), 0.0, 0.0, 0.0};
}

// Return the largest number of splits of a cell. A cubic passes each knot at most three times, and the cosines of the
// light and of the view pass 0 at most three times. Another voxel becomes the nearest at most three times. Labels pass
// no knots, but change at most MAX_LABEL_CHANGES times.
inline int64_t num_splits_of(const LayerOptics& layer) {
    return 3 * (layer.intervals.rows.shape[0] + 2) + MAX_LABEL_CHANGES;
}

inline bool fit(const LayerOptics& layer, const IndexRays& rays, int64_t num_rays) {
    auto [width, height, depth] = size_of(layer.voxels);
    return rays.parts.shape[0] == num_rays && fit(rays) && fit(layer.voxels) &&
        fits_macrocells(layer.macrocells, layer.voxels) &&
        has_shape(layer.intervals.rows, layer.intervals.knots.shape[0] + 1, 10) &&
        (!layer.colors.exists || has_shape(layer.colors.value, depth, height, width, 3)) &&
        (!layer.label_opacities.exists || layer.label_opacities.value.shape[0] > 0) &&
        (!layer.shading.exists || layer.shading.value.factors.shape[1] == 3);
}

// Return the weighted sum of the three components of a gradient.
inline Cubic combination(Point weights, const Gradient& gradient) {
    return weights.x * gradient.x + weights.y * gradient.y + weights.z * gradient.z;
}

// A ray through a layer, which stands at one piece of one cell at a time.
struct LayerRay : LayerOptics {
    // All rays, in the index space of the layer.
    const IndexRays* rays;
    // Room for the positions on the segment, from 0 to 1, at which it is split into pieces, ascending.
    Array<double, 1> splits;
    // The index, in the numbers that a ray gathers, of the opacity of the layer's first interval.
    int64_t first_interval;
    // [k, 2]: the parts of the ray, as in IndexRays.
    Array<const double, 2> parts;
    // The number of parts of the ray that have been begun.
    int64_t num_begun;
    // The walk from cell to cell along the part of the ray that was begun last.
    CellWalk walk;
    // The light on the segment; unset if the layer has no light.
    Light light;
    // The part of the ray inside the cell at which the ray stands.
    Segment segment;
    // The scalar along the segment, as a cubic, times `Intervals.scale`.
    Cubic cubic;
    // The gradient of the scalar along the segment, per world unit.
    Gradient gradient;
    // The channels (tau c, tau) along the segment, if voxels are colours.
    Cubic channels[4];
    // The corners of the cell without data, one bit for each, x fastest.
    int absent;
    // Whether the cell has several labels.
    bool is_mixed;
    // The labels along the segment, if the cell has several.
    LabelSegment labels;
    // The number of positions at which the segment in the cell is split.
    int64_t num_splits;
    // The number of pieces of the ray's segment that are integrated already. Pieces end at the splits and at 1.
    int64_t num_taken;
    // The position on the ray's segment, in [0, 1], up to which it is integrated already.
    double taken;
    // The length of the segment, in voxels.
    double length_voxels;
    // The piece at which the ray stands.
    Piece piece;
    // The part of the piece that is integrated next.
    Piece part;
    // The length along the ray at which the piece begins.
    double begin;
    // The length along the ray at which the piece ends.
    double end;
    // The length up to which the ray has been integrated; infinite behind the last piece.
    double reached;
    // The position x up to which the piece has been integrated.
    double done;
    // The optical depth of a step through `part`.
    double depth;
    // The next layer that has a piece at the same place; null behind the last one.
    LayerRay* next;

    void prepare(const LayerOptics& optics, const IndexRays& of_layer, const Array<double, 1>& scratch, int64_t first) {
        (LayerOptics&)*this = optics;
        rays = &of_layer, splits = scratch, first_interval = first;
    }

    // Take the first piece of a ray.
    void start(int64_t ray) {
        walk.origin = point_of(&rays->origins(ray, 0)), walk.direction = point_of(&rays->directions(ray, 0));
        parts = rays->parts[ray], num_begun = 0, walk.s = INFINITE;
        if (shading.exists) light = {shading.value, walk.direction}, light.removed = rays->removed;
        num_splits = -1, num_taken = 0;
        take_next();
    }

    INLINE Interval interval(int64_t k) const { return {intervals.rows[k]}; }

    // Return whether any value in [low, high] has extinction.
    bool is_visible(double low, double high) const {
        Interval first = interval(num_below(intervals.knots, low)), last = interval(num_below(intervals.knots, high));
        return last.num_opaque_below() > first.num_opaque_below() || first.has_extinction(low) ||
            last.has_extinction(high);
    }

    uint8_t classify(Cell macrocell) const {
        auto [low, high] = macrocell_range(voxels, macrocell);
        return low <= high && is_visible(low * intervals.scale, high * intervals.scale) ? VISIBLE : EMPTY;
    }

    // Return the gradient, per world unit, along the ray inside the cell.
    INLINE Gradient world_gradient() const {
        double corners[3][8];
        if (label_opacities.exists) load_label_differences(voxels, segment.cell, label_opacities.value, corners);
        else load_differences(voxels, segment.cell, absent, intervals.scale, corners);
        auto along = [&](int axis) { return cubic_in_cell(corners[axis], segment.entry, segment.extent); };
        Gradient in_index = {along(0), along(1), along(2)};
        auto row = [&](int number) { return point_of(&shading.value.world_from_gradient[3 * number]); };
        Gradient found = {combination(row(0), in_index), combination(row(1), in_index), combination(row(2), in_index)};
        if (label_opacities.exists && !shading.value.is_camera) {
            double largest = 0.0;
            for (double each : shading.value.world_from_gradient) largest = most(largest, __builtin_fabs(each));
            Point tilt = LABEL_TILT * largest * light.light;
            found.x[0] -= tilt.x, found.y[0] -= tilt.y, found.z[0] -= tilt.z;
        }
        return found;
    }

    // Classify and light the voxels, which are colours, at the corners of the cell. scalars: the voxels' scalars.
    void load_channels(const double* scalars) {
        double corners[4][8] = {}, differences[3][8];
        if (shading.exists) load_differences(voxels, segment.cell, absent, intervals.scale, differences);
        for (int k = 0; k < 8; k++) {
            if (absent >> k & 1) continue;
            Cell at = nearest_inside(segment.cell + Cell{k & 1, k >> 1 & 1, k >> 2}, size_of(voxels));
            Interval in = interval(num_below(intervals.knots, scalars[k]));
            double lit = shading.exists ? lit_at(at, {differences[0][k], differences[1][k], differences[2][k]}) : 1.0;
            double tau = in.base() + in.slope() * (scalars[k] - in.origin());
            Color color = in.color(scalars[k], lit);
            for (int channel = 0; channel < 3; channel++)
                corners[channel][k] = tau * color[channel] * colors.value(at.z, at.y, at.x, channel) / 255.0;
            corners[3][k] = tau;
        }
        for (int channel = 0; channel < 4; channel++)
            channels[channel] = cubic_in_cell(corners[channel], segment.entry, segment.extent);
    }

    // Return the factor on the colour of a voxel whose gradient along the index axes is `in_index`.
    double lit_at(Cell voxel, Point in_index) {
        auto along = [&](int row) {
            return Cubic{dot(point_of(&shading.value.world_from_gradient[3 * row]), in_index), 0.0, 0.0, 0.0};
        };
        light.begin = __builtin_convertvector(voxel, Point), light.extent = {};
        return light.factors_at({along(0), along(1), along(2)}, 0.0).lit;
    }

    // Return the colour at t along the segment, for a volume whose voxels are colours.
    INLINE Color own_color(double t) const {
        double tau = value_at(channels[3], t);
        if (!(tau > 0.0)) return {};
        return Color{value_at(channels[0], t), value_at(channels[1], t), value_at(channels[2], t)} / tau;
    }

    // Prepare to take the pieces of the ray inside the cell. Return whether the cell shows anything.
    INLINE bool enter() {
        const auto& [cell, macrocell, s, s_exit, entry, extent] = segment;
        double corners[8];
        absent = load_corners(voxels, cell, intervals.scale, corners);
        if (absent == ALL_ABSENT) return false;
        double low = corners[0], high = corners[0];
        for (double corner : corners) low = least(low, corner), high = most(high, corner);
        if (!is_visible(low, high)) return false;
        num_taken = 0, taken = 0.0, length_voxels = __builtin_sqrt(dot(extent, extent));
        is_mixed = label_opacities.exists && low != high;
        cubic = cubic_in_cell(corners, entry, extent);
        if (colors.exists) {
            load_channels(corners);
            num_splits = absent = 0;  // voxels without data have no extinction, and the ray is not split at their edges
            return true;
        }
        num_splits = is_mixed ? labels.load(voxels, segment, splits) : add_crossings(cubic, intervals.knots, splits, 0);
        if (absent != 0) num_splits = add_middles(entry, extent, splits, num_splits);
        if (shading.exists) {
            light.begin = __builtin_convertvector(cell, Point) + entry, light.extent = extent;
            gradient = world_gradient();
            const double zero = 0.0;
            num_splits = add_crossings(combination(light.light, gradient), {&zero, {1}}, splits, num_splits);
            if (shading.value.silhouette > 0.0 && !shading.value.is_camera)
                num_splits = add_crossings(combination(light.viewer, gradient), {&zero, {1}}, splits, num_splits);
        }
        return true;
    }

    // Enter the next cell that shows anything. Return whether there is such a cell.
    bool enter_next() {
        for (;; num_begun++) {
            CellWalk ahead = walk;  // copies of members, which stay in registers
            const Array<uint8_t, 3> states = macrocells;
            for (Segment met; ahead.next(met);) {
                if (!(met.end > met.start)) continue;
                auto [x, y, z] = met.macrocell;
                uint8_t& state = states(z, y, x);
                if (state == UNKNOWN) state = classify(met.macrocell);  // all threads find the same value
                if (state == EMPTY) continue;
                segment = met;
                if (!enter()) continue;
                walk = ahead;
                return true;
            }
            if (num_begun == parts.shape[0]) return false;
            walk = {size_of(voxels), walk.origin, walk.direction, parts(num_begun, 0), parts(num_begun, 1)};
        }
    }

    // Make a part of the segment the current piece: from t = `from` to `to`, inside one interval of the transfer
    // function. Return whether the piece shows anything.
    INLINE bool take(double from, double to) {
        const auto& knots = intervals.knots;
        if (is_mixed) cubic = {labels.winner_at(0.5 * (from + to)).number * intervals.scale, 0.0, 0.0, 0.0};
        int64_t k = num_below(knots, value_at(cubic, 0.5 * (from + to)));
        Interval in = interval(k);
        double base = in.base(), slope = in.slope(), scale = (to - from) * (segment.end - segment.start) * weight;
        if (base == 0.0 && slope == 0.0 && !colors.exists) return false;
        Cubic value = restrict_cubic(cubic, from, to - from);
        if (0 < k && k < knots.shape[0]) value = clamp_cubic(value, knots[k - 1], knots[k]);
        // The optical depth is a cubic in x, as the scalar is.
        Cubic tau = slope * value * scale;
        tau[0] = (base + slope * (value[0] - in.origin())) * scale;
        if (colors.exists) tau = restrict_cubic(channels[3], from, to - from) * scale;
        piece = {in, k, from, to - from, (to - from) * length_voxels, value, tau};
        begin = reached = lerp(segment.start, segment.end, from), end = lerp(segment.start, segment.end, to);
        done = 0.0;
        return true;
    }

    // Go on to the next piece of the ray that shows anything; it becomes the current piece.
    void take_next() {
        do {
            while (num_taken <= num_splits) {
                double from = taken, to = num_taken < num_splits ? splits[num_taken] : 1.0;
                num_taken++, taken = to;
                if (to > from && !is_octant_absent(absent, segment.entry, segment.extent, 0.5 * (from + to)) &&
                    take(from, to))
                    return;
            }
        } while (enter_next());
        reached = INFINITE;
    }

    // Choose the part of the piece that is integrated next: it begins where the last part ended, and ends at a length
    // along the ray.
    INLINE void reach(double length) {
        double to = length < end ? most(done, (length - begin) / (end - begin)) : 1.0;
        part = piece.part(done, to);
        done = to, reached = length;
    }
};

// Let the layers of a ray reach the end of the next part of the ray, on which each layer is at one piece or at none.
// Return the layers that are at a piece, as a list; null behind the last piece.
inline LayerRay* next_part(const Array<LayerRay, 1>& layers) {
    double start = INFINITE, end = INFINITE;
    for (int64_t k = 0; k < layers.shape[0]; k++) start = least(start, layers[k].reached);
    if (start == INFINITE) return nullptr;
    for (int64_t k = 0; k < layers.shape[0]; k++)
        end = least(end, layers[k].reached > start ? layers[k].reached : layers[k].end);
    LayerRay* first = nullptr;
    for (int64_t k = layers.shape[0] - 1; k >= 0; k--) {
        if (layers[k].reached > start) continue;
        layers[k].reach(end), layers[k].next = first, first = &layers[k];
    }
    return first;
}

// Go on from a part of the ray: layers of the list whose pieces end there take their next pieces.
inline void finish_part(LayerRay* first) {
    for (LayerRay* layer = first; layer; layer = layer->next)
        if (layer->reached == layer->end) layer->take_next();
}

}  // namespace truth
