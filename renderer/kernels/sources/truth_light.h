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

INLINE Point value_at(const Gradient& gradient, double t) {
    return {value_at(gradient.x, t), value_at(gradient.y, t), value_at(gradient.z, t)};
}

INLINE double largest_of(Point point) {
    return most(most(absolute(point.x), absolute(point.y)), absolute(point.z));
}

INLINE Point row_of(const double* matrix, int row) {
    return {matrix[3 * row], matrix[3 * row + 1], matrix[3 * row + 2]};
}

// The light on a ray, and on a segment of it.
//
// halfway: the unit vector halfway between the directions to the light and to the viewer; zeros where they are
// opposite. begin, extent: of the segment, in index space.
struct Light {
    const LambertShading& shading;
    Point light, halfway = {}, begin = {}, extent = {};

    // direction: of the ray in index space, of length 1 in the world.
    INLINE Light(const LambertShading& spec, Point direction) : shading(spec), light(row_of(spec.light, 0)) {
        if (!shading.gloss.exists) return;
        const Gloss& gloss = shading.gloss.value;
        auto towards = [&](int row) { return -dot(row_of(gloss.world_from_index, row), direction); };
        Point viewer = {towards(0), towards(1), towards(2)};
        if (gloss.is_camera) light = viewer;
        halfway = {light.x + viewer.x, light.y + viewer.y, light.z + viewer.z};
        double length = __builtin_sqrt(dot(halfway, halfway)), inverse = length > 0.0 ? 1.0 / length : 0.0;
        halfway = {halfway.x * inverse, halfway.y * inverse, halfway.z * inverse};
    }

    // The share of the light that arrives at t along the segment, by one grid of the light field.
    double arriving(const Array<const float, 3>& grid, double strength, double t) const {
        if (grid.size() == 0) return 1.0;
        auto in_grid = [&](double place, int64_t num) {  // which has `num` cells there
            double cells = (place + 0.5) / shading.gloss.value.field.cell_size + 0.5;
            return least(most(cells, 0.5), (double)num - 1.5);
        };
        double u = in_grid(begin.x + t * extent.x, grid.shape[2]), v = in_grid(begin.y + t * extent.y, grid.shape[1]);
        double w = in_grid(begin.z + t * extent.z, grid.shape[0]);
        int64_t i = (int64_t)u, j = (int64_t)v, k = (int64_t)w;
        double a = u - (double)i, b = v - (double)j, c = w - (double)k, mean = 0.0;
        for (int corner = 0; corner < 8; corner++) {
            int p = corner & 1, q = corner >> 1 & 1, r = corner >> 2;
            double weight = (p ? a : 1.0 - a) * (q ? b : 1.0 - b) * (r ? c : 1.0 - c);
            mean += weight * (double)grid(k + r, j + q, i + p);
        }
        return 1.0 - strength * (1.0 - mean);
    }

    // The factor on colour, by Lambert's law.
    INLINE double lambert_factor(const Gradient& gradient, double t) const {
        Point slope = value_at(gradient, t);
        double square = dot(slope, slope);
        if (!(LEAST_SQUARE < square && square < 1.0 / LEAST_SQUARE)) {  // squares must neither overflow nor vanish
            double largest = largest_of(slope);
            if (largest == 0.0) return shading.ambient;
            slope = {slope.x / largest, slope.y / largest, slope.z / largest};
            square = dot(slope, slope);
        }
        double cosine = -dot(slope, light) / __builtin_sqrt(square);
        return shading.ambient + shading.diffuse * most(0.0, cosine);
    }

    // The factor on extinction at a gradient's magnitude.
    double extinction_factor(double magnitude) const {
        const auto& factors = shading.gloss.value.factors;
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
        const Gloss& gloss = shading.gloss.value;
        Point slope = value_at(gradient, t), normal = {-slope.x, -slope.y, -slope.z};
        double square = dot(normal, normal), largest = 1.0;
        double ambient = arriving(gloss.field.occlusion, gloss.field.occlusion_strength, t);
        double diffuse = arriving(gloss.field.shadow, gloss.field.shadow_strength, t);
        if (!(LEAST_SQUARE < square && square < 1.0 / LEAST_SQUARE)) {
            largest = largest_of(normal);
            if (largest == 0.0) return {shading.ambient * ambient, 0.0, extinction_factor(0.0)};
            normal = {normal.x / largest, normal.y / largest, normal.z / largest};
            square = dot(normal, normal);
        }
        double length = __builtin_sqrt(square);
        double to_light = dot(normal, light) / length, to_halfway = dot(normal, halfway) / length;
        if (gloss.is_two_sided) to_light = absolute(to_light), to_halfway = absolute(to_halfway);
        double highlight = 0.0;
        if (to_light > 0.0 && to_halfway > 0.0)
            highlight = gloss.specular * power_of(to_halfway, gloss.shininess) * diffuse;
        double lit = shading.ambient * ambient + shading.diffuse * diffuse * most(0.0, to_light);
        return {lit, highlight, extinction_factor(length * largest)};
    }
};

}  // namespace truth
