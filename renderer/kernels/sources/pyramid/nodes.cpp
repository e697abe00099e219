// Turn voxels into nodes, merge nodes, and list the visible ones.
//
// Two neighbours a and b, of which b holds the share h of the voxels, are merged into
//
//     mean = a + h (b - a)        variance = va + h (vb - va) + h (1 - h) (b - a)^2
//
// along x, then y, then z. This is the merge of Chan, Golub, LeVeque 1979 ("Updating formulae and a pairwise algorithm
// for computing sample variances") divided by the count. It takes no difference of large squares, so a variance is
// never negative, holds for large offsets, and is exactly 0 for equal voxels. Inside the volume h is 1/2. If the border
// cuts a node, the shares of voxels inside the volume differ along the three axes; if b has no voxels, h is 0.
//
// Nodes come in groups: 64 nodes, their 8 parents, and the root. The levels 1, 2, 3 of a block of 8^3 voxels are a
// group; the roots of up to 64 groups are the 64 nodes of a larger group. On each level of a group, and among the 512
// voxels, the child k = x + 2 y + 4 z of node i is at k n + i, with n the number of nodes: children are merged as eight
// contiguous rows, which becomes vector code. The 64 are then in Morton order with the two octal digits exchanged, the
// 8 in Morton order. The channels of a node lie together; each has its own variance.
#include "pyramid/kernels.h"
#include "base/stopping.h"
#include "transfer/classify.h"
#include "pyramid/empty_space.h"

namespace {

// The number of voxels along each side of a block.
constexpr int64_t BLOCK_SIZE = 8;
// The number of voxels in a block.
constexpr int64_t BLOCK_VOXELS = 512;
// The number of levels of nodes in a group.
constexpr int64_t NUM_LEVELS = 3;
// The number of nodes on each level of a group, from the lowest level up.
constexpr int64_t NUM_NODES[NUM_LEVELS] = {64, 8, 1};
// The index in a group of the first node of each level: the nodes of lower levels come before it.
constexpr int64_t FIRST_NODE[NUM_LEVELS] = {0, 64, 72};
// The number of nodes on all levels of a group.
constexpr int64_t NODES_OF_GROUP = 73;

// The number of channels of a node: four channels in float32 (T is float), or one scalar in float64 (T is double).
template <class T>
constexpr int64_t NUM_CHANNELS = sizeof(T) == sizeof(float) ? 4 : 1;

// Return the part that a voxel's coordinate in its block adds to the voxel's index among the block's 512 voxels: the
// lowest bit of the coordinate selects the child of a node, the highest bit the largest parent.
INLINE int64_t voxel_offset(int64_t x) { return 64 * (x & 1) + 8 * (x >> 1 & 1) + (x >> 2); }

INLINE int64_t voxel_offset(int64_t x, int64_t y, int64_t z) {
    return voxel_offset(x) + 2 * voxel_offset(y) + 4 * voxel_offset(z);
}

// Return the index, on its level, of the node that is n-th in Morton order.
INLINE int64_t node_in_order(int64_t n, int64_t num_nodes) { return num_nodes == 64 ? (n & 7) << 3 | n >> 3 : n; }

// The mean and the variance of one channel over the voxels of a node.
template <class T>
struct Moments {
    T mean;
    T variance;
};

// Return the mean and the variance over two neighbours together. h: the share of their voxels that `b` holds.
template <class T>
INLINE Moments<T> merge_two(Moments<T> a, Moments<T> b, T h) {
    T d = b.mean - a.mean;
    return {a.mean + h * d, a.variance + h * (b.variance - a.variance) + (h - h * h) * (d * d)};
}

// The shares h by which the children of the NUM nodes of a level are merged along x, y and z, repeated for each channel
// of a node. h is the share of the voxels that the second of two neighbours holds.
template <class T, int64_t NUM>
struct Shares {
    // The number of channels of all nodes of the level.
    static constexpr int64_t WIDTH = NUM * NUM_CHANNELS<T>;
    // The shares h along x, y and z, for each channel of each node.
    T along[3][WIDTH];

    // extent: the number of voxels of the group inside the volume, along x, y, z. child: the width of the nodes'
    // children, in voxels.
    void set(const int64_t* extent, int64_t child) {
        for (int64_t axis = 0; axis < 3; axis++)
            for (int64_t j = 0; j < WIDTH; j++) {
                int64_t node = j / NUM_CHANNELS<T>, first = node >> axis & 1;
                // On the lowest level, the lower octal digit of an index stands for the parent, the higher digit for
                // the node in it.
                if (NUM == 64) first = first << 1 | (node >> (3 + axis) & 1);
                int64_t rest = extent[axis] - first * 2 * child;
                int64_t low = least(most(rest, (int64_t)0), child), high = least(most(rest - child, (int64_t)0), child);
                along[axis][j] = (T)((double)high / (double)most(low + high, (int64_t)1));
            }
    }
};

// Merge the children of the NUM nodes of one level, and write the means and variances of the nodes. pair(k, j, h): a
// function that returns children 2 k and 2 k + 1 merged along x, for j, the index of a node and its channel.
template <class T, int64_t NUM, class Pair>
INLINE void merge_rows(const Shares<T, NUM>& shares, T* __restrict mean, T* __restrict variance, Pair pair) {
    const auto& [along_x, along_y, along_z] = shares.along;
    for (int64_t j = 0; j < shares.WIDTH; j++) {
        T h = along_x[j];
        Moments<T> low = merge_two(pair(0, j, h), pair(1, j, h), along_y[j]);
        Moments<T> high = merge_two(pair(2, j, h), pair(3, j, h), along_y[j]);
        Moments<T> whole = merge_two(low, high, along_z[j]);
        mean[j] = whole.mean, variance[j] = whole.variance;
    }
}

// The nodes of one group, in memory that is used for one group after the other. T is float for channels, and double for
// scalars.
template <class T>
class Group {
    // The number of channels of a node.
    static constexpr int64_t C = NUM_CHANNELS<T>;
    // The shares h by which children are merged into the 64 nodes on the lowest level.
    Shares<T, 64> node_shares;
    // The shares h by which nodes are merged into the 8 parents.
    Shares<T, 8> parent_shares;
    // The shares h by which parents are merged into the root.
    Shares<T, 1> root_shares;
    // The number of voxels (x, y, z) of the group inside the volume, for which the shares were computed.
    int64_t cut[3] = {};

    template <int64_t NUM>
    INLINE void merge_level(const Shares<T, NUM>& shares, int64_t level) {
        constexpr int64_t width = NUM * C;
        const T *mean = means + FIRST_NODE[level - 1] * C, *variance = variances + FIRST_NODE[level - 1] * C;
        merge_rows(shares, means + FIRST_NODE[level] * C, variances + FIRST_NODE[level] * C,
                   [=](int64_t k, int64_t j, T h) {
                       int64_t one = 2 * k * width + j, other = one + width;
                       return merge_two(Moments<T>{mean[one], variance[one]}, {mean[other], variance[other]}, h);
                   });
    }

  public:
    // The means of the channels of all nodes, level by level.
    alignas(64) T means[NODES_OF_GROUP * C];
    // The variances of the channels of all nodes, level by level.
    alignas(64) T variances[NODES_OF_GROUP * C];
    // The channels of the voxels of a block.
    alignas(64) T voxels[BLOCK_VOXELS * C];

    // Begin a group of nodes that are `side` voxels wide; `extent` voxels of the group along x, y, z are inside the
    // volume.
    void begin(const int64_t* extent, int64_t side) {
        if (extent[0] == cut[0] && extent[1] == cut[1] && extent[2] == cut[2]) return;
        node_shares.set(extent, side / 2), parent_shares.set(extent, side), root_shares.set(extent, 2 * side);
        for (int axis = 0; axis < 3; axis++) cut[axis] = extent[axis];
        for (T& each : voxels) each = 0;  // voxels outside the volume stay 0
    }

    // Merge voxels into nodes, up to the root.
    void merge_voxels() {
        constexpr int64_t width = 64 * C;
        merge_rows(node_shares, means, variances, [this](int64_t k, int64_t j, T h) {
            T a = voxels[2 * k * width + j], d = voxels[(2 * k + 1) * width + j] - a;
            return Moments<T>{a + h * d, (h - h * h) * (d * d)};
        });
        merge_nodes();
    }

    void merge_nodes() {
        merge_level(parent_shares, 1);
        merge_level(root_shares, 2);
    }

    // Return the variance of a node, summed over its channels.
    INLINE T total_variance(int64_t level, int64_t node) const {
        const T* first = variances + (FIRST_NODE[level] + node) * C;
        T sum = first[0];
        for (int64_t channel = 1; channel < C; channel++) sum += first[channel];
        return sum;
    }
};

// Return the last channel of a node: the node is visible if the channel is above 0.
INLINE float& visibility(Group<float>& group, int64_t level, int64_t node) {
    return group.means[(FIRST_NODE[level] + node) * 4 + 3];
}

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
               has_shape(out.masks, num_nodes) && has_shape(out.cells, out.sizes.shape[0], 3) &&
               (out.sizes.shape[0] == 0 || out.sizes.shape[0] == num_nodes) && has_shape(out.counts, NUM_LEVELS) &&
               has_shape(out.root_means, most_groups, 4) &&
               has_shape(out.root_error_means, most_groups, num_channels) &&
               has_shape(out.root_variances, most_groups, num_channels);
    }

    // Write the visible nodes of a level, in Morton order.
    //
    // take(x, y, z, place): a function that is called for each visible node, at x, y, z in the group, which is written
    // to `place`. It is also called for nodes below a leaf of every cut, which are not written.
    template <class T, class Take>
    INLINE void append(Group<float>& group, const Group<T>& errors, int64_t level, Take take) {
        int64_t num_nodes = NUM_NODES[level], place = FIRST_NODE[level] * most_groups + counts[level];
        for (int64_t n = 0; n < num_nodes; n++) {
            int64_t node = node_in_order(n, num_nodes);
            float shown = visibility(group, level, node);
            if (shown == 0) continue;
            take((n & 1) | (n >> 2 & 2), (n >> 1 & 1) | (n >> 3 & 2), (n >> 2 & 1) | (n >> 4 & 2), place);
            if (!(shown > 0)) continue;
            store(&out.means(place, 0), 0, load<FourChannels>(&visibility(group, level, node) - 3, 0));
            // The square root is taken before rounding to float32, which might not hold the variance.
            out.deviations[place] = (float)__builtin_sqrt((double)errors.total_variance(level, node));
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

// Build the nodes of all blocks. errors: the group with the channels that errors are measured on; it may be `group`
// itself. build_errors(box): builds `errors`, unless it is `group`.
template <class T, class Build>
Status build_all(const BuildBlocks& arguments, Group<float>& group, Group<T>& errors, Build build_errors) {
    const auto& [raw, classifier, error_classifier, normalization, limits, occupied, occupied_level, starts, extents,
                 visible, nodes] = arguments;
    const bool is_listed = nodes.sizes.shape[0] > 0;
    Writer writer(nodes);
    VisibilityTest test(raw, classifier);
    if (!writer.fits<T>(starts.shape[0])) return OUT_OF_BOUNDS;
    if (!test) return NO_MEMORY;
    for (int64_t g = 0; g < starts.shape[0]; g++) {
        if (is_stopped()) return STOPPED;
        VoxelBox box = box_at(starts, extents, g);
        // Scalars count for errors even where they are invisible.
        visible[g] = normalization.exists || test(box);
        if (!visible[g]) continue;
        build_block(raw, classifier, box, group);
        build_errors(box);
        hide_below_leaves(group, errors, limits);
        for (int64_t level = 0; level < NUM_LEVELS; level++) {
            int64_t width = 2 << level;
            bool is_marked = level == least(occupied_level, NUM_LEVELS) - 1;
            writer.append(group, errors, level, [&](int64_t x, int64_t y, int64_t z, int64_t place) {
                const int64_t first[3] = {x * width, y * width, z * width};
                if (is_marked) {
                    auto cell = [&](int axis) { return (box.first[axis] + first[axis]) >> occupied_level; };
                    occupied(cell(2), cell(1), cell(0)) = true;
                }
                if (!is_listed) return;
                nodes.sizes[place] = 1;
                for (int axis = 0; axis < 3; axis++) {
                    nodes.cells(place, axis) = (int32_t)((box.first[axis] + first[axis]) / width);
                    nodes.sizes[place] *= least(box.extent[axis] - first[axis], width);
                }
            });
        }
        writer.append_root(group, errors);
    }
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
        for (int64_t level = 1; level < NUM_LEVELS; level++)
            writer.append(group, errors, level, [](int64_t, int64_t, int64_t, int64_t) {});
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
    const auto& [raw, classifier, error_classifier, normalization, limits, occupied, occupied_level, starts, extents,
                 visible, nodes] = *arguments;
    int64_t num = starts.shape[0];
    if (!fits(classifier, raw) || (error_classifier.exists && !fits(error_classifier.value, raw)) ||
        (normalization.exists && !has_shape(normalization.value, 2)) || !has_shape(starts, num, 3) ||
        !has_shape(extents, num, 3) || !has_shape(visible, num))
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
// Normal numbers are rounded to 11 bits by Veltkamp's splitting (Dekker 1971, "A floating-point technique for extending
// the available precision"); then only the bias of the exponent differs. Below 2^-14, float16 has a unit of 2^-24, as
// float32 has in [1/2, 1): adding 1/2 rounds to it.
Status store_float16(const StoreFloat16* arguments) {
    const auto [values, factor, out] = *arguments;
    if (out.shape[0] != values.shape[0]) return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < values.shape[0]; i++) {
        float value = values[i] * factor, scaled = value * (float)((1 << 13) + 1);
        float rounded = scaled - (scaled - value);
        uint32_t normal = (__builtin_bit_cast(uint32_t, rounded) >> 13) - ((127 - 15) << 10);
        uint32_t tiny = __builtin_bit_cast(uint32_t, value + 0.5f);
        out[i] = (uint16_t)(value >= 0x1p-14f ? normal : tiny);
    }
    return DONE;
}
