// Find the label at samples between voxels: the one with the largest sum of weights over the 27 nearest voxels.
//
// Along each axis, let the sample be t voxels behind the nearest voxel, with t from -1/2 to 1/2. The weights of the voxel
// before the nearest one, of the nearest voxel, and of the voxel behind it are
//
//     0.8 of a quadratic B-spline    (1/2 - t)^2 / 2    3/4 - t^2    (1/2 + t)^2 / 2
//     0.2 of a tent                  max(-t, 0)         1 - |t|      max(t, 0)
//
// The B-spline alone makes borders without stairs, but gives a voxel only 0.42 of the weight at its own centre: a label
// of one voxel, or of a row of voxels, would vanish. The sum of both gives the voxel 0.51 there. The eight voxels around a
// sample have more than 0.72 of the weight: if all eight have one label, it is the sample's label.
#pragma once
#include "draw/sample.h"

// The distance from the texel of the lowest neighbour to the texel in the middle.
constexpr int32_t TO_MIDDLE = PLANE_STRIDE + ROW_STRIDE + 1;

// Return the weights along an axis of the voxel before the nearest one (x), of the nearest (y), and of the one behind (z).
INLINE Three label_weights(Floats t) {
    Floats zero = in_all<Floats>(0.0f), before = 0.5f - t, behind = 0.5f + t;
    return {
        fma(0.4f * before, before, 0.2f * max_of(zero, -t)),
        fma(-0.8f * t, t, fma(in_all<Floats>(-0.2f), magnitude(t), in_all<Floats>(0.8f))),
        fma(0.4f * behind, behind, 0.2f * max_of(zero, t)),
    };
}

// The positions of samples among the texels around them, by which labels get their weights.
struct LabelPlace {
    // The distance in memory from the lowest of the eight texels around a sample to the texel nearest to the sample.
    Ints nearest;
    // The weights along each axis, as `label_weights` returns them.
    Three weights[3];
    // Whether the nearest texel is the upper one of two along each axis.
    Mask are_behind[3];

    INLINE explicit LabelPlace(const Three& shares) : nearest(in_all<Ints>(0)) {
        const Floats* share = &shares.x;
        constexpr int32_t strides[] = {1, ROW_STRIDE, PLANE_STRIDE};
        for (int axis = 0; axis < 3; axis++) {
            are_behind[axis] = mask_of(share[axis] >= 0.5f);
            nearest += where(are_behind[axis], in_all<Ints>(strides[axis]), in_all<Ints>(0));
            weights[axis] = label_weights(where(are_behind[axis], share[axis] - 1.0f, share[axis]));
        }
    }

    // Return the weight of the lower or the upper of the two texels along an axis.
    INLINE Floats of_corner(int axis, bool is_upper) const {
        const auto& [before, here, behind] = weights[axis];
        return is_upper ? where(are_behind[axis], here, behind) : where(are_behind[axis], before, here);
    }

    // Return the label of the nearest of eight texels. sum: the sum of the weights of the texels with this label.
    INLINE Floats nearest_label(const Corners& corners, Floats& sum) const {
        const auto& [a, b, c, d, e, f, g, h] = corners;
        auto pick = [&](int axis, Floats low, Floats high) { return where(are_behind[axis], high, low); };
        Floats label = pick(2, pick(1, pick(0, a, b), pick(0, c, d)), pick(1, pick(0, e, f), pick(0, g, h)));
        const Floats all[] = {a, b, c, d, e, f, g, h};
        sum = in_all<Floats>(0.0f);
        for (int k = 0; k < 8; k++) {
            Floats weight = of_corner(0, k & 1) * of_corner(1, k >> 1 & 1) * of_corner(2, k >> 2);
            sum += where(mask_of(all[k] == label), weight, in_all<Floats>(0.0f));
        }
        return label;
    }
};

// The 27 texels around samples, x before y before z, and their weights.
struct Neighbours {
    Floats labels[27], weights[27];

    INLINE Neighbours(const Texels& texels, Ints at, const LabelPlace& place) {
        // Rounding may move samples a little out of the brick, and lanes without a ray may be anywhere.
        Ints last = in_all<Ints>(TEXELS_PER_BRICK - 1 - TO_MIDDLE);
        at = min_of(max_of(at + place.nearest, in_all<Ints>(TO_MIDDLE)), last) - TO_MIDDLE;
        const auto& [x, y, z] = place.weights;
        const Floats ys[3] = {y.x, y.y, y.z}, zs[3] = {z.x, z.y, z.z};
        for (int row = 0; row < 9; row++) {
            Floats weight = zs[row / 3] * ys[row % 3];
            auto four = load_four(rest_of(texels, row / 3 * PLANE_STRIDE + row % 3 * ROW_STRIDE), at);
            labels[3 * row] = four.a, labels[3 * row + 1] = four.b, labels[3 * row + 2] = four.c;
            weights[3 * row] = weight * x.x, weights[3 * row + 1] = weight * x.y, weights[3 * row + 2] = weight * x.z;
        }
    }

    // Return the sum of the weights of a label. counted: a bit for each neighbour, which is set if the neighbour has
    // the label.
    INLINE Floats sum_of(Floats label, Ints& counted) const {
        Floats sum = in_all<Floats>(0.0f);
        for (int k = 0; k < 27; k++) {
            Mask is_same = mask_of(labels[k] == label);
            sum += where(is_same, weights[k], in_all<Floats>(0.0f));
            counted |= where(is_same, in_all<Ints>(1 << k), in_all<Ints>(0));
        }
        return sum;
    }

    // Return the first label whose neighbours have not been counted.
    INLINE Floats next_label(Ints counted) const {
        Floats next = labels[13];
        for (int k = 26; k >= 0; k--) next = where(mask_of((counted & (1 << k)) == 0), labels[k], next);
        return next;
    }
};

INLINE Mask are_equal(const Corners& corners) {
    auto [a, b, c, d, e, f, g, h] = corners;
    return mask_of(a == b) & mask_of(a == c) & mask_of(a == d) & mask_of(a == e) & mask_of(a == f) & mask_of(a == g) &
        mask_of(a == h);
}

// Return the labels at active samples. corners: the eight texels around each sample.
INLINE Floats labels_at(const Texels& texels, Ints at, const Three& shares, const Corners& corners, Mask active) {
    Mask are_mixed = active & ~are_equal(corners);
    if (!any_of(are_mixed)) return corners.a;
    const LabelPlace place(shares);
    Floats best, winner = place.nearest_label(corners, best);
    // Most samples are decided by the eight nearest texels.
    Mask are_divided = are_mixed & ~mask_of(best > 0.5f);
    if (!any_of(are_divided)) return winner;
    const Neighbours around(texels, at, place);
    Ints counted = in_all<Ints>(0);
    best = around.sum_of(winner, counted);
    Floats rest = 1.0f - best;
    while (any_of(are_divided & mask_of(rest > best))) {
        Floats next = around.next_label(counted), sum = around.sum_of(next, counted);
        winner = where(are_divided & mask_of(sum > best), next, winner);
        best = max_of(best, sum), rest -= sum;
    }
    return winner;
}
