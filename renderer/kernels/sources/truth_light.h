// The light on a point of a ray, by its definition: Lambert's law, highlights, and factors on extinction.
#pragma once
#include "kernels.h"
#include "maths.h"
#include "truth_cubic.h"

namespace truth {

// A sum of squares that is no smaller is accurate, and one that is no larger than its inverse, too.
constexpr double LEAST_SQUARE = 0x1p-900;

// The three components along a segment.
struct Gradient {
    Cubic x, y, z;
};

// The light on a ray, and on a segment of it.
//
// halfway: the unit vector halfway between the directions to the light and to the viewer; zeros where they are
// opposite. begin, extent: of the segment, in index space.
struct Light {
    const RayShading* shading;
    Point light, halfway = {}, begin = {}, extent = {};

    // direction: of the ray in index space, of length 1 in the world.
    INLINE Light(const RayShading& spec, Point direction) : shading(&spec), light(point_of(spec.light)) {
        if (shading->is_plain) return;
        auto towards = [&](int row) { return -dot(point_of(&shading->world_from_index[3 * row]), direction); };
        Point viewer = {towards(0), towards(1), towards(2)};
        if (shading->is_camera) light = viewer;
        halfway = light + viewer;
        double length = __builtin_sqrt(dot(halfway, halfway));
        halfway *= length > 0.0 ? 1.0 / length : 0.0;
    }

    // The share of the light that arrives at t along the segment, by one of the grids.
    double arriving(const Array<const float, 3>& grid, double strength, double t) const {
        if (grid.size() == 0) return 1.0;
        double place[3], mean = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            double cells = (begin[axis] + t * extent[axis] + 0.5) / shading->grid.cell_size + 0.5;
            place[axis] = least(most(cells, 0.5), (double)grid.shape[2 - axis] - 1.5);
        }
        auto [u, v, w] = place;
        int64_t i = (int64_t)u, j = (int64_t)v, k = (int64_t)w;
        double a = u - (double)i, b = v - (double)j, c = w - (double)k;
        for (int corner = 0; corner < 8; corner++) {
            int p = corner & 1, q = corner >> 1 & 1, r = corner >> 2;
            double weight = (p ? a : 1.0 - a) * (q ? b : 1.0 - b) * (r ? c : 1.0 - c);
            mean += weight * (double)grid(k + r, j + q, i + p);
        }
        return 1.0 - strength * (1.0 - mean);
    }

    // A vector against the gradient at t, its length, which is 0 without a gradient, and by what both were divided.
    struct Normal {
        Point vector;
        double length, divisor;
    };
    INLINE Normal normal_at(const Gradient& gradient, double t) const {
        Point normal = -Point{value_at(gradient.x, t), value_at(gradient.y, t), value_at(gradient.z, t)};
        double square = dot(normal, normal), divisor = 1.0;
        if (!(LEAST_SQUARE < square && square < 1.0 / LEAST_SQUARE)) {  // squares must neither overflow nor vanish
            divisor = most(most(absolute(normal.x), absolute(normal.y)), absolute(normal.z));
            if (divisor == 0.0) return {normal, 0.0, 0.0};
            normal /= divisor, square = dot(normal, normal);
        }
        return {normal, __builtin_sqrt(square), divisor};
    }

    // The factor on colour, by Lambert's law.
    INLINE double lambert_factor(const Gradient& gradient, double t) const {
        auto [normal, length, divisor] = normal_at(gradient, t);
        if (divisor == 0.0) return shading->ambient;
        return shading->ambient + shading->diffuse * most(0.0, dot(normal, light) / length);
    }

    // The factor on extinction at a gradient's magnitude.
    double extinction_factor(double magnitude) const {
        const auto& factors = shading->factors;
        double factor = factors.shape[0] > 0 ? factors(0, 1) : 1.0;
        for (int64_t k = 0; k < factors.shape[0]; k++)
            if (magnitude >= factors(k, 0)) factor = factors(k, 1) + factors(k, 2) * (magnitude - factors(k, 0));
        return factor;
    }

    // The factor on colour, the white light that is added, and the factor on extinction, at t (J. F. Blinn, "Models of
    // Light Reflection for Computer Synthesized Pictures", SIGGRAPH 1977).
    struct Factors {
        double lit, highlight, extinction;
    };
    INLINE Factors factors_at(const Gradient& gradient, double t) const {
        auto [normal, length, divisor] = normal_at(gradient, t);
        double ambient = shading->ambient * arriving(shading->grid.occlusion, shading->grid.occlusion_strength, t);
        if (divisor == 0.0) return {ambient, 0.0, extinction_factor(0.0)};
        double diffuse = arriving(shading->grid.shadow, shading->grid.shadow_strength, t), highlight = 0.0;
        double to_light = dot(normal, light) / length, to_halfway = dot(normal, halfway) / length;
        if (shading->is_two_sided) to_light = absolute(to_light), to_halfway = absolute(to_halfway);
        if (to_light > 0.0 && to_halfway > 0.0)
            highlight = shading->specular * power_of(to_halfway, shading->shininess) * diffuse;
        double lit = ambient + shading->diffuse * diffuse * most(0.0, to_light);
        return {lit, highlight, extinction_factor(length * divisor)};
    }
};

}  // namespace truth
