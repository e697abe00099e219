// Turn voxels into nodes, and merge nodes.
//
// Two neighbours a and b, where b holds the share h of their voxels, are merged into
//
//     mean = a + h (b - a)        variance = va + h (vb - va) + h (1 - h) (b - a)^2
//
// along x, then y, then z. This is the merge of Chan, Golub, LeVeque 1979 ("Updating formulae and a pairwise algorithm
// for computing sample variances") divided by the count. It takes no difference of large squares, so a variance is
// never negative, holds for large offsets, and is exactly 0 for equal voxels. Inside the volume h is 1/2. Where the
// border cuts a node, the shares of real voxels along the three axes differ; where b has no voxels, h is 0.
//
// The children k = x + 2 y + 4 z of n nodes are at k n, k n + 1, ...: eight contiguous rows, which becomes vector code.
#include "classify.h"
#include "lanes.h"

namespace {

constexpr int64_t BLOCK_SIZE = 8, BLOCK_VOXELS = 512;

// Channels are float32, scalars, of which a node has one, float64.
template <class T>
constexpr int64_t NUM_CHANNELS = sizeof(T) == sizeof(float) ? 4 : 1;

// Where a coordinate of a voxel in its block puts it among 8 x 64 children: the lowest bit is that of the child, the
// highest that of the largest parent.
INLINE int64_t voxel_offset(int64_t x) {
    return 64 * (x & 1) + 8 * (x >> 1 & 1) + (x >> 2);
}

INLINE int64_t voxel_offset(int64_t x, int64_t y, int64_t z) {
    return voxel_offset(x) + 2 * voxel_offset(y) + 4 * voxel_offset(z);
}

template <class T>
struct Moments {
    T mean, variance;
};

template <class T>
INLINE Moments<T> merge_two(Moments<T> a, Moments<T> b, T h) {
    T d = b.mean - a.mean;
    return {a.mean + h * d, a.variance + h * (b.variance - a.variance) + (h - h * h) * (d * d)};
}

// The shares of the n nodes of a group along x, y, z, of each channel.
template <class T, int64_t NUM_NODES>
struct Shares {
    static constexpr int64_t WIDTH = NUM_NODES * NUM_CHANNELS<T>;
    T along[3][WIDTH];

    // extent: the real voxels of the group along x, y, z. child: the width of the nodes' children, in voxels.
    void set(const int64_t* extent, int64_t child) {
        for (int64_t axis = 0; axis < 3; axis++)
            for (int64_t j = 0; j < WIDTH; j++) {
                int64_t node = j / NUM_CHANNELS<T>, first = node >> axis & 1;
                if (NUM_NODES == 64) first = first << 1 | (node >> (3 + axis) & 1);  // the lower is the larger parent's
                int64_t rest = extent[axis] - first * 2 * child;
                int64_t low = least(most(rest, (int64_t)0), child), high = least(most(rest - child, (int64_t)0), child);
                along[axis][j] = (T)((double)high / (double)most(low + high, (int64_t)1));
            }
    }
};

// Write the nodes of one level of a group. pair(k, j, h): the children 2 k and 2 k + 1 of node and channel j, merged.
template <class T, int64_t NUM_NODES, class Pair>
INLINE void merge_rows(const Shares<T, NUM_NODES>& shares, T* __restrict mean, T* __restrict variance, Pair pair) {
    const auto& [along_x, along_y, along_z] = shares.along;
    for (int64_t j = 0; j < shares.WIDTH; j++) {
        T h = along_x[j];
        Moments<T> low = merge_two(pair(0, j, h), pair(1, j, h), along_y[j]);
        Moments<T> high = merge_two(pair(2, j, h), pair(3, j, h), along_y[j]);
        Moments<T> whole = merge_two(low, high, along_z[j]);
        mean[j] = whole.mean, variance[j] = whole.variance;
    }
}

template <class T, int64_t NUM_NODES>
INLINE void merge_voxels(const T* voxels, const Shares<T, NUM_NODES>& shares, T* mean, T* variance) {
    constexpr int64_t width = Shares<T, NUM_NODES>::WIDTH;
    merge_rows(shares, mean, variance, [=](int64_t k, int64_t j, T h) {
        T a = voxels[2 * k * width + j], d = voxels[(2 * k + 1) * width + j] - a;
        return Moments<T>{a + h * d, (h - h * h) * (d * d)};
    });
}

template <class T, int64_t NUM_NODES>
INLINE void merge_nodes(const T* means, const T* variances, const Shares<T, NUM_NODES>& shares, T* mean, T* variance) {
    constexpr int64_t width = Shares<T, NUM_NODES>::WIDTH;
    merge_rows(shares, mean, variance, [=](int64_t k, int64_t j, T h) {
        int64_t first = 2 * k * width + j, second = first + width;
        return merge_two(Moments<T>{means[first], variances[first]}, {means[second], variances[second]}, h);
    });
}

// Merges the nodes of groups, of Groups or ScalarGroups.
template <class T, class G>
struct Merger {
    const G groups;
    const Array<const int64_t, 2> extents;
    Shares<T, 8> shares;
    Shares<T, 1> root_shares;

    bool fits() const {
        auto is_whole = [&](const auto& level, int64_t num_nodes) {
            auto is_array_whole = [&](const Array<T, 3>& array) {
                return array.shape[0] == extents.shape[0] && array.shape[1] == num_nodes &&
                       array.shape[2] == NUM_CHANNELS<T>;
            };
            return is_array_whole(level.means) && is_array_whole(level.variances);
        };
        return extents.shape[1] == 3 && is_whole(groups.nodes, 64) && is_whole(groups.parents, 8) &&
               is_whole(groups.roots, 1);
    }

    // Whether the border cuts a group as it cuts the one before.
    bool is_cut_alike(int64_t group) const {
        if (group == 0) return false;
        const int64_t *one = &extents(group - 1, 0), *other = &extents(group, 0);
        return one[0] == other[0] && one[1] == other[1] && one[2] == other[2];
    }

    void set_shares(int64_t group, int64_t side) {
        shares.set(&extents(group, 0), side);
        root_shares.set(&extents(group, 0), 2 * side);
    }

    INLINE void merge(int64_t g) const {
        const auto& [nodes, parents, roots] = groups;
        T *mean = &parents.means(g, 0, 0), *variance = &parents.variances(g, 0, 0);
        merge_nodes(&nodes.means(g, 0, 0), &nodes.variances(g, 0, 0), shares, mean, variance);
        merge_nodes(mean, variance, root_shares, &roots.means(g, 0, 0), &roots.variances(g, 0, 0));
    }
};

template <class T, class G>
Status merge_groups(const G& groups, const Array<const int64_t, 2>& extents, int64_t side) {
    Merger<T, G> merger = {groups, extents, {}, {}};
    if (!merger.fits()) return OUT_OF_BOUNDS;
    for (int64_t g = 0; g < extents.shape[0]; g++) {
        if (!merger.is_cut_alike(g)) merger.set_shares(g, side);
        merger.merge(g);
    }
    return DONE;
}

// Build all nodes of blocks at voxels `starts`, of which `extents` (x, y, z) are real. fill(box, voxels) writes these.
template <class T, class G, class Fill>
INLINE Status build_blocks(const Array<const int64_t, 2>& starts, const Array<const int64_t, 2>& extents,
                           const G& groups, Fill fill) {
    alignas(64) T voxels[BLOCK_VOXELS * NUM_CHANNELS<T>];
    Merger<T, G> merger = {groups, extents, {}, {}};
    Shares<T, 64> shares;
    if (!merger.fits() || starts.shape[0] != extents.shape[0] || starts.shape[1] != 3) return OUT_OF_BOUNDS;
    for (int64_t g = 0; g < starts.shape[0]; g++) {
        if (!merger.is_cut_alike(g)) {
            shares.set(&extents(g, 0), 1);
            merger.set_shares(g, 2);
            for (T& each : voxels) each = 0;  // those outside the volume stay 0
        }
        fill(Box(&starts(g, 0), &extents(g, 0)), voxels);
        merge_voxels(voxels, shares, &groups.nodes.means(g, 0, 0), &groups.nodes.variances(g, 0, 0));
        merger.merge(g);
    }
    return DONE;
}

// Classify a whole block by a table, without light.
template <class T>
void look_up_block(const AnyArray<3>& raw, const Array<const float, 2>& table, const Box& box, float* out) {
    Array<const T, 3> patterns = {(const T*)raw.data, {raw.shape[0], raw.shape[1], raw.shape[2]}};
    for (int64_t z = 0; z < BLOCK_SIZE; z++)
        for (int64_t y = 0; y < BLOCK_SIZE; y++) {
            const T* row = &patterns(box.first[2] + z, box.first[1] + y, box.first[0]);
            for (int64_t x = 0; x < BLOCK_SIZE; x++)
                store(out, 4 * voxel_offset(x, y, z), load<Vector<float, 4>>(&table(row[x], 0), 0));
        }
}

}  // namespace

// Build all nodes of blocks from voxels.
Status classify_blocks(const ClassifyBlocks* arguments) {
    const auto [raw, classifier, starts, extents, groups] = *arguments;
    if (!fits(classifier, raw)) return OUT_OF_BOUNDS;
    bool is_looked_up = classifier.table.exists && !classifier.lighting.exists;
    return build_blocks<float>(starts, extents, groups, [&](const Box& box, float* out) {
        if (is_looked_up && box.extent[0] * box.extent[1] * box.extent[2] == BLOCK_VOXELS) {
            auto look_up = raw.dtype == 0 ? look_up_block<uint8_t> : look_up_block<uint16_t>;
            return look_up(raw, classifier.table.value, box, out);
        }
        classify_box<BLOCK_SIZE>(raw, classifier, box, [&](int64_t x, int64_t y, int64_t z, Channels channels) {
            float* voxel = out + 4 * voxel_offset(x, y, z);
            voxel[0] = (float)channels.r, voxel[1] = (float)channels.g;
            voxel[2] = (float)channels.b, voxel[3] = (float)channels.a;
        });
    });
}

// Build all nodes of blocks from `(scalar - offset) * scale` of voxels, 0 without data.
Status normalize_blocks(const NormalizeBlocks* arguments) {
    const auto [raw, by_pattern, offset, scale, starts, extents, groups] = *arguments;
    if (!fits(by_pattern, raw)) return OUT_OF_BOUNDS;
    return build_blocks<double>(starts, extents, groups, [&](const Box& box, double* out) {
        double scalars[BLOCK_VOXELS];
        load_scalars<BLOCK_SIZE>(raw, by_pattern, box, box.first, scalars);
        for (int64_t z = 0; z < box.extent[2]; z++)
            for (int64_t y = 0; y < box.extent[1]; y++)
                for (int64_t x = 0; x < box.extent[0]; x++) {
                    double scalar = scalars[(z * BLOCK_SIZE + y) * BLOCK_SIZE + x];
                    out[voxel_offset(x, y, z)] = scalar != scalar ? 0.0 : (scalar - offset) * scale;
                }
    });
}

// Merge groups of 64 nodes, `side` voxels wide, into their 8 parents and root. extents: real voxels of each group.
Status merge_channels(const MergeChannels* arguments) {
    const auto [groups, extents, side] = *arguments;
    return merge_groups<float>(groups, extents, side);
}

Status merge_scalars(const MergeScalars* arguments) {
    const auto [groups, extents, side] = *arguments;
    return merge_groups<double>(groups, extents, side);
}
