// Measure bricks of voxels: their visible bounds, and the sub-voxel variation.
//
// A dual cell has eight voxels as its corners. By the min-max test of `renderer.transfer`, it may be visible if any
// scalar from the smallest to the largest of the eight voxels is visible.
//
// The sub-voxel variation measures two things that the octree's nodes do not show: colours and extinctions that the
// transfer function shows between two voxels but at neither, and differences between voxels that belong to two nodes.
//
// On level 0 the scalar is interpolated and then classified. Between two voxels the scalar passes through all values
// between the two scalars, and the transfer function may be far from its values at both voxels: a volume of zeros and
// ones, for example, may have an opaque peak between 0 and 1, which no voxel shows. Means of classified voxels, and the
// errors of these means, miss the peak. Means are exact only if the transfer function is a straight line between the
// two voxels. Over a dual cell, whose corners are eight voxels with scalars from a to b,
//
//     D^2 = mean over s from a to b of |w(s) - line(s)|^2,    line(a) = w(a), line(b) = w(b)
//
// with w the channels that errors are measured on (renderer/pyramid/pyramid.py). On a ray through the cell, voxels miss
// at most D times the ray's length, if scalars are spread evenly along the ray. At a step, w has the value of the upper
// side.
//
// w is assumed to be linear between control values, so that D is exactly 0 if no control value lies between a and b.
// The product tau c is not linear where both factors change, but its deviation is at most a quarter of the difference
// of the ends. Opacities lie between those at the ends, too. The distance is then linear in every segment between
// control values, with ends d and e, and its square has the mean (d^2 + d e + e^2) / 3: no large numbers are
// subtracted.
//
// Of two peaks with the same D, the thinner one needs shorter steps. With E^2 the mean square of the distance's slope,
// for a ray through the cell of length 1,
//
//     width^2 = 12 D^2 / E^2,    between MIN_PEAK_WIDTH^2 and 1
//
// is the width of a triangular peak above the line. Longer steps h meet the peak by chance, and err by D h^0.5; shorter
// ones err by D h^2 / width^1.5. Steps are chosen as if errors were step_error * h^2.5 (renderer/bricks/sampling.py),
// which covers both with
//
//     step_error = D / width^2
//
// Nodes do not show a difference between two constant nodes either, such as boxes on even voxels, blocks of a phantom,
// or an enlarged mask. Coarser cells blur this difference over their width all the same, and steps must be as short as
// for a difference inside a node. Inside a node, half of the difference is the error. For differences between nodes, in
// every dual cell,
//
//     J = DIFFERENCE_ERROR_SHARE |w(b) - w(a)|
//
// is taken as the error, wherever nodes begin and end. DIFFERENCE_ERROR_SHARE is less than a half: the eight voxels of
// a dual cell of noise have a range of 2.85 standard deviations in the mean, and count for no more than they do in
// nodes.
//
// Where some voxels of a dual cell have no data, rays meet a step from w to nothing, at a position that the scalars do
// not tell. D is then the value for a step of the transfer function in the middle of a ray, D^2 = w^2 / 12. Because
// rays divide a segment at the step, longer segments are exact enough: width^2 = 1 / 4 in place of 1 / 17.
//
// Between two labels, w changes by a step of the same kind. D is then taken from the largest difference in each
// channel.
#include "bricks/kernels.h"
#include "base/stopping.h"
#include "transfer/transfer.h"
#include "bricks/absent.h"

namespace {

// The least width of a peak or a step of the transfer function, as a share of a ray through a dual cell; narrower ones
// count as this wide. It bounds how short the segments of rays become.
constexpr double MIN_PEAK_WIDTH = 1.0 / 16;

// The error J of a dual cell, as a share of the difference between the channels at its smallest and its largest scalar.
constexpr double DIFFERENCE_ERROR_SHARE = 0.35;

// The value of 1 / width^2 for the step between voxels with data and voxels without. With this value, a picture of a
// ball of data, 120 voxels wide and surrounded by NaN, has a PSNR of 61 dB at tolerance 0.05, and one of a cube without
// NaN has 59 dB.
constexpr double EDGE_INVERSE_WIDTH = 4;

INLINE double squared(double x) { return x * x; }

// The transfer function as a function of scaled scalars. Segment k lies between the control values k - 1 and k.
struct Curve {
    // The rows of the transfer function's table, as in TransferTable.
    Array<const double, 2> rows;
    // The power of two by which scalars are multiplied, as in TransferTable.
    double scale;

    INLINE double value(int64_t k) const { return rows(k + 1, 0); }

    // Return how many control values are at or below a scalar; the search starts from `near`.
    INLINE int64_t num_at_or_below(double scalar, int64_t near) const {
        int64_t num = near;
        while (num > 0 && value(num - 1) > scalar) num--;
        while (num < rows.shape[0] - 1 && value(num) <= scalar) num++;
        return num;
    }

    INLINE Channels operator()(int64_t segment, double scalar) const { return evaluate_segment(rows, segment, scalar); }

    INLINE bool is_flat(int64_t segment) const { return !any_of(mask_of(load<Channels>(&rows(segment, 6), 0) != 0.0)); }
};

// The dual cells of a brick. Dual cell k along an axis lies between the centres of the cells k - 1 and k.
struct DualCells {
    // The smallest scalar at the corners of each dual cell.
    Field low;
    // The largest scalar at the corners of each dual cell.
    Field high;
    // The number of voxels of the brick along z, y, x; there is one dual cell more along each axis.
    int64_t nums[3];

    template <class Function>
    INLINE void for_places(Function function) const {
        for (int64_t z = 0; z <= nums[0]; z++)
            for (int64_t y = 0; y <= nums[1]; y++)
                for (int64_t x = 0; x <= nums[2]; x++) function(z, y, x);
    }

    template <class Function>
    INLINE void for_each(Function function) const {
        for_places([&](int64_t z, int64_t y, int64_t x) { function(z, y, x, Range{low(z, y, x), high(z, y, x)}); });
    }

    // Return the share of a dual cell that lies in the brick.
    INLINE double share(int64_t z, int64_t y, int64_t x) const {
        auto along = [](int64_t at, int64_t num) { return at == 0 || at == num ? 0.5 : 1.0; };
        return along(z, nums[0]) * along(y, nums[1]) * along(x, nums[2]);
    }

    double size() const { return (double)(nums[0] * nums[1] * nums[2]); }
};

// Turn scalars at voxel centres, in `cells.low`, into the smallest and largest scalar of each dual cell. NaN have no
// effect.
void to_ranges(const DualCells& cells) {
    auto [low, high, nums] = cells;
    for (int64_t z = 0; z < nums[0] + 2; z++)
        for (int64_t y = 0; y < nums[1] + 2; y++) {
            double *lows = &low(z, y, 0), *highs = &high(z, y, 0);
            for (int64_t x = 0; x < nums[2] + 1; x++) {
                double here = lows[x], there = lows[x + 1];
                lows[x] = least(least(INFINITE, here), there);
                highs[x] = most(most(-INFINITE, here), there);
            }
        }
    for (int axis = 1; axis >= 0; axis--)
        for (int64_t z = 0; z < nums[0] + 1 + axis; z++)
            for (int64_t y = 0; y < nums[1] + 1; y++) {
                int64_t next_z = z + (axis == 0), next_y = y + (axis == 1);
                double *lows = &low(z, y, 0), *highs = &high(z, y, 0);
                const double *next_lows = &low(next_z, next_y, 0), *next_highs = &high(next_z, next_y, 0);
                for (int64_t x = 0; x < nums[2] + 1; x++) {
                    lows[x] = least(lows[x], next_lows[x]);
                    highs[x] = most(highs[x], next_highs[x]);
                }
            }
}

// Write the lowest and the highest corner (x, y, z) of the visible dual cells to `bounds` [2, 3]. At least one is
// visible.
void find_visible_bounds(const DualCells& cells, const Array<const double, 1>& breakpoints,
                         const Array<float, 2>& bounds) {
    int64_t lowest[3] = {BRICK_SIZE, BRICK_SIZE, BRICK_SIZE}, highest[3] = {};
    for (int64_t z = 0; z <= cells.nums[0]; z++)
        for (int64_t y = 0; y <= cells.nums[1]; y++) {
            auto is_visible = [&](int64_t x) {
                Range range = {cells.low(z, y, x), cells.high(z, y, x)};
                return range.low <= range.high && is_range_visible(breakpoints, range.low, range.high);
            };
            // Search from both ends of the row, and only outside the bounds found so far.
            bool is_between = lowest[2] <= z && z <= highest[2] && lowest[1] <= y && y <= highest[1];
            int64_t first = 0, end = cells.nums[2] + 1;
            while (first < (is_between ? lowest[0] : end) && !is_visible(first)) first++;
            while (end > (is_between ? highest[0] + 1 : first) && !is_visible(end - 1)) end--;
            const int64_t low[3] = {first, y, z}, high[3] = {end - 1, y, z};
            for (int axis = 0; axis < 3 && first < end; axis++)
                lowest[axis] = least(lowest[axis], low[axis]), highest[axis] = most(highest[axis], high[axis]);
        }
    for (int axis = 0; axis < 3; axis++) {
        bounds(0, axis) = (float)most((double)lowest[axis] - 0.5, 0.0);
        bounds(1, axis) = (float)least((double)highest[axis] + 0.5, (double)cells.nums[2 - axis]);
    }
}

// Return |w|^2, the sum of the squared channels.
INLINE double squared_length(Channels w) {
    w *= w;
    return w[0] + w[1] + w[2] + w[3];
}

// The distance of the transfer function from a line, for a dual cell.
struct Distance {
    // D^2, the mean squared distance, as at the head of this file.
    double square;
    // width^2, the squared width of the peaks above the line, as at the head of this file.
    double squared_width;
};

// Return D^2 and width^2 of a range of scaled scalars, from the segment `first` to `last`, where the ends have the
// channels w0 and w1.
Distance distance(const Curve& curve, Range range, int64_t first, int64_t last, Channels w0, Channels w1) {
    Channels d = {};  // the distance from the line at the previous control value
    double before = 0, total = 0, slopes = 0;
    for (int64_t k = first; k < last; k++) {
        double t = (curve.value(k) - range.low) / (range.high - range.low), u = 1 - t;
        Channels w = load<Channels>(&curve.rows(k + 1, 2), 0);  // at the start of segment k + 1
        Channels e = u * (w - w0) + t * (w - w1), products = d * (d + e), squares = e * e;
        double sum = 0;
        for (int channel = 0; channel < 4; channel++) sum = sum + products[channel] + squares[channel];
        total += (t - before) * sum;
        slopes += squared_length(e - d) / most(t - before, MIN_PEAK_WIDTH);
        d = e, before = t;
    }
    total += (1 - before) * squared_length(d);
    slopes += squared_length(d) / most(1 - before, MIN_PEAK_WIDTH);
    double width = slopes > 0 ? 4 * total / slopes : 1;
    return {total / 3, least(most(width, MIN_PEAK_WIDTH * MIN_PEAK_WIDTH), 1.0)};
}

// The variation in a brick, by the definitions of D, width and J at the head of this file.
struct Variation {
    // The largest D or J, defined at the head of this file, of the brick's dual cells.
    double largest;
    // The root mean square of D / width^2, defined at the head of this file, over the dual cells of the brick.
    double steps;
    // The root mean square of J, defined at the head of this file, over the dual cells of the brick.
    double differences;
};

Variation variation(const DualCells& cells, const Curve& curve) {
    double largest = 0, total = 0, total_difference = 0;
    int64_t first = 0;
    Range flat = {INFINITE, -INFINITE};  // the scalars of the last segment that was found to be constant
    cells.for_each([&](int64_t z, int64_t y, int64_t x, Range range) {
        Range scaled = {curve.scale * range.low, curve.scale * range.high};
        if (!(scaled.low < scaled.high) || (flat.low <= scaled.low && scaled.high < flat.high)) return;
        first = curve.num_at_or_below(scaled.low, first);
        int64_t last = curve.num_at_or_below(scaled.high, first);
        if (last == first && curve.is_flat(first)) {
            bool is_last = first == curve.rows.shape[0] - 1;
            flat = {first > 0 ? curve.value(first - 1) : -INFINITE, is_last ? INFINITE : curve.value(first)};
            return;
        }
        double part = cells.share(z, y, x);
        Channels w0 = curve(first, scaled.low), w1 = curve(last, scaled.high);
        if (last > first) {
            auto [square, width] = distance(curve, scaled, first, last, w0, w1);
            largest = most(largest, square);
            total += part * square / (width * width);
        }
        double square = squared_length(w1 - w0) * (DIFFERENCE_ERROR_SHARE * DIFFERENCE_ERROR_SHARE);
        largest = most(largest, square);
        total_difference += part * square;
    });
    return {__builtin_sqrt(largest), __builtin_sqrt(total / cells.size()),
            __builtin_sqrt(total_difference / cells.size())};
}

// Add the steps between shown voxels and hidden or missing ones to the variation of a brick. is_shown(z, y, x): tells
// whether a voxel at a corner of dual cells is shown.
template <class IsShown>
Variation with_edges(const Variation& found, const DualCells& cells, const Curve& curve, const IsShown& is_shown) {
    double largest = squared(found.largest), total = 0;
    cells.for_each([&](int64_t z, int64_t y, int64_t x, Range range) {
        Range scaled = {curve.scale * range.low, curve.scale * range.high};
        int num_shown = 0;
        for (int k = 0; k < 8; k++) num_shown += is_shown(z + (k >> 2), y + (k >> 1 & 1), x + (k & 1));
        if (!(scaled.low <= scaled.high && 0 < num_shown && num_shown < 8)) return;
        auto squared_step = [&](double end) { return squared_length(curve(curve.num_at_or_below(end, 0), end)); };
        double square = most(most(0.0, squared_step(scaled.low)), squared_step(scaled.high));
        largest = most(largest, square / 12);
        total += cells.share(z, y, x) * square / 12 * squared(EDGE_INVERSE_WIDTH);
    });
    return {__builtin_sqrt(largest), __builtin_sqrt(squared(found.steps) + total / cells.size()), found.differences};
}

// Measure only J, defined at the head of this file, from the largest difference in each channel. differs(z, y, x):
// tells whether the channels w may differ between the corners of a dual cell. w_at(z, y, x): returns w at a corner.
template <class Differs, class Corner>
Variation differences(const DualCells& cells, const Differs& differs, const Corner& w_at) {
    double largest = 0, total = 0;
    cells.for_places([&](int64_t z, int64_t y, int64_t x) {
        if (!differs(z, y, x)) return;
        auto low = w_at(z, y, x), high = low;
        for (int k = 1; k < 8; k++) {
            auto w = w_at(z + (k >> 2), y + (k >> 1 & 1), x + (k & 1));
            low = __builtin_elementwise_min(low, w), high = __builtin_elementwise_max(high, w);
        }
        double square = squared_length(DIFFERENCE_ERROR_SHARE * __builtin_convertvector(high - low, Channels));
        largest = most(largest, square), total += cells.share(z, y, x) * square;
    });
    return {__builtin_sqrt(largest), 0, __builtin_sqrt(total / cells.size())};
}

}  // namespace

// Measure the dual cells in bricks of voxels: their visible bounds, the largest D or J, and the root mean squares over
// the brick's volume of D / width^2 and of J.
//
// A brick has half of each dual cell between itself and a neighbour. Beyond the border, the nearest voxels are
// repeated.
Status measure_voxel_bricks(const MeasureVoxelBricks* arguments) {
    const auto& [voxels, cells, breakpoints, table, shown, are_lit, texels, bounds, measures] = *arguments;
    constexpr int64_t size = PADDED_BRICK_SIZE;
    auto num_bricks = [&](int axis) { return (voxels.raw.shape[axis] + BRICK_SIZE - 1) / BRICK_SIZE; };
    int64_t num_z = num_bricks(0), num_y = num_bricks(1), num_x = num_bricks(2);
    if (!fit_together(voxels, cells) || !fits(table) || !has_shape(bounds, num_z, num_y, num_x, 2, 3) ||
        !has_shape(measures, 3, num_z, num_y, num_x) ||
        (texels.exists && !has_shape(texels.value, cells.shape[0], size, size, size, 4)) ||
        (shown.exists && !has_shape(shown.value, voxels.raw.shape[0], voxels.raw.shape[1], voxels.raw.shape[2])))
        return OUT_OF_BOUNDS;
    Cube low(size), high(size), around(size + 2);
    if (!low || !high || !around) return NO_MEMORY;
    Curve curve = {table.rows, table.scale};
    for (int64_t i = 0; i < cells.shape[0]; i++) {
        if (is_stopped()) return STOPPED;
        int64_t x = cells(i, 0), y = cells(i, 1), z = cells(i, 2);
        DualCells of_brick = {low.field, high.field, {}};
        for (int axis = 0; axis < 3; axis++)
            of_brick.nums[axis] = least(voxels.raw.shape[axis] - BRICK_SIZE * cells(i, 2 - axis), BRICK_SIZE);
        if (texels.exists) {
            auto w_at = [&](int64_t w, int64_t v, int64_t u) {
                return load<Vector<float, 4>>(&texels.value(i, w, v, u, 0), 0);
            };
            Variation found = differences(of_brick, [](auto...) { return true; }, w_at);
            measures(0, z, y, x) = found.largest, measures(2, z, y, x) = found.differences;
            continue;
        }
        load_brick(voxels, cells[i], voxels.has_absent ? around.field : low.field);
        if (voxels.is_labels) load_brick(voxels, cells[i], around.field);
        if (voxels.is_labels && are_lit) {
            clear_beyond_border(voxels, cells[i], low.field);
            clear_beyond_border(voxels, cells[i], around.field);
        }
        bool is_whole = !voxels.has_absent || fill_absent(around.field, low.field);
        Range range = range_of(low.field);
        if (!(range.low <= range.high)) continue;
        int64_t first = curve.num_at_or_below(curve.scale * range.low, 0);
        bool is_varying = !is_whole || shown.exists || !curve.is_flat(first) ||
                          curve.num_at_or_below(curve.scale * range.high, first) > first;
        bool is_visible = is_range_visible(breakpoints, range.low, range.high);
        if (is_varying || is_visible) to_ranges(of_brick);
        if (is_visible) find_visible_bounds(of_brick, breakpoints, bounds[z][y][x]);
        if (!is_varying) continue;
        const auto& loaded = around.field;  // the loaded field is one voxel larger than the dual cells on each side
        Variation found;
        if (voxels.is_labels) {
            auto differs = [&](int64_t w, int64_t v, int64_t u) { return low.field(w, v, u) < high.field(w, v, u); };
            auto w_at = [&](int64_t w, int64_t v, int64_t u) { return evaluate(table, loaded(w + 1, v + 1, u + 1)); };
            found = differences(of_brick, differs, w_at);
            found.steps = __builtin_sqrt(1.0 / 12) * EDGE_INVERSE_WIDTH / DIFFERENCE_ERROR_SHARE * found.differences;
        } else found = variation(of_brick, curve);
        auto is_shown = [&](int64_t w, int64_t v, int64_t u) {
            if (voxels.has_absent && is_nan(loaded(w + 1, v + 1, u + 1))) return false;
            auto voxel = [&](int axis, int64_t at) {
                return least(most<int64_t>(BRICK_SIZE * cells(i, axis) + at - 1, 0), voxels.raw.shape[2 - axis] - 1);
            };
            return !shown.exists || shown.value(voxel(2, w), voxel(1, v), voxel(0, u)) != 0;
        };
        if (!is_whole || shown.exists) found = with_edges(found, of_brick, curve, is_shown);
        measures(0, z, y, x) = found.largest;
        measures(1, z, y, x) = found.steps;
        measures(2, z, y, x) = found.differences;
    }
    return DONE;
}
