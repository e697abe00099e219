// Turn voxels into nodes, merge nodes (groups.h), and list the visible ones.
#include "pyramid/kernels.h"
#include "base/stopping.h"
#include "transfer/classify.h"
#include "pyramid/brick_sums.h"
#include "pyramid/empty_space.h"
#include "pyramid/groups.h"

namespace {

// Negate the last channel of all nodes below a node that is a leaf of every cut, so that these nodes are not stored.
//
// A node is a leaf of every cut if its variance, summed over its channels, is below the limit of its level.
template <class T>
void hide_below_leaves(Group<float>& group, const Group<T>& errors, const double* limits) {
    bool is_root_leaf = errors.total_variance(2, 0) < limits[1];
    for (int64_t parent = 0; parent < 8; parent++) {
        if (is_root_leaf) visibility(group, 1, parent) *= -1.0f;
        if (is_root_leaf || errors.total_variance(1, parent) < limits[0])
            for (int64_t k = 0; k < 8; k++) visibility(group, 0, 8 * k + parent) *= -1.0f;
    }
}

// A writer of the visible nodes of groups into the arrays of VisibleNodes.
class Writer {
    // The arrays to which nodes are written.
    const VisibleNodes out;
    // The number of groups that are written so far.
    int64_t num_groups;
    // The number of groups for which the arrays have room.
    int64_t most_groups;
    // The number of visible nodes on each level that are written so far.
    int64_t counts[NUM_LEVELS];

  public:
    explicit Writer(const VisibleNodes& nodes)
        : out(nodes), num_groups(0), most_groups(nodes.root_means.shape[0]), counts{} {}

    template <class T>
    bool fits(int64_t num) const {
        int64_t num_nodes = NODES_OF_GROUP * most_groups, num_channels = NUM_CHANNELS<T>;
        return num <= most_groups && has_shape(out.means, num_nodes, 4) && has_shape(out.deviations, num_nodes) &&
               has_shape(out.masks, num_nodes) && has_shape(out.counts, NUM_LEVELS) &&
               has_shape(out.root_means, most_groups, 4) &&
               has_shape(out.root_error_means, most_groups, num_channels) &&
               has_shape(out.root_variances, most_groups, num_channels);
    }

    // Write the visible nodes of a level, in Morton order.
    template <class T>
    INLINE void append(Group<float>& group, const Group<T>& errors, int64_t level) {
        int64_t num_nodes = NUM_NODES[level], place = FIRST_NODE[level] * most_groups + counts[level];
        for (int64_t n = 0; n < num_nodes; n++) {
            int64_t node = node_in_order(n, num_nodes);
            if (!(visibility(group, level, node) > 0)) continue;
            store(&out.means(place, 0), 0, load<FourChannels>(&visibility(group, level, node) - 3, 0));
            out.deviations[place] = errors.deviation(level, node);
            if (level > 0) {
                int mask = 0;
                for (int64_t k = 0; k < 8; k++) mask |= (visibility(group, level - 1, k * num_nodes + node) > 0) << k;
                out.masks[place] = (uint8_t)mask;
            }
            place++;
        }
        counts[level] = place - FIRST_NODE[level] * most_groups;
    }

    // Write the root of a group, visible or not, from which larger groups are made.
    template <class T>
    void append_root(Group<float>& group, const Group<T>& errors) {
        for (int64_t channel = 0; channel < 4; channel++)
            out.root_means(num_groups, channel) = group.means[FIRST_NODE[2] * 4 + channel];
        for (int64_t channel = 0; channel < NUM_CHANNELS<T>; channel++) {
            out.root_error_means(num_groups, channel) = errors.means[FIRST_NODE[2] * NUM_CHANNELS<T> + channel];
            out.root_variances(num_groups, channel) = errors.variances[FIRST_NODE[2] * NUM_CHANNELS<T> + channel];
        }
        num_groups++;
    }

    void finish() const {
        for (int64_t level = 0; level < NUM_LEVELS; level++) out.counts[level] = counts[level];
    }
};

// Build the nodes of a block from the channels of its voxels.
void build_block(const AnyArray<3>& raw, const Classifier& classifier, const VoxelBox& box, Group<float>& group) {
    group.begin(box.extent, 2);
    classify_box<BLOCK_SIZE>(raw, classifier, box, [&](int64_t x, int64_t y, int64_t z, FourChannels channels) {
        store(group.voxels, 4 * voxel_offset(x, y, z), channels);
    });
    group.merge_voxels();
}

// Build the nodes of a block from the normalized scalars of its voxels; voxels without data have 0.
void build_block(const AnyArray<3>& raw, const Classifier& classifier, const Array<const double, 1>& normalization,
                 const VoxelBox& box, Group<double>& group) {
    double scalars[BLOCK_VOXELS];
    group.begin(box.extent, 2);
    load_scalars(raw, classifier.scalars, box, box.first, BLOCK_SIZE, scalars);
    for_voxels<BLOCK_SIZE>(box, [&](int64_t x, int64_t y, int64_t z) {
        double scalar = scalars[(z * BLOCK_SIZE + y) * BLOCK_SIZE + x];
        group.voxels[voxel_offset(x, y, z)] = is_nan(scalar) ? 0.0 : (scalar - normalization[0]) * normalization[1];
    });
    group.merge_voxels();
}

INLINE VoxelBox box_at(const Array<const int64_t, 2>& starts, const Array<const int64_t, 2>& extents, int64_t g) {
    return {{starts(g, 0), starts(g, 1), starts(g, 2)}, {extents(g, 0), extents(g, 1), extents(g, 2)}};
}

// Mark the cells of `occupied` that hold visible nodes of a level of a block.
void mark_occupied(const BuildBlocks& arguments, const VoxelBox& box, Group<float>& group, int64_t level) {
    for (int64_t n = 0; n < NUM_NODES[level]; n++) {
        if (visibility(group, level, node_in_order(n, NUM_NODES[level])) == 0) continue;
        auto cell = [&](int axis) {
            return (box.first[axis] + (place_in_group(n, axis) << (level + 1))) >> arguments.occupied_level;
        };
        arguments.occupied(cell(2), cell(1), cell(0)) = true;
    }
}

// Return a number as float16 holds it: rounded to nearest. The number is from 0 to 2^15.
//
// Normal numbers are rounded to 11 bits by Veltkamp's splitting (Dekker 1971, "A floating-point technique for extending
// the available precision"). Below 2^-14, float16 has a unit of 2^-24, as float32 has in [1/2, 1): adding 1/2 rounds to
// it.
INLINE float rounded_to_half(float value) {
    float scaled = value * (float)((1 << 13) + 1);
    return value >= 0x1p-14f ? scaled - (scaled - value) : (value + 0.5f) - 0.5f;
}

// Add the visible nodes of a level of a block to statistics of bricks.
template <class T>
void add_to_sums(const StreamedLevel& streamed, const VoxelBox& box, Group<float>& group, const Group<T>& errors,
                 int64_t level, NodeAdder& adder) {
    const int64_t num_nodes = NUM_NODES[level], width = 2 << level, whole = width * width * width;
    const bool is_whole = box.extent[0] * box.extent[1] * box.extent[2] == BLOCK_VOXELS;
    float stored[NUM_NODES[0]];
    for (int64_t node = 0; node < num_nodes; node++) stored[node] = errors.deviation(level, node) * streamed.error_factor;
    if (streamed.is_half)
        for (int64_t node = 0; node < num_nodes; node++) stored[node] = rounded_to_half(stored[node]);
    const int64_t first[3] = {box.first[0] / width, box.first[1] / width, box.first[2] / width};
    adder.enter(first);
    for (int64_t n = 0; n < num_nodes; n++) {
        int64_t node = node_in_order(n, num_nodes), size = whole, cell[3];
        float shown = visibility(group, level, node);
        if (!(shown > 0)) continue;
        for (int axis = 0; axis < 3; axis++) cell[axis] = first[axis] + place_in_group(n, axis);
        if (!is_whole) {
            size = 1;
            for (int axis = 0; axis < 3; axis++)
                size *= least(box.extent[axis] - place_in_group(n, axis) * width, width);
        }
        adder.add(cell, size, (double)stored[node] * streamed.error_scales[size], shown > streamed.most_invisible);
    }
}

// Return whether streamed levels are as many as kernels add up, with statistics of the right shapes.
bool fits(const Array<const StreamedLevel, 1>& streamed) {
    bool is_right = streamed.shape[0] <= NUM_STREAMED;
    for (int64_t level = 0; is_right && level < streamed.shape[0]; level++)
        is_right = fits(streamed[level].sums) && has_shape(streamed[level].error_scales, (8 << (3 * level)) + 1);
    return is_right;
}

// Build the nodes of all blocks. errors: the group with the channels that errors are measured on; it may be `group`
// itself. build_errors(box): builds `errors`, unless it is `group`.
template <class T, class Build>
Status build_all(const BuildBlocks& arguments, Group<float>& group, Group<T>& errors, Build build_errors) {
    const auto& [raw, classifier, error_classifier, ranges, normalization, limits, occupied, occupied_level,
                 streamed, starts, extents, visible, nodes] = arguments;
    const int64_t num_streamed = streamed.shape[0], marked_level = least(occupied_level, NUM_LEVELS) - 1;
    Writer writer(nodes);
    VisibilityTest test(raw, classifier, ranges);
    if (!writer.fits<T>(starts.shape[0])) return OUT_OF_BOUNDS;
    if (!test) return NO_MEMORY;
    const BrickSums none = {};
    NodeAdder adders[NUM_STREAMED] = {NodeAdder(num_streamed > 0 ? streamed[0].sums : none),
                                      NodeAdder(num_streamed > 1 ? streamed[1].sums : none)};
    for (int64_t g = 0; g < starts.shape[0]; g++) {
        if (is_stopped()) return STOPPED;
        VoxelBox box = box_at(starts, extents, g);
        // Scalars count for errors even where they are invisible.
        visible[g] = normalization.exists || test(box);
        if (!visible[g]) continue;
        build_block(raw, classifier, box, group);
        build_errors(box);
        mark_occupied(arguments, box, group, marked_level);
        hide_below_leaves(group, errors, limits);
        for (int64_t level = 0; level < num_streamed; level++)
            add_to_sums(streamed[level], box, group, errors, level, adders[level]);
        for (int64_t level = num_streamed; level < NUM_LEVELS; level++) writer.append(group, errors, level);
        writer.append_root(group, errors);
    }
    for (int64_t level = 0; level < num_streamed; level++) adders[level].finish();
    writer.finish();
    return DONE;
}

// Merge roots into larger groups. T: float if errors are measured on channels, double if they are measured on scalars.
template <class T>
Status merge_all(const MergeTier& arguments) {
    const auto& [means, error_means, variances, places, extents, side, nodes] = arguments;
    constexpr int64_t num_channels = NUM_CHANNELS<T>;
    Group<float> group;
    Group<T> errors;
    Writer writer(nodes);
    int64_t num = means.shape[0], i = 0;
    if (!writer.fits<T>(extents.shape[0]) || extents.shape[1] != 3 || !has_shape(means, num, 4) ||
        !has_shape(places, num) || !has_shape(error_means, num, num_channels) ||
        !has_shape(variances, num, num_channels))
        return OUT_OF_BOUNDS;
    for (int64_t g = 0; g < extents.shape[0]; g++) {
        group.begin(&extents(g, 0), side), errors.begin(&extents(g, 0), side);
        for (float& each : group.means) each = 0;
        for (float& each : group.variances) each = 0;
        for (T& each : errors.means) each = 0;
        for (T& each : errors.variances) each = 0;
        for (; i < num && places[i] < NUM_NODES[0] * (g + 1); i++) {
            int64_t node = places[i] - NUM_NODES[0] * g;
            if (node < 0) return OUT_OF_BOUNDS;
            for (int64_t channel = 0; channel < 4; channel++) group.means[node * 4 + channel] = means(i, channel);
            for (int64_t channel = 0; channel < num_channels; channel++) {
                errors.means[node * num_channels + channel] = (T)error_means(i, channel);
                errors.variances[node * num_channels + channel] = (T)variances(i, channel);
            }
        }
        group.merge_nodes(), errors.merge_nodes();
        for (int64_t level = 1; level < NUM_LEVELS; level++) writer.append(group, errors, level);
        writer.append_root(group, errors);
    }
    writer.finish();
    return DONE;
}

}  // namespace

// Build the nodes of the blocks that may show something, and write which blocks these are. A block begins at voxel
// `starts`, and `extents` voxels (x, y, z) of it are inside the volume. Visible nodes are marked in `occupied`, a grid
// of cells of `occupied_level`.
Status build_blocks(const BuildBlocks* arguments) {
    const auto& [raw, classifier, error_classifier, ranges, normalization, limits, occupied, occupied_level,
                 streamed, starts, extents, visible, nodes] = *arguments;
    int64_t num = starts.shape[0];
    if (!fits(classifier, raw) || (error_classifier.exists && !fits(error_classifier.value, raw)) ||
        !fits(ranges, raw) || (normalization.exists && !has_shape(normalization.value, 2)) ||
        !has_shape(starts, num, 3) || !has_shape(extents, num, 3) || !has_shape(visible, num) ||
        !fits(streamed))
        return OUT_OF_BOUNDS;
    Group<float> group;
    if (normalization.exists) {
        Group<double> errors;
        return build_all(*arguments, group, errors, [&](const VoxelBox& box) {
            build_block(raw, classifier, normalization.value, box, errors);
        });
    }
    if (error_classifier.exists) {
        Group<float> errors;
        return build_all(*arguments, group, errors,
                         [&](const VoxelBox& box) { build_block(raw, error_classifier.value, box, errors); });
    }
    return build_all(*arguments, group, group, [](const VoxelBox&) {});
}

// Merge the roots of groups, `side` voxels wide, into larger groups, of which `extents` voxels (x, y, z) are inside the
// volume.
//
// places: 64 times the index of the larger group that a root joins, plus the root's index in that group; ascending.
Status merge_tier(const MergeTier* arguments) {
    return arguments->variances.shape[1] == 1 ? merge_all<double>(*arguments) : merge_all<float>(*arguments);
}

// Write the means of cells of level 1 or 2, or the voxels of level 0, to `means` [n, z, y, x, 4], from each of
// `corners` [n, 3] (x, y, z) on. Means are 0 where nothing is visible.
Status average_cells(const AverageCells* arguments) {
    const auto& [raw, classifier, level, corners, means] = *arguments;
    int64_t num = corners.shape[0], side = BLOCK_SIZE >> level;
    if (!fits(classifier, raw) || corners.shape[1] != 3 || means.shape[0] != num || means.shape[4] != 4 ||
        level < 0 || level > 2)
        return OUT_OF_BOUNDS;
    Group<float> group;
    VisibilityTest test(raw, classifier);
    if (!test) return NO_MEMORY;
    const float* found = group.means + FIRST_NODE[most(level - 1, (int64_t)0)] * 4;
    // Return the part that a node's place along an axis adds to its index. On a level of 64 nodes, the two octal digits
    // of the index are exchanged.
    auto offset = [&](int64_t at) { return level == 1 ? 8 * (at & 1) + (at >> 1) : at; };
    for (int64_t i = 0; i < num; i++) {
        int64_t begin[3], end[3];
        for (int axis = 0; axis < 3; axis++) {
            begin[axis] = most(corners(i, axis), (int64_t)0) << level;
            end[axis] = least((corners(i, axis) + means.shape[3 - axis]) << level, raw.shape[2 - axis]);
        }
        auto add_block = [&](const VoxelBox& box) {
            if (!test(box)) return;
            int64_t first[3];
            for (int axis = 0; axis < 3; axis++) first[axis] = (box.first[axis] >> level) - corners(i, axis);
            if (level == 0)
                return classify_box<BLOCK_SIZE>(
                    raw, classifier, box, [&](int64_t x, int64_t y, int64_t z, FourChannels channels) {
                        store(&means(i, first[2] + z, first[1] + y, first[0] + x, 0), 0, channels);
                    });
            build_block(raw, classifier, box, group);
            for (int64_t z = 0; z < least(side, means.shape[1] - first[2]); z++)
                for (int64_t y = 0; y < least(side, means.shape[2] - first[1]); y++)
                    for (int64_t x = 0; x < least(side, means.shape[3] - first[0]); x++) {
                        int64_t node = offset(x) + 2 * offset(y) + 4 * offset(z);
                        float* out = &means(i, first[2] + z, first[1] + y, first[0] + x, 0);
                        store(out, 0, load<FourChannels>(found, 4 * node));
                    }
        };
        auto extent = [&](int axis, int64_t at) { return least(end[axis] - at, BLOCK_SIZE); };
        for (int64_t z = begin[2]; z < end[2]; z += BLOCK_SIZE)
            for (int64_t y = begin[1]; y < end[1]; y += BLOCK_SIZE)
                for (int64_t x = begin[0]; x < end[0]; x += BLOCK_SIZE)
                    add_block({{x, y, z}, {extent(0, x), extent(1, y), extent(2, z)}});
    }
    return DONE;
}

// Write `values * factor` as float16 bits, rounded to nearest. The factor is a power of two; products are from 0 to
// 2^15.
//
// Normal numbers of float16 and float32 differ only in the bias of the exponent, once they are rounded. Below 2^-14,
// numbers of float16 are multiples of 2^-24, the unit of float32 in [1/2, 1).
Status store_float16(const StoreFloat16* arguments) {
    const auto [values, factor, out] = *arguments;
    if (out.shape[0] != values.shape[0]) return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < values.shape[0]; i++) {
        float rounded = rounded_to_half(values[i] * factor);
        uint32_t normal = (__builtin_bit_cast(uint32_t, rounded) >> 13) - ((127 - 15) << 10);
        uint32_t tiny = __builtin_bit_cast(uint32_t, rounded + 0.5f);
        out[i] = (uint16_t)(rounded >= 0x1p-14f ? normal : tiny);
    }
    return DONE;
}
