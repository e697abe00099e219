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

struct Color {
    double r, g, b;
};

// An interval of the transfer function: a row of Intervals.
struct Interval {
    Array<const double, 1> row;

    INLINE double origin() const { return row[8]; }
    INLINE double base() const { return row[3]; }
    INLINE double slope() const { return row[7]; }
    INLINE double num_opaque_below() const { return row[9]; }

    // highlight: white light that is added, not of what is lit by Lambert's law alone.
    INLINE Color color(double value, double lit) const {
        double offset = value - origin();
        return {(row[0] + row[4] * offset) * lit, (row[1] + row[5] * offset) * lit, (row[2] + row[6] * offset) * lit};
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
    Color sum = {middle.r * opacity, middle.g * opacity, middle.b * opacity};
    for (int node = 0; node < NUM_NODES; node++) {
        double weight = WEIGHTS[node] * density(node) * exp_of(-depth_before(node));
        auto [r, g, b] = color(node);
        sum.r += weight * (r - middle.r);
        sum.g += weight * (g - middle.g);
        sum.b += weight * (b - middle.b);
    }
    return {sum, depth, opacity};
}

// One of the equal steps through a piece, each `width` wide in x.
INLINE Step pass_step(const Piece& piece, double step, double width) {
    auto [d0, d1, d2, d3] = restrict_cubic(piece.tau, step * width, width);
    // From the integrand in powers of x to its integral from 0 to x, divided by x.
    d0 = d0 * width, d1 = d1 * width / 2.0, d2 = d2 * width / 3.0, d3 = d3 * width / 4.0;
    auto color_at = [&](double at) __attribute__((always_inline)) {
        double x = (step + at) * width;
        double lit = piece.light ? piece.light->lambert_factor(piece.gradient, piece.start + x * piece.extent) : 1.0;
        return piece.interval.color(value_at(piece.value, x), lit);
    };
    return quadrature(
        color_at(0.5), most(0.0, d0 + d1 + d2 + d3), [&](int node) { return color_at(NODES[node]); },
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
        auto [r, g, b] = piece.interval.color(value_at(piece.value, x), lit);
        density = most(0.0, value_at(tau, at)) * width * extinction;
        return Color{r + highlight, g + highlight, b + highlight};
    };
    const Color colors[] = {
        color_at(NODES[0], densities[0]),
        color_at(NODES[1], densities[1]),
        color_at(NODES[2], densities[2]),
        color_at(NODES[3], densities[3]),
    };
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
Cubic clamp_cubic(const Cubic& f, double low, double high) {
    // The other Bernstein coefficients.
    double one = f.a + f.b / 3.0, two = f.a + (2.0 * f.b + f.c) / 3.0, three = f.a + f.b + f.c + f.d;
    double room = high - low;
    if (least(least(least(f.a, one), two), three) >= low - room &&
        most(most(most(f.a, one), two), three) <= high + room)
        return f;
    return {least(most(0.5 * (f.a + three), low), high), 0.0, 0.0, 0.0};
}

Cubic combination(Point weights, const Gradient& g) {
    auto sum = [&](double x, double y, double z) { return dot(weights, {x, y, z}); };
    return {sum(g.x.a, g.y.a, g.z.a), sum(g.x.b, g.y.b, g.z.b), sum(g.x.c, g.y.c, g.z.c), sum(g.x.d, g.y.d, g.z.d)};
}

// All that a call has in common. splits: scratch space; gathered: [steps, 4 + intervals], along one ray.
struct Integrator {
    Voxels voxels;
    Array<uint8_t, 3> macrocells;
    Intervals intervals;
    const Maybe<LambertShading>& shading;
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
        auto [low, high] = voxels.macrocell_range(macrocell);
        return low <= high && is_visible(low * intervals.scale, high * intervals.scale) ? VISIBLE : EMPTY;
    }

    // The gradient per world unit along the ray inside a cell.
    Gradient world_gradient(const Segment& segment) const {
        auto along = [&](int axis) {
            double corners[8];
            voxels.load_corners(segment.cell, axis, intervals.scale, corners);
            return cubic_in_cell(corners, segment.entry, segment.extent);
        };
        Gradient in_index = {along(0), along(1), along(2)};
        const double* matrix = shading.value.world_from_index_gradient;
        return {combination(row_of(matrix, 0), in_index), combination(row_of(matrix, 1), in_index),
                combination(row_of(matrix, 2), in_index)};
    }

    // Add the piece [start, end] of a cell, which lies in one interval, to what has been gathered.
    //
    // length, length_voxels: of the segment in the whole cell.
    void integrate_piece(const Cubic& cubic, const Gradient& gradient, const Light* light, double start, double end,
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
        double t0 = (base + slope * (value.a - in.origin())) * scale;
        double t1 = slope * value.b * scale, t2 = slope * value.c * scale, t3 = slope * value.d * scale;
        double bound = most(most(most(t0, t0 + t1 / 3.0), t0 + (2.0 * t1 + t2) / 3.0), t0 + t1 + t2 + t3);
        double num_parts = most(most(1.0, (end - start) * length_voxels),
                                least(bound / MAX_DEPTH_OF_STEP, MAX_STEPS_BY_DEPTH));
        Piece piece = {in, gradient, light, start, end - start, value, {t0, t1, t2, t3}};
        bool is_glossy = light && light->shading.gloss.exists;
        for (int64_t number = 0; number < max_steps.shape[0]; number++) {
            const auto sums = gathered[number];
            int64_t num_steps = (int64_t)__builtin_ceil(num_parts / max_steps[number]);
            double width = 1.0 / (double)num_steps;
            for (int64_t step = 0; step < num_steps && !(sums[DEPTH] > MAX_OPTICAL_DEPTH); step++) {
                auto [radiance, depth, opacity] = is_glossy ? pass_glossy_step(piece, (double)step, width)
                                                            : pass_step(piece, (double)step, width);
                double transmittance = exp_of(-sums[DEPTH]);
                sums[0] += transmittance * radiance.r;
                sums[1] += transmittance * radiance.g;
                sums[2] += transmittance * radiance.b;
                sums[DEPTH] += depth;
                sums[FIRST_INTERVAL + k] += transmittance * opacity;
            }
        }
    }

    void integrate_cell(const Segment& segment, Light* light) const {
        double corners[8];
        int absent = voxels.load_corners(segment.cell, VALUE, intervals.scale, corners);
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
            light->begin = {(double)cell.x + entry.x, (double)cell.y + entry.y, (double)cell.z + entry.z};
            light->extent = extent;
            gradient = world_gradient(segment);
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

    // Add a part of one ray from cell to cell, for each of the steps, to what has been gathered.
    void integrate_part(Point origin, Point direction, double start, double end, Light* light) const {
        walk_cells(voxels.size(), origin, direction, start, end, [&](const Segment& segment) {
            if (!(segment.end > segment.start)) return true;
            auto [x, y, z] = segment.macrocell;
            uint8_t& state = macrocells(z, y, x);
            if (state == UNKNOWN) state = classify(segment.macrocell);  // the same value on all threads
            if (state == EMPTY) return true;
            integrate_cell(segment, light);
            return !is_opaque();
        });
    }

    void integrate_ray(Point origin, Point direction, const Array<const double, 2>& parts) const {
        for (int64_t k = 0; k < gathered.size(); k++) gathered.data[k] = 0.0;
        Light light(shading.value, direction);
        for (int64_t k = 0; k < parts.shape[0] && !is_opaque(); k++)
            integrate_part(origin, direction, parts(k, 0), parts(k, 1), shading.exists ? &light : nullptr);
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
    int64_t num_steps = max_steps.shape[0], num_gathered = FIRST_INTERVAL + intervals.rows.shape[0];
    if (!fit(rays) || !fits_macrocells(macrocells, values) || num_steps == 0 || intervals.rows.shape[1] != 10 ||
        intervals.rows.shape[0] != intervals.knots.shape[0] + 1 || radiance.shape[0] != rays.parts.shape[0] ||
        radiance.shape[1] != num_steps || radiance.shape[2] <= DEPTH || radiance.shape[2] > num_gathered ||
        (shading.value.gloss.exists && shading.value.gloss.value.factors.shape[1] != 3))
        return OUT_OF_BOUNDS;
    // A cubic passes a knot at most three times, and so does the cosine of the light. Another voxel becomes the nearest
    // at most three times.
    Buffer<double> splits(3 * intervals.knots.shape[0] + 6), gathered(num_steps * num_gathered);
    if (!splits || !gathered) return NO_MEMORY;
    return with_voxels(values, [&](const auto& voxels) {
        const Integrator integrator = {
            voxels,    macrocells, intervals,
            shading,   max_steps,  splits,
            {gathered.data, {num_steps, num_gathered}},
        };
        for (int64_t i = 0; i < rays.parts.shape[0]; i++) {
            integrator.integrate_ray(point_of(rays.origins[i]), point_of(rays.directions[i]), rays.parts[i]);
            for (int64_t step = 0; step < num_steps; step++) {
                for (int64_t channel = 0; channel < radiance.shape[2]; channel++)
                    radiance(i, step, channel) = integrator.gathered(step, channel);
                radiance(i, step, DEPTH) = -expm1_of(-integrator.gathered(step, DEPTH));
            }
        }
        return DONE;
    });
}
