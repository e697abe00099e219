// Composite volumes that overlap, each in a grid of its own, mixed at every point of a ray.
//
//     the bricks of all groups over a tile -> slabs of depth, of at most SLAB_SAMPLES samples -> every brick adds the
//     extinctions and colours of its layers at the samples to bins -> the bins of a slab are composited, front to back
//
// A group is the bricks of the layers on one grid of voxels. A slab has the same samples for all bricks: its step is the
// shortest step of the bricks in it, and a brick with longer steps takes one sample for several bins. A bin is the optical
// depth, and the colour times it, of one sample. The lanes of a vector are a packet of neighbouring pixels, whose bins lie
// side by side: [packet, sample, RGB and depth, lane]. A sample counts for the part of its bins that is inside of the brick,
// and jitter moves the borders between slabs. Rays end between slabs.
//
// Each tile has slabs of its own, so that pictures depend on the side of tiles: with 8 to 32 pixels they are equally exact,
// and differ by 55 dB at tolerance 0.1. They do not depend on the number of lanes or threads, or on the order of layers.
#include "draw/kernels.h"
#include "base/stopping.h"
#include "draw/fields.h"
#include "draw/fog.h"

namespace {

// The number of columns of pixels in a packet.
constexpr int WIDTH = LANES >= 8 ? 4 : 2;
// The number of rows of pixels in a packet.
constexpr int HEIGHT = LANES / WIDTH;
// The most samples of a slab.
constexpr int64_t SLAB_SAMPLES = 32;
// The number of floats in a bin of a packet: RGB and depth of each lane.
constexpr int64_t BIN_FLOATS = 4 * LANES;
// Stands for the number of the lowest bin of a packet while none is written: larger than the number of any bin.
constexpr int64_t NO_BIN = 1 << 30;
// A sample may stand for a number of bins that is longer than the brick's step by this share of a bin.
constexpr double STEP_SLACK = 0.01;

// The depths of a brick along the view direction, in model units.
struct Depths {
    // The nearest depth of the brick.
    double near;
    // The farthest depth of the brick.
    double far;
    // The depth of a step in the brick.
    double step;
};

// A slab of depth with its samples. Depths are in model units.
struct Slab {
    // The depth at which the slab begins.
    double begin;
    // The depth at which the slab ends.
    double end;
    // The depth from one sample to the next.
    double step;
    // The number of samples; 0 for no slab.
    int64_t num;
    // The first brick, in the order of the tile, that may be in the slab.
    int64_t first_brick;
    // The brick after the last one that may be in the slab.
    int64_t end_brick;
};

// The rays of a packet in the grid of a group, one in each lane, by depth: a point is `origin + depth * direction`.
struct PacketRays {
    // The point at depth 0.
    Three origin;
    // The way for a depth of one model unit.
    Three direction;
    // 1 / direction, and 0 where the direction is 0.
    Three inverse;
    // The first sample of the slab.
    Three sample;
    // The way from one sample of the slab to the next.
    Three way;
    // The depth at which the ray begins, and enters the clip region of the group's planes.
    Floats enter;
    // The depth at which the ray leaves the clip region of the group's planes.
    Floats leave;

    INLINE Heights<Floats> heights(const Array<const double, 1>& slab) const {
        Three normal = {in_all<Floats>((float)slab[0]), in_all<Floats>((float)slab[1]), in_all<Floats>((float)slab[2])};
        return {dot(normal, origin), dot(normal, direction)};
    }
};

// The pixels of a packet, one in each lane, and its samples in a slab.
struct Packet {
    // The colour so far, premultiplied by alpha.
    Floats r, g, b;
    // The alpha so far; infinite in lanes without a ray.
    Floats alpha;
    // The shift of the ray's samples, from -1/2 to 1/2 steps.
    Floats jitter;
    // The length of the ray for a depth of 1.
    Floats length_per_depth;
    // The depth at which the slab begins on the ray, with its jitter, in model units.
    Floats begin;
    // The depth from one sample of the slab to the next, in model units.
    Floats step;
    // The lowest bin of the slab that was written.
    int64_t low;
    // The bin after the highest one that was written.
    int64_t high;
    // Whether any of the rays goes on.
    bool is_alive;
};

using Span = RangeOf<Floats>;

// Return the first part of spans that is in none of the clipped boxes, and set `rest` to the span behind this part.
INLINE Span take_part(Span& rest, const Array<const double, 3>& boxes, const PacketRays& rays) {
    Span part = first_part(rest, boxes.shape[0], [&](int64_t box) {
        return cross_box<Floats>(boxes[box], [&](const auto& slab) { return rays.heights(slab); });
    });
    rest.enter = part.leave;
    return part;
}

INLINE Floats held(Floats x, float low, float high) {
    return min_of(max_of(x, in_all<Floats>(low)), in_all<Floats>(high));
}

// Divides the bricks over a tile into slabs, front to back.
struct SlabMaker {
    // The numbers of the bricks over the tile, by ascending nearest depth.
    const int64_t* bricks;
    // The number of bricks over the tile.
    int64_t num;
    // The depths of all bricks, by their numbers.
    const Depths* depths;
    // Half of the longest step of a brick, in model units: jitter moves samples by at most this depth.
    double pad;
    // The depth at which the next slab begins, in model units.
    double begin = 0.0;
    // The first brick that does not end before the next slab.
    int64_t first = 0;
    // The first brick that has been in no slab.
    int64_t next = 0;

    INLINE const Depths& of(int64_t k) const { return depths[bricks[k]]; }

    // Return the next slab; it has no samples if no brick remains.
    Slab make() {
        while (first < next && of(first).far + pad <= begin) first++;
        double step = INFINITE, end = INFINITE, last = -INFINITE;
        auto add = [&](const Depths& depths) { step = least(step, depths.step), last = most(last, depths.far + pad); };
        for (int64_t k = first; k < next; k++)
            if (of(k).far + pad > begin) add(of(k));
        if (last > -INFINITE) end = begin + SLAB_SAMPLES * step;
        else if (next == num) return {};
        else begin = of(next).near - pad;
        for (; next < num && of(next).near - pad < end; next++) {
            double near = of(next).near - pad;
            if (of(next).step < step) {  // a slab of shorter steps, which may begin here
                if (step < INFINITE && near >= begin + SLAB_SAMPLES * of(next).step) {
                    end = near;
                    break;
                }
                end = least(end, begin + SLAB_SAMPLES * of(next).step);
            }
            add(of(next));
        }
        if (last < end && (next == num || of(next).near - pad > last)) end = last;
        int64_t samples = least(most((int64_t)((end - begin) / step + 1 - 1e-6), (int64_t)1), SLAB_SAMPLES);
        Slab slab = {begin, end, (end - begin) / (double)samples, samples, first, next};
        begin = end;
        return slab;
    }
};

// Return a sample, (tau c, tau), as it shows in fog in the middle of a bin. weight: the length of the bin.
INLINE Sample in_fog(const BrickFog& fog, Places places, int64_t bin, Floats weight, Sample sample) {
    places.number = in_all<Floats>((float)bin);
    Floats share = fog.share(texels_of(places), places.step, weight * sample.tau), of_fog = share * sample.tau;
    sample.r = fma(of_fog, fog.color[0], (1.0f - share) * sample.r);
    sample.g = fma(of_fog, fog.color[1], (1.0f - share) * sample.g);
    sample.b = fma(of_fog, fog.color[2], (1.0f - share) * sample.b);
    return sample;
}

// A mixture of volumes that a call draws, with the memory that it needs for a tile.
struct Mixture {
    // The arguments of the call.
    const DrawMixture& scene;
    // The layers of each group that show anything in a brick.
    const Array<ShownLayers, 1> shown;
    // [group, packet]: the rays of the packets of a tile in the grid of each group.
    const Array<PacketRays, 1> rays;
    // The packets of a tile.
    const Array<Packet, 1> packets;
    // [packet, sample, RGB and depth, lane]: the bins of all packets.
    const Array<float, 1> bins;

    // Return the number of packets in a row of packets of a tile.
    INLINE int64_t across() const { return (scene.grid.side + WIDTH - 1) / WIDTH; }

    // Set up the packets of a tile and their rays. window: the tile.
    void set_up(Window window) const {
        const Grid& grid = scene.grid;
        using Wide = Vector<double, LANES>;
        int32_t stride = (int32_t)grid.stride;
        for (int64_t p = 0; p < packets.shape[0]; p++) {
            Packet& packet = packets[p];
            packet = {};
            Ints column = lane_numbers<Ints>() % WIDTH + (int32_t)(window.left + p % across() * WIDTH);
            Ints row = lane_numbers<Ints>() / WIDTH + (int32_t)(window.top + p / across() * HEIGHT);
            packet.alpha = in_all<Floats>(NEVER);
            for (int lane = 0; lane < LANES; lane++)
                if (column[lane] < window.right && row[lane] < window.bottom && place_of(grid, row[lane], column[lane]) >= 0)
                    packet.alpha[lane] = 0.0f, packet.is_alive = true;
            if (!packet.is_alive) continue;
            row += (int32_t)(grid.first_row * grid.rays_across);
            Ints whole = column * stride * (int32_t)JITTER_PER_PX[0] + row * stride * (int32_t)JITTER_PER_PX[1];
            packet.jitter = to_float32(whole >> 8 & 0xFFFFFF) / 16777216.0f - 0.5f;
            for (int64_t group = 0; group < scene.groups.shape[0]; group++) {
                const RaySetup& setup = scene.groups[group].rays;
                auto [x, y] = position_px<Wide>(grid, column, row);
                x -= setup.center_px[0], y -= setup.center_px[1];
                Wide square = setup.slope_per_px * setup.slope_per_px * (x * x + y * y);
                packet.length_per_depth = __builtin_convertvector(root(1.0 + square), Floats);
                PacketRays& of = rays[group * packets.shape[0] + p];
                Floats* origins[] = {&of.origin.x, &of.origin.y, &of.origin.z};
                Floats* directions[] = {&of.direction.x, &of.direction.y, &of.direction.z};
                Floats* inverses[] = {&of.inverse.x, &of.inverse.y, &of.inverse.z};
                for (int axis = 0; axis < 3; axis++) {
                    const double *origin = setup.origins + 3 * axis, *direction = setup.directions + 3 * axis;
                    Wide speed = direction[0] + direction[1] * x + direction[2] * y;
                    *origins[axis] = __builtin_convertvector(origin[0] + origin[1] * x + origin[2] * y, Floats);
                    *directions[axis] = __builtin_convertvector(speed, Floats);
                    *inverses[axis] = where(mask_of(*directions[axis] == 0.0f), in_all<Floats>(0.0f),
                                            1.0f / *directions[axis]);
                }
                Span span = {in_all<Floats>((float)setup.start), in_all<Floats>(NEVER)};
                if (setup.clip.exists)
                    span = clip_slabs(setup.clip.value.slabs, span, [&](const auto& slab) { return of.heights(slab); });
                of.enter = span.enter, of.leave = span.leave;
            }
        }
    }

    // Place the samples of a slab on the rays of packet `p`. step_before, step_behind: the steps, in model units, by whose
    // share `jitter` the borders before and behind the slab move.
    void place(Packet& packet, int64_t p, const Slab& slab, double step_before, double step_behind) const {
        packet.low = NO_BIN, packet.high = 0;
        packet.begin = (float)slab.begin + packet.jitter * (float)step_before;
        Floats end = (float)slab.end + packet.jitter * (float)step_behind;
        packet.step = (end - packet.begin) * (1.0f / (float)slab.num);
        Floats middle = packet.begin + 0.5f * packet.step;
        for (int64_t group = 0; group < scene.groups.shape[0]; group++) {
            PacketRays& of = rays[group * packets.shape[0] + p];
            auto [x, y, z] = of.direction;
            of.sample = {fma(middle, x, of.origin.x), fma(middle, y, of.origin.y), fma(middle, z, of.origin.z)};
            of.way = {packet.step * x, packet.step * y, packet.step * z};
        }
    }

    // Add samples of a brick to the bins of packet `p`. part: the bins that the brick covers on each ray; both ends may be
    // inside of bins. own: the number of bins for which a sample stands; it lies in the middle of the part that the brick
    // covers of these bins.
    template <int NUM>
    void march(Packet& packet, int64_t p, int64_t group, int64_t brick, const Box& box, Span part, int64_t own) const {
        const PacketRays& of = rays[group * packets.shape[0] + p];
        int64_t low = (int64_t)__builtin_reduce_min(part.enter);
        int64_t high = (int64_t)__builtin_ceilf(__builtin_reduce_max(part.leave));
        packet.low = least(packet.low, low), packet.high = most(packet.high, high);
        float scale = (float)box.scale, offset = (float)TEXEL_OFFSET;
        auto texel = [&](Floats sample, int axis) { return (sample - (float)box.corner[axis]) * scale + offset; };
        Places places = {};
        places.begin = {texel(of.sample.x, 0), texel(of.sample.y, 1), texel(of.sample.z, 2)};
        places.step = {of.way.x * scale, of.way.y * scale, of.way.z * scale};
        Floats length = packet.step * packet.length_per_depth, zero = in_all<Floats>(0.0f);
        const BrickRadiance radiance = radiance_in(*shown[group].bricks, box);
        const BrickFog fog = fog_in(*shown[group].bricks, box);
        for (int64_t bin = low / own * own; bin < high; bin += own) {
            Floats from = max_of(in_all<Floats>((float)bin), part.enter);
            Floats to = min_of(in_all<Floats>((float)(bin + own)), part.leave);
            places.active = mask_of(from < to);
            if (!any_of(places.active)) continue;
            places.number = 0.5f * (from + to) - 0.5f, places.width = to - from;
            Cell cell = cell_at(places.number, places.begin, places.step, places.shares);
            auto held = [&](Ints along) { return where(places.active, along, in_all<Ints>(0)); };
            places.cell = {held(cell.x), held(cell.y), held(cell.z)};
            Sample sum = sum_of_layers<NUM>(shown[group], brick, box, places, of.direction, radiance);
            if (!any_of(mask_of(sum.tau > 0.0f))) continue;
            if (shown[group].are_albedos()) scatter(radiance, seen_texels(places, places.step, sum.tau * places.width * length), sum);
            for (int64_t k = most(bin, low); k < least(bin + own, high); k++) {
                Floats covered = min_of(in_all<Floats>((float)(k + 1)), to) - max_of(in_all<Floats>((float)k), from);
                Floats weight = max_of(zero, covered) * length;
                int64_t at = (p * SLAB_SAMPLES + k) * BIN_FLOATS;
                auto [tau, red, green, blue] = fog.color == nullptr ? sum : in_fog(fog, places, k, weight, sum);
                store(bins, at, fma(weight, red, load<Floats>(bins, at)));
                store(bins, at + LANES, fma(weight, green, load<Floats>(bins, at + LANES)));
                store(bins, at + 2 * LANES, fma(weight, blue, load<Floats>(bins, at + 2 * LANES)));
                store(bins, at + 3 * LANES, fma(weight, tau, load<Floats>(bins, at + 3 * LANES)));
            }
        }
    }

    // Add a brick to the bins of the packets that it may cover.
    void add_brick(const Slab& slab, int64_t number, Window window) const {
        auto member = scene.members[number];
        int64_t group = member[0], brick = member[1];
        const LayerBricks& layers = scene.groups[group];
        Box box = box_of(layers.boxes, brick);
        Window covered = covered_by(scene.grid, number, window);
        int64_t own = most((int64_t)1, least(slab.num, (int64_t)(scene.depths(number, 2) / slab.step + STEP_SLACK)));
        shown[group].choose(brick);
        bool is_plain = shown[group].num == 1 && shown[group].are_plain();
        auto of_slab = [&](Floats depth, const Packet& packet) {
            return held((depth - packet.begin) / packet.step, 0.0f, (float)slab.num);
        };
        for (int64_t row = covered.top / HEIGHT; row * HEIGHT < covered.bottom; row++) {
            for (int64_t column = covered.left / WIDTH; column * WIDTH < covered.right; column++) {
                int64_t p = row * across() + column;
                Packet& packet = packets[p];
                if (!packet.is_alive) continue;
                const PacketRays& of = rays[group * packets.shape[0] + p];
                Span span = clip_slab(Span{of.enter, of.leave}, of.origin.x, of.inverse.x, box.low[0], box.high[0]);
                span = clip_slab(span, of.origin.y, of.inverse.y, box.low[1], box.high[1]);
                span = clip_slab(span, of.origin.z, of.inverse.z, box.low[2], box.high[2]);
                Mask alive = mask_of(packet.alpha <= scene.termination_alpha);
                for (bool has_more = true; has_more;) {
                    Span part = span;
                    if (layers.rays.clip.exists) part = take_part(span, layers.rays.clip.value.boxes, of);
                    has_more = layers.rays.clip.exists && any_of(mask_of(part.leave < span.leave) & alive);
                    Span in_bins = {of_slab(part.enter, packet), of_slab(part.leave, packet)};
                    Mask active = mask_of(in_bins.enter < in_bins.leave) & alive;
                    if (!any_of(active)) continue;
                    shown[group].meet(brick);
                    in_bins.enter = where(active, in_bins.enter, in_all<Floats>((float)slab.num));
                    in_bins.leave = where(active, in_bins.leave, in_all<Floats>(0.0f));
                    if (is_plain) march<1>(packet, p, group, brick, box, in_bins, own);
                    else march<0>(packet, p, group, brick, box, in_bins, own);
                }
            }
        }
    }

    // Composite the bins of a packet under its pixels, and clear the bins. Return whether any of the rays goes on.
    bool composite(Packet& packet, int64_t p) const {
        Floats zero = in_all<Floats>(0.0f);
        Mask alive = mask_of(packet.alpha <= scene.termination_alpha);
        for (int64_t k = packet.low; k < packet.high; k++) {
            int64_t at = (p * SLAB_SAMPLES + k) * BIN_FLOATS;
            Floats depth = load<Floats>(bins, at + 3 * LANES);
            Mask visible = mask_of(depth > 0.0f) & alive;
            if (!any_of(visible)) continue;
            Floats weight = where(visible, (1.0f - packet.alpha) * opacity_of_depth(depth), zero);
            Floats share = where(visible, weight / depth, zero);
            packet.alpha += weight;
            packet.r = fma(share, load<Floats>(bins, at), packet.r);
            packet.g = fma(share, load<Floats>(bins, at + LANES), packet.g);
            packet.b = fma(share, load<Floats>(bins, at + 2 * LANES), packet.b);
            for (int channel = 0; channel < 4; channel++) store(bins, at + channel * LANES, zero);
        }
        packet.is_alive = any_of(mask_of(packet.alpha <= scene.termination_alpha));
        return packet.is_alive;
    }

    // Write the pixels of the packets into the image. window: the tile.
    void write(Window window) const {
        const Grid& grid = scene.grid;
        for (int64_t p = 0; p < packets.shape[0]; p++) {
            const auto& [r, g, b, alpha, jitter, length_per_depth, begin, step, low, high, is_alive] = packets[p];
            for (int lane = 0; lane < LANES; lane++) {
                int64_t column = window.left + p % across() * WIDTH + lane % WIDTH;
                int64_t row = window.top + p / across() * HEIGHT + lane / WIDTH;
                if (column >= window.right || row >= window.bottom) continue;
                int64_t place = place_of(grid, row, column);
                if (place < 0) continue;
                const float pixel[4] = {r[lane], g[lane], b[lane], alpha[lane]};
                for (int channel = 0; channel < 4; channel++) grid.rays(place, channel) = pixel[channel];
            }
        }
    }

    // Draw a tile. Return whether it was finished, and drawing not stopped.
    bool draw_tile(int64_t number) const {
        const Grid& grid = scene.grid;
        Window window = window_of(grid, number);
        set_up(window);
        const Depths* depths = (const Depths*)scene.depths.data;
        SlabMaker maker = {&grid.numbers[grid.starts[number]], grid.starts[number + 1] - grid.starts[number], depths, 0.0};
        for (int64_t k = 0; k < maker.num; k++) maker.pad = most(maker.pad, 0.5 * maker.of(k).step);
        Slab before = {}, slab = maker.make();
        for (bool is_alive = true; slab.num > 0 && is_alive;) {
            if (is_stopped()) return false;
            Slab behind = maker.make();
            // Jitter moves the border between two slabs by at most half of the smaller of their steps, so that slabs stay
            // in order along every ray.
            auto step_between = [&](const Slab& one, const Slab& other) {
                bool meet = one.num > 0 && other.num > 0 && one.end >= other.begin;
                return meet ? least(one.step, other.step) : slab.step;
            };
            double step_before = step_between(before, slab), step_behind = step_between(slab, behind);
            for (int64_t p = 0; p < packets.shape[0]; p++)
                if (packets[p].is_alive) place(packets[p], p, slab, step_before, step_behind);
            for (int64_t k = slab.first_brick; k < slab.end_brick; k++) {
                const Depths& of = maker.of(k);
                if (of.far + maker.pad > slab.begin && of.near - maker.pad < slab.end)
                    add_brick(slab, maker.bricks[k], window);
            }
            is_alive = false;
            for (int64_t p = 0; p < packets.shape[0]; p++)
                if (packets[p].is_alive) is_alive |= composite(packets[p], p);
            before = slab, slab = behind;
        }
        write(window);
        return true;
    }
};

// Return whether the arrays of the arguments are large enough, and all numbers in them valid.
bool is_complete(const DrawMixture& scene) {
    for (int64_t group = 0; group < scene.groups.shape[0]; group++)
        if (!is_complete(scene.groups[group])) return false;
    if (scene.members.shape[0] != scene.grid.rectangles.shape[0]) return false;
    return is_consistent(scene.grid, scene.tiles, [&](int64_t number) {
        int64_t group = scene.members(number, 0), brick = scene.members(number, 1);
        if (group < 0 || group >= scene.groups.shape[0]) return false;
        if (brick < 0 || brick >= scene.groups[group].boxes.shape[0]) return false;
        return scene.depths(number, 2) > 0.0 && can_be_drawn(scene.groups[group], brick);
    });
}

}  // namespace

// Composite the bricks of several volumes into some tiles of the image; pixels that were there are overwritten.
Status draw_mixture(const DrawMixture* arguments) {
    const auto& [grid, groups, members, depths, termination_alpha, tiles] = *arguments;
    if (depths.shape[0] != members.shape[0] || !is_complete(*arguments))
        return OUT_OF_BOUNDS;
    int64_t num_packets = ((grid.side + WIDTH - 1) / WIDTH) * ((grid.side + HEIGHT - 1) / HEIGHT);
    const ShownGroups shown(groups);
    const Buffer<PacketRays> rays(groups.shape[0] * num_packets);
    const Buffer<Packet> packets(num_packets);
    const Buffer<float> bins(num_packets * SLAB_SAMPLES * BIN_FLOATS);
    if (!shown || !rays || !packets || !bins) return NO_MEMORY;
    const Mixture mixture = {*arguments, shown.groups, rays, packets, bins};
    for (int64_t k = 0; k < tiles.shape[0]; k++)
        if (!mixture.draw_tile(tiles[k])) return STOPPED;
    return DONE;
}
