// Random numbers for paths, the same on every machine.
//
// The generator is SplitMix64 (Steele, Lea and Flood, "Fast Splittable Pseudorandom Number Generators", OOPSLA 2014), as
// in renderer/truth/places.py. Each path has a state of its own, so that its numbers depend on no other path.
#pragma once
#include "base/maths.h"
#include "truth/truth_cubic.h"

namespace truth {

// A generator of random numbers.
struct Random {
    // The step of the generator's counter.
    static constexpr uint64_t STEP = 0x9e3779b97f4a7c15;
    // The counter of the generator.
    uint64_t state;

    static INLINE uint64_t mixed(uint64_t counter) {
        counter = (counter ^ (counter >> 30)) * 0xbf58476d1ce4e5b9;
        counter = (counter ^ (counter >> 27)) * 0x94d049bb133111eb;
        return counter ^ (counter >> 31);
    }

    // Return a number of at least 0 and below 1.
    INLINE double below_one() { return (double)(mixed(state += STEP) >> 11) * 0x1p-53; }

    // Return a number above 0 with the density exp(-x).
    INLINE double exponential() { return -log_of(1.0 - below_one()); }

    // A point in the unit disc, and the square of its distance from the centre, which is above 0.
    struct InDisc {
        double x;
        double y;
        double square;
    };

    INLINE InDisc in_disc() {
        for (;;) {
            double x = 2.0 * below_one() - 1.0, y = 2.0 * below_one() - 1.0, square = x * x + y * y;
            if (0.0 < square && square < 1.0) return {x, y, square};
        }
    }

    // Return a unit vector; all directions are equally likely (G. Marsaglia, "Choosing a Point from the Surface of a
    // Sphere", 1972).
    INLINE Point direction() {
        const auto [x, y, square] = in_disc();
        double factor = 2.0 * __builtin_sqrt(1.0 - square);
        return {x * factor, y * factor, 1.0 - 2.0 * square};
    }

    // Return a unit vector on the side of a unit vector `normal`; its probability is proportional to its cosine with the
    // normal.
    INLINE Point direction_across(Point normal) {
        for (;;) {
            const Point sum = normal + direction();
            const double square = dot(sum, sum);
            if (square > 0.0) return sum / __builtin_sqrt(square);
        }
    }

    // Return a unit vector around `axis`; all directions whose cosine with the axis is at least 1 - rise are equally
    // likely.
    INLINE Point direction_around(Point axis, double rise) {
        double sink = below_one() * rise, sine = __builtin_sqrt(most(0.0, sink * (2.0 - sink)));
        const auto [x, y, square] = in_disc();
        Point aside = absolute(axis.x) < 0.6 ? Point{0.0, axis.z, -axis.y} : Point{-axis.z, 0.0, axis.x};
        aside /= __builtin_sqrt(dot(aside, aside));
        Point third = {axis.y * aside.z - axis.z * aside.y, axis.z * aside.x - axis.x * aside.z,
                       axis.x * aside.y - axis.y * aside.x};
        return (1.0 - sink) * axis + sine / __builtin_sqrt(square) * (x * aside + y * third);
    }
};

}  // namespace truth
