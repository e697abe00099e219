// Continue the means in bricks beyond the volume's border (renderer/bricks/texels.py).
#include "bricks/kernels.h"
#include "bricks/brick_voxels.h"

namespace {

// The distance in memory from one texel of a brick to the next along x, y, z, in texels.
constexpr int64_t STRIDES[3] = {1, PADDED_BRICK_SIZE, PADDED_BRICK_SIZE * PADDED_BRICK_SIZE};

// A brick at the volume's border, whose texels are changed in place.
struct Border {
    // [18^3, 4]: the texels of the brick.
    Array<float, 2> texels;
    // The largest ratio of a mean of tau c to a mean of tau, to which extrapolated colours are clamped.
    double brightest;

    // Write to the texel `at` a value extrapolated `distance` cells beyond the middle of `last`, along the line through
    // the texels `before` and `last`. The texel `last` is a mean over `share` of a cell.
    INLINE void extrapolate(int64_t before, int64_t last, double share, double distance, int64_t at) const {
        double depth = 0;
        for (int k = 3; k < 7; k++) {
            int channel = k % 4;
            float end = texels(last, channel), rise = end - texels(before, channel);
            double value = most((double)end + distance * (2 * (double)rise / (1 + share)), 0.0);
            if (channel == 3) depth = value;
            texels(at, channel) = (float)(channel == 3 ? value : least(value, brightest * depth));
        }
    }

    // Move the values of the last cells along an axis to cell centres, and continue the field beyond the volume's
    // border.
    //
    // cell: the brick's position along the axis. extent: the volume's extent in cells. num_cells: the extent, rounded
    // up.
    void extrapolate_axis(int axis, int64_t cell, double extent, int64_t num_cells) const {
        int64_t last = num_cells - BRICK_SIZE * cell;  // the index of the texel of the last cell
        if (cell > 0 && last > PADDED_BRICK_SIZE - 1) return;
        int64_t step = STRIDES[axis], other = STRIDES[(axis + 1) % 3], another = STRIDES[(axis + 2) % 3];
        double share = extent - (double)num_cells + 1, to_centre = 0.5 - 0.5 * share;
        for (int64_t a = 0; a < PADDED_BRICK_SIZE; a++)
            for (int64_t b = 0; b < PADDED_BRICK_SIZE; b++) {
                int64_t line = a * other + b * another, at = line + last * step;
                if (num_cells == 1) {
                    for (int channel = 0; channel < 4; channel++)
                        texels(at - step, channel) = texels(at + step, channel) = texels(at, channel);
                    continue;
                }
                if (last < PADDED_BRICK_SIZE - 1) extrapolate(at - step, at, share, 1 + to_centre, at + step);
                if (last <= PADDED_BRICK_SIZE - 1 && share < 1) extrapolate(at - step, at, share, to_centre, at);
                if (cell == 0) extrapolate(line + 2 * step, line + step, 1, 1, line);
            }
    }
};

}  // namespace

// Turn texels that hold means of cells into texels that hold the field at the cells' centres, also beyond the volume's
// border.
Status extrapolate_border(const ExtrapolateBorder* arguments) {
    const auto& [cells, extents, brightest, texels] = *arguments;
    constexpr int64_t size = PADDED_BRICK_SIZE;
    int64_t num = cells.shape[0];
    if (cells.shape[1] != 3 || !has_shape(texels, num, size, size, size, 4)) return OUT_OF_BOUNDS;
    for (int64_t i = 0; i < num; i++)
        for (int axis = 0; axis < 3; axis++) {
            int64_t cell = cells(i, axis), num_cells = (int64_t)__builtin_ceil(extents[axis]);
            if (cell < 0 || BRICK_SIZE * cell >= num_cells) return OUT_OF_BOUNDS;
            const Border border = {{texels[i].data, {size * size * size, 4}}, brightest};
            border.extrapolate_axis(axis, cell, extents[axis], num_cells);
        }
    return DONE;
}
