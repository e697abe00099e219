// The light on a point of a ray, by its definition: Lambert's law, highlights, and factors on extinction.
#pragma once
#include "truth/kernels.h"
#include "base/maths.h"
#include "truth/truth_cubic.h"

namespace truth {

// Sums of squares are accurate between this number and its reciprocal: below, squares lose digits to underflow; above,
// they may overflow.
constexpr double LEAST_SQUARE = 0x1p-900;

// The three components of the gradient along a segment, each a cubic.
struct Gradient {
    Cubic x, y, z;
};

// The light on a ray, and on one of its segments.
struct Light {
    const RayShading* shading;
    // The unit vector towards the light.
    Point light;
    // The unit vector towards the viewer.
    Point viewer = {};
    // The unit vector halfway between the directions to the light and to the viewer; zeros if these are opposite.
    Point halfway = {};
    // The start of the segment, in index space.
    Point begin = {};
    // The vector from the segment's start to its end, in index space.
    Point extent = {};
    // The clipped sets whose cut faces are lit by their own normals.
    Array<const RemovedSet, 1> removed = {};

    // Find the directions to the light and to the viewer for a ray. direction: the direction of the ray in index space,
    // of length 1 in the world.
    INLINE Light(const RayShading& spec, Point direction) : shading(&spec), light(point_of(spec.light)) {
        if (shading->is_plain) return;
        auto towards = [&](int row) { return -dot(point_of(&shading->world_from_index[3 * row]), direction); };
        viewer = {towards(0), towards(1), towards(2)};
        if (shading->is_camera) light = viewer;
        halfway = light + viewer;
        double length = __builtin_sqrt(dot(halfway, halfway));
        halfway *= length > 0.0 ? 1.0 / length : 0.0;
    }

    // Return the share of the light that arrives at t along the segment. grid: the grid for occlusion or for shadow.
    // strength: how much of the grid's factors applies, from 0 to 1.
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

    // The normal at a point: a vector against the gradient.
    struct Normal {
        // The negative gradient, divided by `divisor`.
        Point vector;
        // The length of `vector`, which may be 0.
        double length;
        // The divisor of the gradient, with which squares neither overflow nor vanish; 0 if the gradient is 0.
        double divisor;
    };
    // Return the normal at t along the segment.
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

    // The light on a point.
    struct Lit {
        // The factor on the colour of the point.
        double factor;
        // The white light that is added to the colour of the point: a highlight.
        double highlight;
    };

    // Call `take(weight, normal)` for each cut face near the point at t along the segment. normal: a unit vector.
    template <class Take>
    INLINE void for_faces(double t, Take take) const {
        const Point place = begin + t * extent;
        for (int64_t k = 0; k < removed.shape[0]; k++) {
            const auto& [own_from_index, world_from_own, low, high] = removed[k];
            Point way;
            for (int axis = 0; axis < 3; axis++) {
                double own = dot(point_of(&own_from_index[4 * axis]), place) + own_from_index[4 * axis + 3];
                way[axis] = (least(most(own, low[axis]), high[axis]) - own) / shading->face_depth;
            }
            double near = 1.0 - dot(way, way), weight = near * near * near;
            if (!(near > 0.0)) continue;
            if (near == 1.0) way = {1.0, 0.0, 0.0};  // the point is on the face
            way /= __builtin_sqrt(dot(way, way));
            auto along = [&](int row) { return dot(point_of(&world_from_own[3 * row]), way); };
            take(weight, Point{along(0), along(1), along(2)});
        }
    }

    // Return the light at t along the segment, a mixture of two lights: `lit`, by the gradient, and the light by the
    // normals of cut faces near the point. lit_by(normal): returns the light for a unit vector as the normal.
    template <class LitBy>
    INLINE Lit with_faces(Lit lit, double t, LitBy lit_by) const {
        double rest = 1.0, sum = 0.0;
        Lit of_faces = {};
        for_faces(t, [&](double weight, Point normal) __attribute__((always_inline)) {
            auto [factor, highlight] = lit_by(normal);
            of_faces = {of_faces.factor + weight * factor, of_faces.highlight + weight * highlight};
            rest *= 1.0 - weight, sum += weight;
        });
        if (sum == 0.0) return lit;
        double share = (1.0 - rest) / sum;
        return {rest * lit.factor + share * of_faces.factor, rest * lit.highlight + share * of_faces.highlight};
    }

    // Return the factor on the colour at t along the segment, by Lambert's law.
    INLINE double lambert_factor(const Gradient& gradient, double t) const {
        auto [normal, length, divisor] = normal_at(gradient, t);
        auto lit_by = [&](double cosine) { return Lit{shading->ambient + shading->diffuse * most(0.0, cosine), 0.0}; };
        Lit lit = divisor == 0.0 ? Lit{shading->ambient, 0.0} : lit_by(dot(normal, light) / length);
        return with_faces(lit, t, [&](Point face) { return lit_by(dot(face, light)); }).factor;
    }

    // Return the factor on extinction for a gradient's magnitude.
    double extinction_factor(double magnitude) const {
        const auto& factors = shading->factors;
        double factor = factors.shape[0] > 0 ? factors(0, 1) : 1.0;
        for (int64_t k = 0; k < factors.shape[0]; k++)
            if (magnitude >= factors(k, 0)) factor = factors(k, 1) + factors(k, 2) * (magnitude - factors(k, 0));
        return factor;
    }

    // The light on a point, and the effect of its gradient on extinction.
    struct Factors {
        // The factor on the colour of the point.
        double lit;
        // The white light that is added to the colour of the point: a highlight.
        double highlight;
        // The factor on the extinction at the point.
        double extinction;
    };
    // Return the factors at t along the segment (J. F. Blinn, "Models of Light Reflection for Computer Synthesized
    // Pictures", SIGGRAPH 1977).
    INLINE Factors factors_at(const Gradient& gradient, double t) const {
        auto [normal, length, divisor] = normal_at(gradient, t);
        double ambient = shading->ambient * arriving(shading->grid.occlusion, shading->grid.occlusion_strength, t);
        double diffuse = arriving(shading->grid.shadow, shading->grid.shadow_strength, t);
        auto lit_by = [&](Point normal, double length) {
            double highlight = 0.0, to_light = dot(normal, light) / length, to_halfway = dot(normal, halfway) / length;
            if (shading->two_sided) to_light = absolute(to_light), to_halfway = absolute(to_halfway);
            if (to_light > 0.0 && to_halfway > 0.0)
                highlight = shading->specular * power_of(to_halfway, shading->shininess) * diffuse;
            double lit = ambient + shading->diffuse * diffuse * most(0.0, to_light);
            double across = most(0.0, 1.0 - absolute(dot(normal, viewer) / length));
            double kept = 1.0 - shading->silhouette * across * across * across;
            return Lit{kept * lit, kept * highlight};
        };
        Lit own = divisor == 0.0 ? Lit{ambient, 0.0} : lit_by(normal, length);
        auto [lit, highlight] = with_faces(own, t, [&](Point face) { return lit_by(face, 1.0); });
        return {lit, highlight, extinction_factor(divisor == 0.0 ? 0.0 : length * divisor)};
    }
};

}  // namespace truth
