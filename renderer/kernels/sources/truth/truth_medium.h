// Evaluate a layer at any point, and track light through it along any ray.
//
// Tracking looks at few points of a ray. Where the extinction were the majorant of a macrocell, the largest extinction
// there, light would collide after lengths with an exponential density. At each such place, it collides with the
// probability extinction / majorant (E. Woodcock et al., "Techniques Used in the GEM Code for Monte Carlo Neutronics
// Calculations", 1965). The product of the probabilities of no collision has the transmittance as its mean (J. Novak, A.
// Selle and W. Jarosz, "Residual Ratio Tracking for Estimating Attenuation in Participating Media", 2014). Both are
// exact in the mean, for every field that is never above its majorant.
#pragma once
#include "truth/truth_layer.h"
#include "truth/truth_random.h"

namespace truth {

// The transmittance below which tracking goes on with a probability of a half only, and then counts twice.
constexpr double LEAST_TRANSMITTANCE = 0.1;

// Return a [3, 4] transformation of a point.
INLINE Point transformed(const double* matrix, Point at) {
    auto row = [&](int axis) { return dot(point_of(matrix + 4 * axis), at) + matrix[4 * axis + 3]; };
    return {row(0), row(1), row(2)};
}

// Return a [3, 4] transformation of a direction.
INLINE Point turned(const double* matrix, Point along) {
    auto row = [&](int axis) { return dot(point_of(matrix + 4 * axis), along); };
    return {row(0), row(1), row(2)};
}

// A walk from macrocell to macrocell along a ray in index space.
struct MacrocellWalk {
    // The origin of the ray, in voxels.
    Point origin;
    // The direction of the ray, of unit length in the world.
    Point direction;
    // The macrocell at which the walk stands, along x, y and z.
    Cell macrocell;
    // The lengths along the ray at which it leaves the next macrocell along x, y and z.
    Point exits;
    // The length along the ray at which the next macrocell begins.
    double s;
    // The length along the ray at which the walk ends.
    double last;

    INLINE MacrocellWalk(Cell size, Point from, Point along, double end) : origin(from), direction(along) {
        auto part = clip_to_volume(size, from, along, 0.0, end);
        s = part.low, last = part.high;
        if (!(s < last)) return;
        for (int axis = 0; axis < 3; axis++) {
            double at = (origin[axis] + s * direction[axis] + 1.0) / (double)MACROCELL_SIZE;
            macrocell[axis] = least(most<int64_t>((int64_t)__builtin_floor(at), 0), size[axis] / MACROCELL_SIZE);
            exits[axis] = exit(axis);
        }
    }

    INLINE double exit(int axis) const {
        if (direction[axis] == 0.0) return INFINITE;
        double plane = (double)(MACROCELL_SIZE * (macrocell[axis] + (direction[axis] > 0.0)) - 1);
        return (plane - origin[axis]) / direction[axis];
    }

    // Call take(macrocell, start, end) for each macrocell on the ray, until it returns false.
    template <class Take>
    INLINE void visit(Take take) {
        while (s < last) {
            int axis = exits.x <= exits.y && exits.x <= exits.z ? 0 : exits.y <= exits.z ? 1 : 2;
            double end = least(most(exits[axis], s), last);
            if (end > s && !take(macrocell, s, end)) return;
            s = end;
            macrocell[axis] += direction[axis] > 0.0 ? 1 : -1, exits[axis] = exit(axis);
        }
    }
};

// The matter of a layer at a point: its extinction, and where to find its albedo.
struct Matter {
    // The extinction, per world length; the albedo has no meaning if the extinction is 0.
    double extinction;
    // The interval of the transfer function that holds the scalar.
    Interval interval;
    // The scalar, times `Intervals.scale`.
    double value;

    INLINE Color albedo() const { return interval.color(value, 1.0); }
};

// A layer that light passes along any ray.
struct Medium {
    // The values of the layer, and how they are shown.
    const LayerOptics* optics;
    // The layer in space.
    const PathMedium* place;
    // The clip sets of the layer.
    Array<const RemovedSet, 1> removed;

    INLINE Interval interval(int64_t k) const { return {optics->intervals.rows[k]}; }

    INLINE double extinction_at(Interval in, double value) const {
        return most(0.0, in.base() + in.slope() * (value - in.origin())) * optics->weight;
    }

    // Return the largest extinction in a macrocell. Extinction is linear between control values: it is largest at one
    // of them, or at an end of the macrocell's range of scalars.
    double majorant_of(Cell macrocell) const {
        double& known = place->majorants(macrocell.z, macrocell.y, macrocell.x);
        if (!is_nan(known)) return known;
        auto [low, high] = macrocell_range(optics->voxels, macrocell);
        double found = 0.0;
        if (low <= high) {
            const auto& [knots, rows, scale] = optics->intervals;
            int64_t first = num_below(knots, low * scale), last = num_below(knots, high * scale);
            found = most(extinction_at(interval(first), low * scale), extinction_at(interval(last), high * scale));
            for (int64_t k = first + 1; k <= last; k++) found = most(found, interval(k).base() * optics->weight);
        }
        return known = found;  // all threads find the same number
    }

    // Return the matter at a point of the world. index: the same point in the layer's index space, inside the volume.
    Matter matter_at(Point world, Point index) const;

    // Call take(s, matter, majorant) at each place of tracking along a ray that begins at `from`, until it returns
    // false. end: the length along the ray at which tracking ends.
    template <class Take>
    INLINE void track(Point from, Point along, double end, Random& random, Take take) const {
        const Point origin = transformed(place->index_from_world, from);
        const Point direction = turned(place->index_from_world, along);
        double depth = random.exponential();
        MacrocellWalk(size_of(optics->voxels), origin, direction, end).visit([&](Cell macrocell, double s, double exit) {
            const double majorant = majorant_of(macrocell);
            if (!(majorant > 0.0)) return true;
            while (s + depth / majorant < exit) {
                s += depth / majorant, depth = random.exponential();
                if (!take(s, matter_at(from + s * along, origin + s * direction), majorant)) return false;
            }
            depth = most(0.0, depth - (exit - s) * majorant);
            return true;
        });
    }

    // Return the length along a ray at which light collides with the layer, and write the matter there to `met`; an
    // infinite length if light passes.
    double collide(Point from, Point along, double end, Random& random, Matter& met) const {
        double at = INFINITE;
        track(from, along, end, random, [&](double s, const Matter& matter, double majorant) __attribute__((always_inline)) {
            if (!(random.below_one() * majorant < matter.extinction)) return true;
            at = s, met = matter;
            return false;
        });
        return at;
    }

    // Return a random number whose mean is the transmittance of the layer along a ray from a point on.
    double transmittance(Point from, Point along, Random& random) const {
        double left = 1.0;
        track(from, along, INFINITE, random, [&](double, const Matter& matter, double majorant) __attribute__((always_inline)) {
            left *= most(0.0, 1.0 - matter.extinction / majorant);
            if (left >= LEAST_TRANSMITTANCE) return true;
            left = random.below_one() < 0.5 ? 0.0 : 2.0 * left;
            return left > 0.0;
        });
        return left;
    }
};

}  // namespace truth
