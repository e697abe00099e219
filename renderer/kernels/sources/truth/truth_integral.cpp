// Integrate rays, one at a time, through the continuous fields of some layers, with several step lengths at once.
//
// Each layer divides the ray into pieces on which its colour and extinction are polynomials (truth_layer.h). Where
// pieces of several layers overlap, the ray is divided at their ends, too. Extinctions add up there, and so do their
// products with colours. The optical depth of a part is exact, and its radiance is a Gauss-Legendre quadrature of a
// smooth function. Nearly all of the time is spent on cells and crossings, which do not depend on the step length:
// another step length costs little.
//
// Factors on extinction by the gradient are no polynomials. Depths are then the integrals of cubics through the nodes
// of the quadrature, and exact where all factors are 1.
#include "truth/kernels.h"
#include "base/stopping.h"
#include "truth/truth_fog.h"
#include "truth/truth_layer.h"

namespace truth {
namespace {

// The largest optical depth of a quadrature step, for a bound of 1 in `max_steps`. With four nodes, steps of at most a
// voxel and of this depth left errors of at most 6e-8 on two CT scans.
constexpr double MAX_DEPTH_OF_STEP = 1.0;
// The number of points of a step (nodes of the Gaussian quadrature) at which light is computed.
constexpr int NUM_NODES = 4;
// The index in PLACES of the middle of a step, which follows the nodes.
constexpr int MIDDLE = NUM_NODES;
// The positions of the nodes of the quadrature, and of the middle, as shares of a step.
constexpr double PLACES[] = {0.06943184420297371, 0.33000947820757187, 0.6699905217924281, 0.9305681557970263, 0.5};
// The weights of the nodes in the quadrature; the middle has no weight.
constexpr double WEIGHTS[] = {0.17392742256872692, 0.32607257743127307, 0.32607257743127307, 0.17392742256872692};
// The matrix from values at the nodes to the integrals, from 0 to each node, of the cubic through them.
constexpr double INTEGRALS[][NUM_NODES] = {
    {0.08696371128436346, -0.026604180084998794, 0.012627462689404725, -0.0035551496857956833},
    {0.18811811749986806, 0.16303628871563652, -0.027880428602470895, 0.006735500594538156},
    {0.16719192197418878, 0.35395300603374397, 0.16303628871563652, -0.014190694931141144},
    {0.1774825722545226, 0.31344511474186837, 0.35267675751627187, 0.08696371128436346},
};
// The largest number of steps into which a piece is divided because of its optical depth, so that the number fits an
// integer.
constexpr double MAX_STEPS_BY_DEPTH = 0x1p30;
// The index of the optical depth in the numbers that a ray gathers: red, green, blue, the optical depth, and then the
// opacity that each interval of the transfer function adds.
constexpr int64_t DEPTH = 3;
// The index of the first interval's opacity in the numbers that a ray gathers.
constexpr int64_t FIRST_INTERVAL = 4;

// A step of the quadrature along a ray, through one or more layers.
struct Step {
    // The colours at the nodes of the quadrature and in the middle of the step.
    Color colors[NUM_NODES + 1];
    // The extinctions at the nodes and in the middle, as optical depths over the length of the step.
    double densities[NUM_NODES + 1];
    // The optical depth from the step's start to each node.
    double before[NUM_NODES];
    // The optical depth of the step.
    double depth;

    // Add the same step through another layer: colours become means, weighted by extinction.
    void add(const Step& other) {
        for (int node = 0; node <= MIDDLE; node++) {
            double sum = densities[node] + other.densities[node];
            if (sum > 0.0) colors[node] = lerp(colors[node], other.colors[node], other.densities[node] / sum);
            densities[node] = sum;
        }
        for (int node = 0; node < NUM_NODES; node++) before[node] += other.before[node];
        depth += other.depth;
    }

    // Return the radiance: the colour in the middle times the exact opacity, plus the quadrature of the deviation from
    // that colour. A constant colour is exact at every opacity. adds: whether nothing is absorbed.
    INLINE Color radiance(double opacity, bool adds) const {
        const Color middle = colors[MIDDLE];
        Color sum = middle * (adds ? depth : opacity);
        for (int node = 0; node < NUM_NODES; node++)
            sum += WEIGHTS[node] * densities[node] * (adds ? 1.0 : exp_of(-before[node])) * (colors[node] - middle);
        return sum;
    }
};

// Return one of the equal steps through the part of a layer's piece that is integrated next. number: the number of the
// step. width: the width of each step in x, which goes from 0 to 1 over the part.
INLINE Step plain_step(const LayerRay& layer, double number, double width) {
    const Piece& part = layer.part;
    // The division turns an integrand in powers of x into its integral from 0 to x, divided by x.
    auto [a, b, c, d] = restrict_cubic(part.tau, number * width, width);
    const double d0 = a * width, d1 = b * width / 2.0, d2 = c * width / 3.0, d3 = d * width / 4.0;
    Step step;
    for (int node = 0; node <= MIDDLE; node++) {
        double at = PLACES[node], x = (number + at) * width;
        double t = part.start + x * part.extent;
        bool is_lit = layer.shading.exists && !layer.colors.exists;
        double lit = is_lit ? layer.light.lambert_factor(layer.gradient, t) : 1.0;
        step.colors[node] = layer.colors.exists ? layer.own_color(t) : part.interval.color(value_at(part.value, x), lit);
        step.densities[node] = d0 + at * (2.0 * d1 + at * (3.0 * d2 + at * 4.0 * d3));
        if (node < NUM_NODES) step.before[node] = at * (d0 + at * (d1 + at * (d2 + at * d3)));
    }
    step.depth = most(0.0, d0 + d1 + d2 + d3);
    return step;
}

// Return one of the equal steps, as `plain_step`, through a layer with factors on extinction: optical depths come from
// the extinctions at the nodes.
INLINE Step glossy_step(const LayerRay& layer, double number, double width) {
    const Piece& part = layer.part;
    Cubic tau = restrict_cubic(part.tau, number * width, width);
    Step step;
    for (int node = 0; node <= MIDDLE; node++) {
        double x = (number + PLACES[node]) * width;
        auto [lit, highlight, extinction] = layer.light.factors_at(layer.gradient, part.start + x * part.extent);
        step.densities[node] = most(0.0, value_at(tau, PLACES[node])) * width * extinction;
        step.colors[node] = part.interval.color(value_at(part.value, x), lit) + highlight;
    }
    auto integral = [&](const double* weights) {
        return weights[0] * step.densities[0] + weights[1] * step.densities[1] + weights[2] * step.densities[2] +
            weights[3] * step.densities[3];
    };
    for (int node = 0; node < NUM_NODES; node++) step.before[node] = integral(INTEGRALS[node]);
    step.depth = integral(WEIGHTS);
    return step;
}

INLINE Step step_through(LayerRay& layer, double number, double width) {
    bool is_glossy = layer.shading.exists && !layer.shading.value.is_plain && !layer.colors.exists;
    Step step = is_glossy ? glossy_step(layer, number, width) : plain_step(layer, number, width);
    layer.depth = step.depth;
    return step;
}

// An integrator of rays, one after the other, with the data that all rays of a call share.
struct Integrator {
    // Whether light adds up without absorption.
    bool adds;
    // The optical depth at which a ray ends.
    double max_depth;
    // The bounds of the steps, as in IntegrateRays.
    Array<const double, 1> max_steps;
    // The fog along all rays.
    const Maybe<RayFog>& fog;
    // The state of the ray in each layer.
    Array<LayerRay, 1> layers;
    // [steps, 4 + intervals of all layers]: the numbers that the ray gathers, for each bound of the steps.
    Array<double, 2> gathered;

    // Integrate the same part of the ray through the layers in a list, and add it to `gathered`. first: the first layer
    // of the list. Return false if the kernel was stopped.
    bool integrate_parts(LayerRay* first, int64_t ray) const {
        double bound = 0.0, num_parts = 1.0;
        for (LayerRay* layer = first; layer; layer = layer->next)
            bound += layer->part.depth_bound(), num_parts = most(num_parts, layer->part.length_voxels);
        // Without absorption, the quadrature of a polynomial is exact at any depth.
        if (!adds) num_parts = most(num_parts, least(bound / MAX_DEPTH_OF_STEP, MAX_STEPS_BY_DEPTH));
        for (int64_t number = 0; number < max_steps.shape[0]; number++) {
            const auto sums = gathered[number];
            int64_t num_steps = (int64_t)__builtin_ceil(num_parts / max_steps[number]);
            double width = 1.0 / (double)num_steps;
            for (int64_t k = 0; k < num_steps && !(sums[DEPTH] > max_depth); k++) {
                if (is_stopped()) return false;
                Step step = step_through(*first, (double)k, width);
                for (LayerRay* layer = first->next; layer; layer = layer->next)
                    step.add(step_through(*layer, (double)k, width));
                if (fog.exists) add_fog(step, *first, ray, (double)k, width);
                double opacity = -expm1_of(-step.depth), transmittance = exp_of(-sums[DEPTH]);
                Color radiance = step.radiance(opacity, adds) * (adds ? 1.0 : transmittance);
                for (int channel = 0; channel < DEPTH; channel++) sums[channel] += radiance[channel];
                sums[DEPTH] += step.depth;
                for (LayerRay* layer = first; layer; layer = layer->next) {
                    double share = layer->depth < step.depth ? layer->depth / step.depth : 1.0;
                    sums[layer->first_interval + layer->part.number] += transmittance * opacity * share;
                }
            }
        }
        return true;
    }

    // Give the colours of a step fog. number, width: as in `plain_step`.
    void add_fog(Step& step, const LayerRay& layer, int64_t ray, double number, double width) const {
        const Piece& part = layer.part;
        const Segment& segment = layer.segment;
        for (int node = 0; node <= MIDDLE; node++) {
            double t = part.start + (number + PLACES[node]) * width * part.extent;
            step.colors[node] = in_fog(fog, ray, lerp(segment.start, segment.end, t), step.colors[node]);
        }
    }

    // Return whether the ray may end, because it is opaque with every bound of the steps.
    bool is_opaque() const {
        double depth = gathered(0, DEPTH);
        for (int64_t k = 1; k < gathered.shape[0]; k++) depth = least(depth, gathered(k, DEPTH));
        return depth > max_depth;
    }

    // Integrate a ray into `gathered`, from one end of a piece to the next, for each bound of the steps. Return false
    // if the kernel was stopped.
    bool integrate_ray(int64_t ray) const {
        for (int64_t k = 0; k < layers.shape[0]; k++) layers[k].start(ray);
        for (int64_t k = 0; k < gathered.size(); k++) gathered.data[k] = 0.0;
        while (!is_opaque()) {
            LayerRay* first = next_part(layers);
            if (!first) break;
            if (!integrate_parts(first, ray)) return false;
            finish_part(first);
        }
        return true;
    }
};

}  // namespace
}  // namespace truth

// Write the premultiplied RGBA of rays and, if there is room, what each interval of the transfer function adds to the
// opacity. Alpha is 1 - exp(-optical depth), even if light adds up without absorption.
Status integrate_rays(const IntegrateRays* arguments) {
    using namespace truth;
    const auto& [layers, rays, adds, max_steps, fog, radiance] = *arguments;
    int64_t num = radiance.shape[0], num_steps = max_steps.shape[0], num_channels = radiance.shape[2];
    int64_t num_layers = layers.shape[0], num_gathered = FIRST_INTERVAL, num_splits = 0;
    if (rays.shape[0] != num_layers || !fit(fog, num)) return OUT_OF_BOUNDS;
    for (int64_t k = 0; k < num_layers; k++) {
        if (!fit(layers[k], rays[k], num)) return OUT_OF_BOUNDS;
        num_gathered += layers[k].intervals.rows.shape[0], num_splits += num_splits_of(layers[k]);
    }
    if (num_steps == 0 || radiance.shape[1] != num_steps || num_channels <= DEPTH || num_channels > num_gathered)
        return OUT_OF_BOUNDS;
    Buffer<double> splits(num_splits), gathered(num_steps * num_gathered);
    Buffer<LayerRay> layer_rays(num_layers);
    if (!splits || !gathered || !layer_rays) return NO_MEMORY;
    const Array<double, 2> sums = {gathered.data, {num_steps, num_gathered}};
    const double max_depth = adds ? INFINITE : MAX_OPTICAL_DEPTH;
    const Integrator integrator = {adds, max_depth, max_steps, fog, layer_rays, sums};
    for (int64_t k = 0, first = FIRST_INTERVAL, split = 0; k < num_layers; k++) {
        layer_rays[k].prepare(layers[k], rays[k], rest_of(splits, split), first);
        first += layers[k].intervals.rows.shape[0], split += num_splits_of(layers[k]);
    }
    for (int64_t i = 0; i < num; i++) {
        if (!integrator.integrate_ray(i)) return STOPPED;
        for (int64_t step = 0; step < num_steps; step++) {
            for (int64_t channel = 0; channel < num_channels; channel++)
                radiance(i, step, channel) = sums(step, channel);
            radiance(i, step, DEPTH) = -expm1_of(-sums(step, DEPTH));
        }
    }
    return DONE;
}
