// The surfaces of matter that scatters light, at points of a ray.
//
// A point is a surface to a share of 0 to 1, and scatters light with the remainder. The share is that of the scene, times
// the change of opacity, over OPACITY_SPACINGS, between the points one finest spacing before and behind the point along
// the gradient; the normal points to less opacity. Of labels, the change is LABEL_GAIN times the gradient of smoothed opacities. A face that
// clipping cuts is a surface between nothing and the opacity at the point; faces and gradient share the point as they
// share its light (Light::for_faces).
#pragma once
#include "truth/truth_layer.h"
#include "truth/truth_random.h"

namespace truth {

// The factor on the gradient of the smoothed opacities of labels, over the finest spacing. It is 5/16 beside a flat
// border between nothing and an opaque label.
constexpr double LABEL_GAIN = 3.2;

// The surface on which a path begins, if it begins on one.
struct Facet {
    bool exists;
    // The unit normal, in the world.
    Point normal;
};

// The length, in finest spacings, whose opacity tells surfaces.
constexpr double OPACITY_SPACINGS = 4.0;

// Return the opacity of a layer for a value, over OPACITY_SPACINGS. voxel: the finest spacing.
inline double opacity_of(const LayerRay& layer, double value, double voxel) {
    const Interval in = layer.interval(num_below(layer.intervals.knots, value));
    return -expm1_of(-most(0.0, in.base() + in.slope() * (value - in.origin())) * OPACITY_SPACINGS * voxel);
}

// Choose whether a path begins on a surface of a layer, by the share of the surface. x: the place in the part of the ray.
// share: the largest share of surfaces.
inline Facet choose_facet(const LayerRay& layer, double x, double voxel, double share, Random& random) {
    const double t = layer.part.start + x * layer.part.extent, value = value_at(layer.part.value, x);
    const double chosen = random.below_one();
    double rest = 1.0, sum = 0.0, reached = 0.0;
    layer.light.for_faces(t, [&](double weight, Point) { rest *= 1.0 - weight, sum += weight; });
    Facet found = {};
    if (sum > 0.0) {
        const double of_faces = share * (1.0 - rest) / sum * opacity_of(layer, value, voxel);
        layer.light.for_faces(t, [&](double weight, Point normal) {
            reached += of_faces * weight;
            if (!found.exists && chosen < reached) found = {true, normal};
        });
    }
    if (found.exists) return found;
    const auto [normal, length, divisor] = layer.light.normal_at(layer.gradient, t);
    if (divisor == 0.0) return {};
    const double change = length * divisor * voxel;
    double rise = least(1.0, LABEL_GAIN * change);
    if (!layer.label_opacities.exists)
        rise = opacity_of(layer, value + change, voxel) - opacity_of(layer, value - change, voxel);
    if (!(chosen < reached + share * rest * absolute(rise))) return {};
    return {true, (rise < 0.0 ? -1.0 : 1.0) / length * normal};
}

}  // namespace truth
