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
#include "bricks/dual_cells.h"

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

    // Return whether the channels are constant between two scaled scalars.
    INLINE bool is_flat_between(Range range) const {
        int64_t segment = num_at_or_below(range.low, 0);
        return is_flat(segment) && num_at_or_below(range.high, segment) == segment;
    }

    // Return whether the channels of a scaled scalar are 0.
    INLINE bool is_zero(double scalar) const {
        return !any_of(mask_of((*this)(num_at_or_below(scalar, 0), scalar) != 0.0));
    }

    INLINE bool is_flat(int64_t segment) const { return !any_of(mask_of(load<Channels>(&rows(segment, 6), 0) != 0.0)); }
};

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

// What a dual cell that lies wholly in the brick adds to its variation, by its range of scalars.
struct Terms {
    // The larger one of D^2 and J^2, as at the head of this file.
    double largest;
    // D^2 / width^4, as at the head of this file.
    double steps;
    // J^2, as at the head of this file.
    double differences;
};

// The terms of dual cells as a function of the range of scalars at their corners.
class TermsByScalar {
    // The transfer function.
    const Curve curve;
    // The number of control values at or below the lowest scalar of the dual cell before this one.
    int64_t first = 0;
    // The scaled scalars of the last segment that was found to be constant.
    Range flat = {INFINITE, -INFINITE};

  public:
    explicit TermsByScalar(const Curve& of) : curve(of) {}

    INLINE Terms operator()(double low, double high) {
        Range scaled = {curve.scale * low, curve.scale * high};
        if (!(scaled.low < scaled.high) || (flat.low <= scaled.low && scaled.high < flat.high)) return {};
        first = curve.num_at_or_below(scaled.low, first);
        int64_t last = curve.num_at_or_below(scaled.high, first);
        if (last == first && curve.is_flat(first)) {
            bool is_last = first == curve.rows.shape[0] - 1;
            flat = {first > 0 ? curve.value(first - 1) : -INFINITE, is_last ? INFINITE : curve.value(first)};
            return {};
        }
        Channels w0 = curve(first, scaled.low), w1 = curve(last, scaled.high);
        Distance found = last > first ? distance(curve, scaled, first, last, w0, w1) : Distance{0, 1};
        double square = squared_length(w1 - w0) * (DIFFERENCE_ERROR_SHARE * DIFFERENCE_ERROR_SHARE);
        return {most(found.square, square), found.square / (found.squared_width * found.squared_width), square};
    }
};

// Return the variation in a brick. terms(low, high): returns the Terms of a dual cell, by its range of values.
template <class T, class TermsOf>
INLINE Variation variation(const DualCells<T>& cells, TermsOf& terms) {
    double largest = 0, total = 0, total_difference = 0;
    for (int64_t z = 0; z <= cells.nums[0]; z++)
        for (int64_t y = 0; y <= cells.nums[1]; y++) {
            const T *low = &cells.low(z, y, 0), *high = &cells.high(z, y, 0);
            double of_row = cells.share_along(0, z) * cells.share_along(1, y);
            auto add = [&](int64_t x, double part) __attribute__((always_inline)) {
                const Terms found = terms(low[x], high[x]);
                largest = most(largest, found.largest);
                total += part * found.steps, total_difference += part * found.differences;
            };
            add(0, 0.5 * of_row);
            for (int64_t x = 1; x < cells.nums[2]; x++) add(x, of_row);
            add(cells.nums[2], 0.5 * of_row);
        }
    return {__builtin_sqrt(largest), __builtin_sqrt(total / cells.size()),
            __builtin_sqrt(total_difference / cells.size())};
}

// Add the steps between shown voxels and hidden or missing ones to the variation of a brick. is_shown(z, y, x): tells
// whether a voxel at a corner of dual cells is shown.
template <class IsShown>
Variation with_edges(const Variation& found, const DualCells<double>& cells, const Curve& curve,
                     const IsShown& is_shown) {
    double largest = squared(found.largest), total = 0;
    cells.for_each([&](int64_t z, int64_t y, int64_t x, double low, double high) {
        Range scaled = {curve.scale * low, curve.scale * high};
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
Variation differences(const DualCells<double>& cells, const Differs& differs, const Corner& w_at) {
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

// The terms of dual cells as a function of the range of bit patterns at their corners.
//
// Many dual cells of bytes have the same range, so their terms are kept in a table. Wider patterns have too many ranges.
template <class T>
class TermsByPattern {
    struct Kept {
        // The terms of the range.
        Terms terms;
        // Whether the terms have been computed.
        bool are_known;
    };
    static constexpr bool IS_KEPT = sizeof(T) == 1;
    // The terms that are not in the table.
    TermsByScalar by_scalar;
    // The scalar of each pattern, in ascending order.
    const double* scalars;
    // The terms by the lowest and the highest pattern of a range.
    Buffer<Kept> table;

  public:
    // ordered: the scalars of patterns, in ascending order.
    TermsByPattern(const Curve& curve, const double* ordered)
        : by_scalar(curve), scalars(ordered), table(IS_KEPT ? 1 << 16 : 1) {}

    // Return false if there was no memory for the table.
    explicit operator bool() const { return (bool)table; }

    INLINE Terms operator()(T low, T high) {
        if constexpr (!IS_KEPT) return by_scalar(scalars[low], scalars[high]);
        else {
            Kept& kept = table[low | high << 8];
            if (!kept.are_known) kept = {by_scalar(scalars[low], scalars[high]), true};
            return kept.terms;
        }
    }
};

// The order of the bit patterns of voxels of at most 16 bits, by which patterns can be compared in place of scalars.
template <class T>
struct PatternOrder {
    // The number of patterns.
    static constexpr int64_t NUM = 1 << 8 * sizeof(T);
    // The bits that are inverted, so that patterns ascend as their scalars do: the highest bit of signed integers.
    T flip;
    // The scalar of each pattern, in ascending order.
    Buffer<double> scalars;

    explicit PatternOrder(const Array<const double, 1>& by_pattern, T inverted) : flip(inverted), scalars(NUM) {
        if (scalars)
            for (int64_t pattern = 0; pattern < NUM; pattern++) scalars[pattern ^ flip] = by_pattern[pattern];
    }

    bool is_ascending() const {
        bool ascends = true;
        for (int64_t k = 1; k < NUM; k++) ascends &= scalars[k - 1] < scalars[k];
        return ascends;
    }
};

INLINE Range scaled(const Curve& curve, Range range) { return {curve.scale * range.low, curve.scale * range.high}; }

// Return whether a brick may have visible bounds, or measures other than 0, by a bound of its scalars. Beside hidden and
// missing voxels, measures are 0 where all channels are.
INLINE bool may_count(const MeasureVoxelBricks& arguments, const Curve& curve, Range range) {
    if (!(range.low <= range.high)) return false;
    if (is_range_visible(arguments.breakpoints, range.low, range.high)) return true;
    if (range.low < range.high && !curve.is_flat_between(scaled(curve, range))) return true;
    bool may_have_edges = arguments.shown.exists || arguments.voxels.has_absent;
    return may_have_edges && !curve.is_zero(curve.scale * range.low);
}

// Measure bricks as `measure_voxel_bricks` does, by the patterns of voxels, all of which have data and are shown.
template <class T>
Status measure_patterns(const MeasureVoxelBricks& arguments, const PatternOrder<T>& order) {
    const auto& [voxels, cells, breakpoints, table, shown, are_lit, texels, bounds, measures, ranges] = arguments;
    constexpr int64_t size = PADDED_BRICK_SIZE;
    Buffer<T> low(size * size * size), high(size * size * size);
    Curve curve = {table.rows, table.scale};
    TermsByPattern<T> terms(curve, order.scalars.data);
    if (!low || !high || !terms) return NO_MEMORY;
    Array<const T, 3> raw = {(const T*)voxels.raw.data, {}};
    for (int axis = 0; axis < 3; axis++) raw.shape[axis] = voxels.raw.shape[axis];
    auto may_show = [&](T from, T to) { return is_range_visible(breakpoints, order.scalars[from], order.scalars[to]); };
    for (int64_t i = 0; i < cells.shape[0]; i++) {
        if (is_stopped()) return STOPPED;
        int64_t x = cells(i, 0), y = cells(i, 1), z = cells(i, 2);
        if (!may_count(arguments, curve, {ranges(z, y, x, 0), ranges(z, y, x, 1)})) continue;
        const int64_t first[3] = {BRICK_SIZE * x - HALO, BRICK_SIZE * y - HALO, BRICK_SIZE * z - HALO};
        load_values(raw, box_of(voxels.raw), first, size, low.data, [](T pattern) { return pattern; });
        if (order.flip)
            for (int64_t k = 0; k < size * size * size; k++) low.data[k] ^= order.flip;
        T lowest = TOP<T>, highest = BOTTOM<T>;
        for (int64_t k = 0; k < size * size * size; k++)
            lowest = least(lowest, low.data[k]), highest = most(highest, low.data[k]);
        const Range range = {order.scalars[lowest], order.scalars[highest]};
        ranges(z, y, x, 0) = range.low, ranges(z, y, x, 1) = range.high;
        bool is_varying = lowest < highest && !curve.is_flat_between(scaled(curve, range));
        bool is_visible = may_show(lowest, highest);
        if (!is_varying && !is_visible) continue;
        DualCells<T> of_brick = {{low.data, {size, size, size}}, {high.data, {size, size, size}}, {}};
        for (int axis = 0; axis < 3; axis++)
            of_brick.nums[axis] = least(raw.shape[axis] - BRICK_SIZE * cells(i, 2 - axis), BRICK_SIZE);
        to_ranges(of_brick);
        if (is_visible) find_visible_bounds(of_brick, may_show, bounds[z][y][x]);
        if (!is_varying) continue;
        Variation found = variation(of_brick, terms);
        measures(0, z, y, x) = found.largest;
        measures(1, z, y, x) = found.steps;
        measures(2, z, y, x) = found.differences;
    }
    return DONE;
}

// Measure bricks by the patterns of voxels, and return true, if patterns can be put in the order of their scalars.
// status: the result of the measurement.
template <class T>
bool measure_if_ordered(const MeasureVoxelBricks& arguments, Status& status) {
    constexpr T sign = 1 << (8 * sizeof(T) - 1);
    for (T flip : (const T[]){0, sign}) {
        PatternOrder<T> order(arguments.voxels.scalars.value, flip);
        if (order.scalars && !order.is_ascending()) continue;
        status = order.scalars ? measure_patterns(arguments, order) : NO_MEMORY;
        return true;
    }
    return false;
}

}  // namespace

// Measure the dual cells in bricks of voxels: their visible bounds, the largest D or J, and the root mean squares over
// the brick's volume of D / width^2 and of J.
//
// A brick has half of each dual cell between itself and a neighbour. Beyond the border, the nearest voxels are
// repeated.
Status measure_voxel_bricks(const MeasureVoxelBricks* arguments) {
    const auto& [voxels, cells, breakpoints, table, shown, are_lit, texels, bounds, measures, ranges] = *arguments;
    constexpr int64_t size = PADDED_BRICK_SIZE;
    auto num_bricks = [&](int axis) { return (voxels.raw.shape[axis] + BRICK_SIZE - 1) / BRICK_SIZE; };
    int64_t num_z = num_bricks(0), num_y = num_bricks(1), num_x = num_bricks(2);
    if (!fit_together(voxels, cells) || !fits(table) || !has_shape(bounds, num_z, num_y, num_x, 2, 3) ||
        !has_shape(measures, 3, num_z, num_y, num_x) || !has_shape(ranges, num_z, num_y, num_x, 2) ||
        (texels.exists && !has_shape(texels.value, cells.shape[0], size, size, size, 4)) ||
        (shown.exists && !has_shape(shown.value, voxels.raw.shape[0], voxels.raw.shape[1], voxels.raw.shape[2])))
        return OUT_OF_BOUNDS;
    const bool are_plain = !texels.exists && !shown.exists && !voxels.has_absent && !voxels.is_labels;
    Status status = DONE;
    if (are_plain && voxels.raw.dtype == 0 && measure_if_ordered<uint8_t>(*arguments, status)) return status;
    if (are_plain && voxels.raw.dtype == 2 && measure_if_ordered<uint16_t>(*arguments, status)) return status;
    Cube low(size), high(size), around(size + 2);
    if (!low || !high || !around) return NO_MEMORY;
    Curve curve = {table.rows, table.scale};
    auto may_show = [&](double low, double high) { return is_range_visible(breakpoints, low, high); };
    for (int64_t i = 0; i < cells.shape[0]; i++) {
        if (is_stopped()) return STOPPED;
        int64_t x = cells(i, 0), y = cells(i, 1), z = cells(i, 2);
        DualCells<double> of_brick = {low.field, high.field, {}};
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
        if (!may_count(*arguments, curve, {ranges(z, y, x, 0), ranges(z, y, x, 1)})) continue;
        load_brick(voxels, cells[i], voxels.has_absent ? around.field : low.field);
        // A voxel without data takes a mean of its neighbours, which may lie outside the brick.
        Range of_voxels = range_of(voxels.has_absent ? around.field : low.field);
        if (voxels.is_labels) load_brick(voxels, cells[i], around.field);
        if (voxels.is_labels && are_lit) {
            clear_beyond_border(voxels, cells[i], low.field);
            clear_beyond_border(voxels, cells[i], around.field);
        }
        bool is_whole = !voxels.has_absent || fill_absent(around.field, low.field);
        Range range = voxels.has_absent || voxels.is_labels ? range_of(low.field) : of_voxels;
        // The mean of equal numbers may differ from them in its last place.
        ranges(z, y, x, 0) = least(of_voxels.low, range.low), ranges(z, y, x, 1) = most(of_voxels.high, range.high);
        if (!(range.low <= range.high)) continue;
        bool is_varying = !is_whole || shown.exists || !curve.is_flat_between(scaled(curve, range));
        bool is_visible = may_show(range.low, range.high);
        if (is_varying || is_visible) to_ranges(of_brick);
        if (is_visible) find_visible_bounds(of_brick, may_show, bounds[z][y][x]);
        if (!is_varying) continue;
        const auto& loaded = around.field;  // the loaded field is one voxel larger than the dual cells on each side
        Variation found;
        if (voxels.is_labels) {
            auto differs = [&](int64_t w, int64_t v, int64_t u) { return low.field(w, v, u) < high.field(w, v, u); };
            auto w_at = [&](int64_t w, int64_t v, int64_t u) { return evaluate(table, loaded(w + 1, v + 1, u + 1)); };
            found = differences(of_brick, differs, w_at);
            found.steps = __builtin_sqrt(1.0 / 12) * EDGE_INVERSE_WIDTH / DIFFERENCE_ERROR_SHARE * found.differences;
        } else {
            TermsByScalar terms(curve);
            found = variation(of_brick, terms);
        }
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
