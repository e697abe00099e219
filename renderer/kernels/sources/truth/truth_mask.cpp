// Find the parts of rays inside a mask: the parts where the mask, drawn as a layer, shows anything.
#include "truth/kernels.h"
#include "base/stopping.h"
#include "truth/truth_layer.h"

// Write the first parts of rays where the layer shows anything, and the number of all such parts.
Status mask_rays(const MaskRays* arguments) {
    using namespace truth;
    const auto& [layer, rays, parts, counts] = *arguments;
    int64_t num_rays = counts.shape[0], room = parts.shape[1];
    if (!fit(layer, rays, num_rays) || !has_shape(parts, num_rays, room, 2)) return OUT_OF_BOUNDS;
    Buffer<double> splits(num_splits_of(layer));
    Buffer<LayerRay> ray(1);
    if (!splits || !ray) return NO_MEMORY;
    ray[0].prepare(layer, rays, splits, 0);
    for (int64_t i = 0; i < num_rays; i++) {
        if (is_stopped()) return STOPPED;
        int64_t& count = counts[i] = 0;
        double last = -INFINITE;
        for (ray[0].start(i); ray[0].reached < INFINITE; ray[0].take_next()) {
            const double begin = ray[0].begin, end = ray[0].end;
            const bool is_next = begin - last > 0x1p-50 * absolute(begin);  // a gap that is not a rounding error
            count += is_next, last = end;
            if (count > room) continue;
            if (is_next) parts(i, count - 1, 0) = begin;
            parts(i, count - 1, 1) = end;
        }
    }
    return DONE;
}
