// Integrate one ray at a time through the cells of the continuous field, at several steps at once.
//
// A *cell* is the box between eight voxel centres, or its outward extension over the outer half voxel, where the field
// takes the nearest value. Along a ray inside one cell, the trilinear field is a cubic polynomial in the fraction t in
// [0, 1] of the segment. The cubic is split where it crosses a control value of the transfer function (and where the
// light grazes the surface), which leaves *pieces* on which colour and extinction are polynomials. The optical depth of
// a piece is then exact, and its radiance is a Gauss-Legendre quadrature of a smooth function. No thin shell can be
// missed, because crossings are computed and not sampled. Nearly all of the time is spent on cells and crossings, which
// do not depend on the step: another step costs little.
//
// Factors on extinction by the gradient are no polynomials. Depths are then the integrals of cubics through the nodes
// of the quadrature, and exact where all factors are 1.
//
// Most cells show nothing, which is found out once for each macrocell, when the first ray meets it.
#include "truth_cells.h"
#include "truth_light.h"

namespace truth {
namespace {

// A ray ends where its transmittance falls below 1e-12.
constexpr double MAX_OPTICAL_DEPTH = 27.631021115928547;
// With four nodes, steps of a voxel and of an optical depth of 1 left errors of 6e-8 and less on two CT scans.
constexpr double MAX_DEPTH_OF_STEP = 1.0;
constexpr int NUM_NODES = 4;
constexpr double NODES[] = {0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263};
constexpr double WEIGHTS[] = {0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692};
// From values at the nodes to the integrals from 0 to each node of the cubic through them.
constexpr double INTEGRALS[][NUM_NODES] = {
    {0.08696371128436346, -0.026604180084998794, 0.012627462689404725, -0.0035551496857956833},
    {0.18811811749986806, 0.16303628871563652, -0.027880428602470895, 0.006735500594538156},
    {0.16719192197418878, 0.35395300603374397, 0.16303628871563652, -0.014190694931141144},
    {0.1774825722545226, 0.31344511474186837, 0.35267675751627187, 0.08696371128436346},
};
// The optical depth of a piece leads to at most this many steps, which keeps their number an integer.
constexpr double MAX_STEPS_BY_DEPTH = 0x1p30;
// The states of a macrocell.
enum : uint8_t { UNKNOWN, EMPTY, VISIBLE };
// Of what is gathered along a ray: red, green, blue, optical depth, and then what each interval shows.
constexpr int64_t DEPTH = 3, FIRST_INTERVAL = 4;

// Red, green, blue.
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

// A piece of a cell, from `start` over `extent` in t, as functions of x in [0, 1].
//
// value: the scalar, in one interval. tau: optical depth per unit of x.
struct Piece {
    Interval interval;
    const Gradient& gradient;
    const Light* light;
    double start, extent;
    Cubic value, tau;
};

struct Step {
    Color radiance;
    double depth, opacity;
};

// The colour at the middle times the exact opacity, plus the quadrature of the difference from that colour: a constant
// colour is exact at every opacity. color, density, depth_before: functions of the number of a node.
template <class ColorAt, class DensityAt, class DepthBefore>
INLINE Step quadrature(Color middle, double depth, ColorAt color, DensityAt density, DepthBefore depth_before) {
    double opacity = -expm1_of(-depth);
    Color sum = middle * opacity;
    for (int node = 0; node < NUM_NODES; node++)
        sum += WEIGHTS[node] * density(node) * exp_of(-depth_before(node)) * (color(node) - middle);
    return {sum, depth, opacity};
}

// One of the equal steps through a piece, each `width` wide in x.
INLINE Step pass_step(const Piece& piece, double step, double width) {
    // From the integrand in powers of x to its integral from 0 to x, divided by x.
    auto [a, b, c, d] = restrict_cubic(piece.tau, step * width, width);
    const double d0 = a * width, d1 = b * width / 2.0, d2 = c * width / 3.0, d3 = d * width / 4.0;
    auto color_at = [&](double at) __attribute__((always_inline)) {
        double x = (step + at) * width;
        double lit = piece.light ? piece.light->lambert_factor(piece.gradient, piece.start + x * piece.extent) : 1.0;
        return piece.interval.color(value_at(piece.value, x), lit);
    };
    return quadrature(
        color_at(0.5), most(0.0, d0 + d1 + d2 + d3),
        [&](int node) { return color_at(NODES[node]); },
        [&](int node) {
            double at = NODES[node];
            return d0 + at * (2.0 * d1 + at * (3.0 * d2 + at * 4.0 * d3));
        },
        [&](int node) {
            double at = NODES[node];
            return at * (d0 + at * (d1 + at * (d2 + at * d3)));
        });
}

// The same with factors on extinction: depths come from their values at the nodes.
INLINE Step pass_glossy_step(const Piece& piece, double step, double width) {
    Cubic tau = restrict_cubic(piece.tau, step * width, width);
    double densities[NUM_NODES];
    auto color_at = [&](double at, double& density) __attribute__((always_inline)) {
        double x = (step + at) * width;
        auto [lit, highlight, extinction] = piece.light->factors_at(piece.gradient, piece.start + x * piece.extent);
        density = most(0.0, value_at(tau, at)) * width * extinction;
        return piece.interval.color(value_at(piece.value, x), lit) + highlight;
    };
    Color colors[NUM_NODES];
    for (int node = 0; node < NUM_NODES; node++) colors[node] = color_at(NODES[node], densities[node]);
    auto integral = [&](const double* weights) {
        return weights[0] * densities[0] + weights[1] * densities[1] + weights[2] * densities[2] +
            weights[3] * densities[3];
    };
    double unused;
    return quadrature(
        color_at(0.5, unused), integral(WEIGHTS), [&](int node) { return colors[node]; },
        [&](int node) { return densities[node]; }, [&](int node) { return integral(INTEGRALS[node]); });
}

// A cubic on x in [0, 1] that should lie in [low, high], or a constant if it strays too far.
//
// It strays if the interval, and so the piece, is narrower than the rounding of the cubic: between such knots,
// extinction would be extrapolated without bounds.
Cubic clamp_cubic(Cubic f, double low, double high) {
    auto [a, b, c, d] = f;
    // The other Bernstein coefficients.
    double one = a + b / 3.0, two = a + (2.0 * b + c) / 3.0, three = a + b + c + d, room = high - low;
    if (least(least(least(a, one), two), three) >= low - room && most(most(most(a, one), two), three) <= high + room)
        return f;
    return {least(most(0.5 * (a + three), low), high), 0.0, 0.0, 0.0};
}

Cubic combination(Point weights, const Gradient& gradient) {
    return weights.x * gradient.x + weights.y * gradient.y + weights.z * gradient.z;
}

// All that a call has in common. splits: scratch space; gathered: [steps, 4 + intervals], along one ray.
struct Integrator {
    const AnyArray<3>& values;
    Array<uint8_t, 3> macrocells;
    Intervals intervals;
    const Maybe<RayShading>& shading;
    Array<const double, 1> max_steps;
    Array<double, 1> splits;
    Array<double, 2> gathered;

    INLINE Interval interval(int64_t k) const { return {intervals.rows[k]}; }

    // Whether any value in [low, high] has extinction.
    bool is_visible(double low, double high) const {
        Interval first = interval(num_below(intervals.knots, low)), last = interval(num_below(intervals.knots, high));
        return last.num_opaque_below() > first.num_opaque_below() || first.has_extinction(low) ||
            last.has_extinction(high);
    }

    uint8_t classify(Cell macrocell) const {
        auto [low, high] = macrocell_range(values, macrocell);
        return low <= high && is_visible(low * intervals.scale, high * intervals.scale) ? VISIBLE : EMPTY;
    }

    // The gradient per world unit along the ray inside a cell, of which `absent` corners have no data.
    Gradient world_gradient(const Segment& segment, int absent) const {
        double corners[3][8];
        load_differences(values, segment.cell, absent, intervals.scale, corners);
        auto along = [&](int axis) { return cubic_in_cell(corners[axis], segment.entry, segment.extent); };
        Gradient in_index = {along(0), along(1), along(2)};
        auto row = [&](int number) { return point_of(&shading.value.world_from_gradient[3 * number]); };
        return {combination(row(0), in_index), combination(row(1), in_index), combination(row(2), in_index)};
    }

    // Add the piece [start, end] of a cell, which lies in one interval, to what has been gathered.
    //
    // length, length_voxels: of the segment in the whole cell.
    void integrate_piece(Cubic cubic, const Gradient& gradient, const Light* light, double start, double end,
                         double length, double length_voxels) const {
        const auto& knots = intervals.knots;
        int64_t k = num_below(knots, value_at(cubic, 0.5 * (start + end)));
        Interval in = interval(k);
        double base = in.base(), slope = in.slope();
        if (base == 0.0 && slope == 0.0) return;
        Cubic value = restrict_cubic(cubic, start, end - start);
        if (0 < k && k < knots.shape[0]) value = clamp_cubic(value, knots[k - 1], knots[k]);
        // The optical depth is a cubic, too; its largest Bernstein coefficient bounds it from above.
        double scale = (end - start) * length;
        Cubic tau = slope * value * scale;
        tau[0] = (base + slope * (value[0] - in.origin())) * scale;
        auto [t0, t1, t2, t3] = tau;
        double bound = most(most(most(t0, t0 + t1 / 3.0), t0 + (2.0 * t1 + t2) / 3.0), t0 + t1 + t2 + t3);
        double num_parts = most(most(1.0, (end - start) * length_voxels),
                                least(bound / MAX_DEPTH_OF_STEP, MAX_STEPS_BY_DEPTH));
        Piece piece = {in, gradient, light, start, end - start, value, tau};
        bool is_glossy = light && !light->shading.is_plain;
        for (int64_t number = 0; number < max_steps.shape[0]; number++) {
            const auto sums = gathered[number];
            int64_t num_steps = (int64_t)__builtin_ceil(num_parts / max_steps[number]);
            double width = 1.0 / (double)num_steps;
            for (int64_t step = 0; step < num_steps && !(sums[DEPTH] > MAX_OPTICAL_DEPTH); step++) {
                auto [radiance, depth, opacity] = is_glossy ? pass_glossy_step(piece, (double)step, width)
                                                            : pass_step(piece, (double)step, width);
                double transmittance = exp_of(-sums[DEPTH]);
                for (int channel = 0; channel < DEPTH; channel++) sums[channel] += transmittance * radiance[channel];
                sums[DEPTH] += depth;
                sums[FIRST_INTERVAL + k] += transmittance * opacity;
            }
        }
    }

    void integrate_cell(const Segment& segment, Light* light) const {
        double corners[8];
        int absent = load_corners(values, segment.cell, intervals.scale, corners);
        if (absent == ALL_ABSENT) return;
        double low = corners[0], high = corners[0];
        for (double corner : corners) low = least(low, corner), high = most(high, corner);
        if (!is_visible(low, high)) return;
        auto [cell, macrocell, s, s_exit, entry, extent] = segment;
        Cubic cubic = cubic_in_cell(corners, entry, extent);
        int64_t count = add_crossings(cubic, intervals.knots, splits, 0);
        if (absent != 0) count = add_middles(entry, extent, splits, count);
        Gradient gradient = {};
        if (light != nullptr) {
            light->begin = __builtin_convertvector(cell, Point) + entry, light->extent = extent;
            gradient = world_gradient(segment, absent);
            const double zero = 0.0;
            count = add_crossings(combination(light->light, gradient), {&zero, {1}}, splits, count);
        }
        double start = 0.0, length_voxels = __builtin_sqrt(dot(extent, extent));
        for (int64_t piece = 0; piece <= count; piece++) {
            double end = piece < count ? splits[piece] : 1.0;
            if (end > start && !is_octant_absent(absent, entry, extent, 0.5 * (start + end)))
                integrate_piece(cubic, gradient, light, start, end, s_exit - s, length_voxels);
            start = end;
        }
    }

    // Whether a ray may end, at all steps.
    bool is_opaque() const {
        double depth = gathered(0, DEPTH);
        for (int64_t k = 1; k < gathered.shape[0]; k++) depth = least(depth, gathered(k, DEPTH));
        return depth > MAX_OPTICAL_DEPTH;
    }

    // Add one ray from cell to cell, for each of the steps, to what has been gathered.
    void integrate_ray(Point origin, Point direction, const Array<const double, 2>& parts) const {
        for (int64_t k = 0; k < gathered.size(); k++) gathered.data[k] = 0.0;
        Light light(shading.value, direction);
        auto visit = [&](const Segment& segment) {
            if (!(segment.end > segment.start)) return true;
            auto [x, y, z] = segment.macrocell;
            uint8_t& state = macrocells(z, y, x);
            if (state == UNKNOWN) state = classify(segment.macrocell);  // the same value on all threads
            if (state == EMPTY) return true;
            integrate_cell(segment, shading.exists ? &light : nullptr);
            return !is_opaque();
        };
        for (int64_t k = 0; k < parts.shape[0] && !is_opaque(); k++)
            walk_cells(size_of(values), origin, direction, parts(k, 0), parts(k, 1), visit);
    }
};

}  // namespace
}  // namespace truth

// Write premultiplied RGBA of n rays to `radiance` [n, steps, 4], or more.
//
// With 4 + intervals channels, the others are what each interval of the transfer function adds to the opacity.
// macrocells: 0 at first; updated, for calls with the same values and intervals. max_steps: the longest steps in
// voxels, in optical depth and in pieces.
Status integrate_rays(const IntegrateRays* arguments) {
    using namespace truth;
    const auto& [values, macrocells, intervals, shading, max_steps, rays, radiance] = *arguments;
    int64_t num = rays.parts.shape[0], num_steps = max_steps.shape[0], num_channels = radiance.shape[2];
    int64_t num_intervals = intervals.knots.shape[0] + 1, num_gathered = FIRST_INTERVAL + num_intervals;
    if (!fit(rays) || !fits_macrocells(macrocells, values) || num_steps == 0 ||
        !has_shape(intervals.rows, num_intervals, 10) || !has_shape(radiance, num, num_steps, num_channels) ||
        num_channels <= DEPTH || num_channels > num_gathered ||
        (shading.exists && shading.value.factors.shape[1] != 3))
        return OUT_OF_BOUNDS;
    // A cubic passes a knot at most three times, and so does the cosine of the light. Another voxel becomes the nearest
    // at most three times.
    Buffer<double> splits(3 * num_intervals + 3), gathered(num_steps * num_gathered);
    if (!splits || !gathered) return NO_MEMORY;
    const Array<double, 2> sums = {gathered.data, {num_steps, num_gathered}};
    const Integrator integrator = {values, macrocells, intervals, shading, max_steps, splits, sums};
    for (int64_t i = 0; i < num; i++) {
        integrator.integrate_ray(point_of(&rays.origins(i, 0)), point_of(&rays.directions(i, 0)), rays.parts[i]);
        for (int64_t step = 0; step < num_steps; step++) {
            for (int64_t channel = 0; channel < num_channels; channel++)
                radiance(i, step, channel) = sums(step, channel);
            radiance(i, step, DEPTH) = -expm1_of(-sums(step, DEPTH));
        }
    }
    return DONE;
}
