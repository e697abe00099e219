// Follow the paths of light that scatters in layers, backwards from rays: the light of a ray by Monte Carlo.
//
// The radiance of a ray is int T tau a phi ds: the transmittance T to a point, the extinction tau, the albedo a, and the
// mean radiance phi of all directions at the point. Extinction and opacity are exact along the ray (truth_layer.h).
// Each path begins at a point that is chosen on the ray by the opacity that the point adds; the points are stratified.
// From there on, directions are isotropic and lengths come from tracking (truth_medium.h). The nearest collision of all
// layers is a collision of their sum. At each collision, a random direction to the key light adds the light of the key
// (next-event estimation); a path that leaves all layers adds the light of the environment. A path that carries little
// light ends by chance (Russian roulette), and counts more if it goes on. With surfaces, a path may begin on a surface of
// one of the layers (truth_surface.h): its first direction is then on the side of the normal. M. Pharr, W. Jakob and G. Humphreys,
// "Physically Based Rendering", 2016, chapter 15.
#include "truth/truth_fog.h"
#include "truth/kernels.h"
#include "base/stopping.h"
#include "truth/truth_medium.h"
#include "truth/truth_surface.h"

namespace truth {
namespace {

// A path may end by chance when it carries less than this share of the light that it began with.
constexpr double LEAST_SHARE = 0.25;
// The share of a sphere's solid angle in one steradian: 1 / (4 pi).
constexpr double PER_SPHERE = 0.07957747154594767;
// 1 / pi.
constexpr double PER_PI = 0.3183098861837907;
// The coefficients of the colour of thick matter, and of the light that is absorbed on its way to surfaces in it, as in
// renderer/transfer/albedos.py.
constexpr double OF_NUMERATOR = 0.139;
constexpr double OF_DENOMINATOR = 1.17;
constexpr double OF_SURFACE = 1.68;
// The optical depth of a ray up to which opacities are proportional to depths, within a millionth.
constexpr double CLEAR = 1e-6;
// The number of halvings by which the place of an optical depth is found in a part of a ray.
constexpr int NUM_HALVINGS = 52;

// Return the optical depth from the start of a part of a ray to x. tau: the depth per unit of x, as a cubic in x.
INLINE double depth_at(Cubic tau, double x) {
    return x * (tau[0] + x * (tau[1] / 2.0 + x * (tau[2] / 3.0 + x * (tau[3] / 4.0))));
}

// Return the depth per unit of x, as a cubic in x, of all layers in a list. x goes from 0 to 1 over the part.
INLINE Cubic sum_of_tau(const LayerRay* first) {
    Cubic sum = {};
    for (const LayerRay* layer = first; layer; layer = layer->next) sum += layer->part.tau;
    return sum;
}

// Return the mean albedo of the layers in a list at x, weighted by extinction.
Color mean_albedo(const LayerRay* first, double x) {
    Color sum = {};
    double total = 0.0;
    for (const LayerRay* layer = first; layer; layer = layer->next) {
        double tau = most(0.0, value_at(layer->part.tau, x));
        sum += tau * layer->part.interval.color(value_at(layer->part.value, x), 1.0), total += tau;
    }
    return total > 0.0 ? sum / total : sum;
}

// Return the albedo of a layer at x.
INLINE Color albedo_at(const LayerRay& layer, double x) {
    return layer.part.interval.color(value_at(layer.part.value, x), 1.0);
}

// Return one of the layers in a list, by chance; the probability of each is its share of the extinction at x.
const LayerRay& random_layer(const LayerRay* first, double x, Random& random) {
    const double total = value_at(sum_of_tau(first), x), chosen = random.below_one() * total;
    double reached = 0.0;
    const LayerRay* last = first;
    for (const LayerRay* layer = first; layer; last = layer, layer = layer->next) {
        reached += most(0.0, value_at(layer->part.tau, x));
        if (chosen < reached) return *layer;
    }
    return *last;
}

// Return the reflectance of surfaces of matter of an albedo.
INLINE Color surface_reflectance(Color albedo) {
    Color shown;
    for (int channel = 0; channel < 3; channel++) {
        const double s = __builtin_sqrt(most(0.0, 1.0 - albedo[channel]));
        const double of_thick = (1.0 - OF_NUMERATOR * s) * (1.0 - s) / (1.0 + OF_DENOMINATOR * s);
        shown[channel] = of_thick * (1.0 + OF_SURFACE * s);
    }
    return shown;
}

// A tracer of paths, with the data that all rays of a call share.
struct PathTracer {
    // The sources of light.
    const PathLight& light;
    // The fog along all rays.
    const Maybe<RayFog>& fog;
    // The layers, along any ray.
    Array<Medium, 1> media;
    // The state of the ray in each layer.
    Array<LayerRay, 1> layers;

    INLINE Color environment(Point direction) const {
        double cosine = dot(point_of(light.up), direction);
        auto band = [&](int number) { return point_of(&light.environment(number, 0)); };
        Color sum = band(0) + cosine * band(1) + (1.5 * cosine * cosine - 0.5) * band(2);
        return __builtin_elementwise_max(sum, Color{});
    }

    // Return a factor times the share of the key light that comes straight from a direction to a point.
    double straight(double factor, Point at, Point direction, Random& random) const {
        for (int64_t k = 0; k < media.shape[0] && factor > 0.0; k++)
            factor *= media[k].transmittance(at, direction, random);
        return factor;
    }

    // Return the mean radiance of the key light at a point, by one direction to it.
    Color key_light(Point at, Random& random) const {
        const Color irradiance = point_of(light.key_irradiance);
        if (__builtin_reduce_max(irradiance) == 0.0) return {};
        const Point direction = random.direction_around(point_of(light.key), light.key_rise);
        return straight(PER_SPHERE, at, direction, random) * irradiance;
    }

    // Return the light of the key that a surface shows, by one direction to the key.
    Color key_on_surface(Point at, Point normal, Point to_viewer, Color color, Random& random) const {
        const Color irradiance = point_of(light.key_irradiance);
        if (__builtin_reduce_max(irradiance) == 0.0) return {};
        const PathSurface& surface = light.surface.value;
        const Point key = point_of(light.key), direction = random.direction_around(key, light.key_rise);
        double highlight = 0.0;
        if (surface.specular > 0.0 && dot(normal, key) > 0.0) {
            const Point halfway = key + to_viewer;
            const double along = dot(normal, halfway), length = __builtin_sqrt(dot(halfway, halfway));
            if (along > 0.0) highlight = surface.specular * power_of(least(1.0, along / length), surface.shininess);
        }
        const Color shown = color * most(0.0, dot(normal, direction)) + highlight;
        if (__builtin_reduce_max(shown) == 0.0) return {};
        return straight(PER_PI, at, direction, random) * irradiance * shown;
    }

    // Return the radiance that arrives at a point from a direction.
    Color arriving(Point at, Point direction, Random& random) const {
        double nearest = INFINITE;
        Matter met = {};
        for (int64_t k = 0; k < media.shape[0]; k++)
            nearest = least(nearest, media[k].collide(at, direction, nearest, random, met));
        if (nearest == INFINITE) return environment(direction);
        return scattered(at + nearest * direction, light.scattering * met.albedo(), random);
    }

    // Return the light that a point of a ray sends along the ray. x: the place of the point in the part of the ray.
    Color shown(const LayerRay* first, double x, Point at, Random& random) const {
        if (!light.surface.exists) return scattered(at, mean_albedo(first, x), random);
        const LayerRay& layer = random_layer(first, x, random);
        const double voxel = media[&layer - layers.data].place->voxel;
        const Facet facet = choose_facet(layer, x, voxel, light.surface.value.share, random);
        if (!facet.exists) return scattered(at, albedo_at(layer, x), random);
        const Color color = surface_reflectance(albedo_at(layer, x));
        const Color of_key = key_on_surface(at, facet.normal, layer.light.viewer, color, random);
        return of_key + color * arriving(at, random.direction_across(facet.normal), random);
    }

    // Return the light that a collision with matter of an albedo sends along the ray. Return it unfinished if the kernel
    // was stopped.
    Color scattered(Point at, Color albedo, Random& random) const {
        const double least_light = LEAST_SHARE * __builtin_reduce_max(albedo);
        Color sum = {}, through = albedo;
        while (!is_stopped()) {
            double largest = __builtin_reduce_max(through);
            if (!(largest > 0.0)) break;
            if (largest < least_light) {
                if (!(random.below_one() * least_light < largest)) break;
                through *= least_light / largest;
            }
            sum += through * key_light(at, random);
            const Point direction = random.direction();
            double nearest = INFINITE;
            Matter met = {};
            for (int64_t k = 0; k < media.shape[0]; k++)
                nearest = least(nearest, media[k].collide(at, direction, nearest, random, met));
            if (nearest == INFINITE) return sum + through * environment(direction);
            at += nearest * direction, through *= light.scattering * met.albedo();
        }
        return sum;
    }

    // Return the optical depth of a ray, or of its beginning if this is opaque.
    double depth_of(int64_t ray) const {
        double depth = 0.0;
        for (int64_t k = 0; k < layers.shape[0]; k++) layers[k].start(ray);
        while (depth < MAX_OPTICAL_DEPTH) {
            LayerRay* first = next_part(layers);
            if (!first) break;
            depth += most(0.0, depth_at(sum_of_tau(first), 1.0));
            finish_part(first);
        }
        return depth;
    }

    // Return the mean light of some paths from a ray of a known optical depth, whose light is divided by its opacity.
    Color mean_of_paths(int64_t ray, uint64_t state, int64_t num_paths, double depth) const {
        const double opacity = -expm1_of(-depth);
        Random random = {};
        Color sum = {};
        int64_t num_begun = 0;
        // Return the optical depth at which the next path begins; it does not descend from path to path.
        auto next_target = [&] {
            if (num_begun == num_paths) return INFINITE;
            random.state = Random::mixed(state + Random::STEP * (uint64_t)(num_begun + 1));
            double share = ((double)num_begun++ + random.below_one()) / (double)num_paths;
            return least(depth, depth < CLEAR ? share * depth : -log_of(1.0 - share * opacity));
        };
        const Point origin = layers[0].walk.origin, direction = layers[0].walk.direction;
        const double* world_from_index = media[0].place->world_from_index;
        double reached = 0.0, target = next_target();
        for (int64_t k = 0; k < layers.shape[0]; k++) layers[k].start(ray);
        while (target < INFINITE) {
            LayerRay* first = next_part(layers);
            if (!first || is_stopped()) break;
            const Cubic tau = sum_of_tau(first);
            const double end = reached + most(0.0, depth_at(tau, 1.0));
            const Piece& part = first->part;
            for (; target <= end && end > reached; target = next_target()) {
                double low = 0.0, high = 1.0;
                for (int k = 0; k < NUM_HALVINGS; k++) {
                    double middle = 0.5 * (low + high);
                    (depth_at(tau, middle) < target - reached ? low : high) = middle;
                }
                const Segment& segment = first->segment;
                double s = lerp(segment.start, segment.end, part.start + high * part.extent);
                const Point at = transformed(world_from_index, origin + s * direction);
                sum += in_fog(fog, ray, s, shown(first, high, at, random));
            }
            reached = end;
            finish_part(first);
        }
        return sum / (double)num_paths;
    }
};

bool fit(const LayerOptics& optics, const PathMedium& medium, bool has_surfaces) {
    const bool fits_mask = !medium.mask.exists || truth::fit(medium.mask.value.voxels);
    return fits_mask && fits_macrocells(medium.majorants, optics.voxels) && !optics.colors.exists &&
           optics.shading.exists == has_surfaces;
}

}  // namespace
}  // namespace truth

// Write the radiance and the opacity of rays.
Status trace_paths(const TracePaths* arguments) {
    using namespace truth;
    const auto& [layers, media, light, rays, fog, states, num_paths, radiance] = *arguments;
    const int64_t num = radiance.shape[0], num_layers = layers.shape[0];
    if (num_layers == 0 || media.shape[0] != num_layers || rays.shape[0] != num_layers || num_paths < 1)
        return OUT_OF_BOUNDS;
    if (!has_shape(radiance, num, 4) || states.shape[0] != num || !fit(fog, num)) return OUT_OF_BOUNDS;
    int64_t num_splits = 0;
    for (int64_t k = 0; k < num_layers; k++) {
        if (!fit(layers[k], rays[k], num) || !fit(layers[k], media[k], light.surface.exists)) return OUT_OF_BOUNDS;
        num_splits += num_splits_of(layers[k]);
    }
    Buffer<double> splits(num_splits);
    Buffer<LayerRay> layer_rays(num_layers);
    Buffer<Medium> in_space(num_layers);
    if (!splits || !layer_rays || !in_space) return NO_MEMORY;
    for (int64_t k = 0, split = 0; k < num_layers; k++) {
        layer_rays[k].prepare(layers[k], rays[k], rest_of(splits, split), 0);
        in_space[k] = {&layers[k], &media[k], rays[k].removed};
        split += num_splits_of(layers[k]);
    }
    const PathTracer tracer = {light, fog, in_space, layer_rays};
    for (int64_t i = 0; i < num; i++) {
        if (is_stopped()) return STOPPED;
        const double depth = tracer.depth_of(i), opacity = -expm1_of(-depth);
        const Color mean = depth > 0.0 ? tracer.mean_of_paths(i, states[i], num_paths, depth) : Color{};
        for (int channel = 0; channel < 3; channel++) radiance(i, channel) = opacity * mean[channel];
        radiance(i, 3) = opacity;
    }
    return is_stopped() ? STOPPED : DONE;
}
