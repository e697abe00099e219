// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "transfer/kernels.h"

// Average the optical depths of voxels over a slab of cells.
struct AverageVoxels {
    // [z, y, x]: the voxels of the volume; those of at most 16 bits as unsigned bit patterns (`raw_voxels` in
    // renderer/transfer/classify.py).
    AnyArray<3> raw;
    // [patterns]: the optical depth of each bit pattern of a voxel; None if `curve` is given.
    Maybe<Array<const float, 1>> by_pattern;
    // The transfer function, if scalars have more than 16 bits; otherwise None.
    Maybe<TransferTable> curve;
    // [z, y, x, 2]: the ranges of scalars in bricks, as in BuildBlocks; None if they are unknown.
    Maybe<Array<const double, 4>> ranges;
    // The scalars, ascending, at which voxels become visible or invisible.
    Array<const double, 1> breakpoints;
    // The level of the cells, which are 2^level voxels wide.
    int64_t level;
    // The index of the slab of cells, along z.
    EACH_CALL int64_t slab;
    // [y, x]: the mean optical depth of each cell.
    EACH_CALL Array<float, 2> out;
};
LONG_KERNEL(average_voxels, AverageVoxels)

// Find how much light reaches a slab of cells, by rays from their centres.
struct Transmit {
    // [z + 2, y + 2, x + 2]: the mean optical depth of each cell, on a path as long as the finest voxel spacing. The
    // outermost cells are repeated once beyond each border.
    Array<const float, 3> depths;
    // [rays, samples, 3] (x, y, z): the offsets of the samples of each ray from its start, outwards, in cells.
    Array<const float, 3> offsets;
    // [z + 2, y + 2, parts]: for each part of 16 cells of a row, whether any depth is above 0 in the part or the next
    // one, or in the same two parts of the next rows along y and z.
    Array<const bool, 3> filled;
    // [samples]: the length that each sample stands for, in finest voxel spacings.
    Array<const float, 1> lengths;
    // The highest corner of the volume (x, y, z), in cells; rays end at the volume's border.
    float end[3];
    // The index of the slab of cells, along z.
    EACH_CALL int64_t slab;
    // [y, x]: the mean transmission of the rays of each cell.
    EACH_CALL Array<float, 2> out;
};
LONG_KERNEL(transmit, Transmit)

// Add the mean extinctions of a layer, and its mean albedos times extinction, over a slab of cells of a world grid.
//
// The scalar is linear between voxel centres, and is taken at places that are spread evenly over each cell.
struct AverageMatter {
    // [z, y, x]: the voxels; those of at most 16 bits as unsigned bit patterns.
    AnyArray<3> raw;
    // [patterns]: the scalar of each bit pattern, NaN without data; None for voxels of more than 16 bits.
    Maybe<Array<const double, 1>> scalars;
    // [z, y, x]: 0 for voxels that a mask hides; None without a mask.
    Maybe<Array<const uint8_t, 3>> shown;
    // Whether scalars are labels: a place has the one with the largest sum of weights around it.
    bool is_labels;
    // The transfer function: albedos, and optical depths of a path through one cell, times the weight of the layer.
    TransferTable curve;
    // The scalars, ascending, at which matter becomes visible or invisible.
    Array<const double, 1> breakpoints;
    // [3, 4]: the matrix from places in cells (x, y, z), where cell i reaches from i to i + 1, to voxel indices.
    double index_from_cells[12];
    // The number of places along each axis of a cell.
    int64_t num_places;
    // [4, z, y, x]: the sums over layers of the mean albedo times depth (r, g, b), and of the mean depth of each cell.
    Array<float, 4> out;
    // The index of the slab of cells, along z.
    EACH_CALL int64_t slab;
};
LONG_KERNEL(average_matter, AverageMatter)

// Find from the optical depths of cells how they scatter and let light through. A block is 16 slabs of cells along z.
//
// Arrays have two layouts, so that sweeps along each axis read rows in order: [z, y, x] and [x, y, z]. Rows are padded
// with empty cells to a multiple of 16.
struct PrepareCells {
    // [4, z, y, x]: as AverageMatter writes it.
    Array<const float, 4> cells;
    // The length of a sweep's path through a cell, in widths of a cell.
    double path;
    // The index of the block, along z.
    EACH_CALL int64_t block;
    // [3, z, y, x]: the albedos.
    EACH_CALL Array<float, 4> albedos;
    // [3, z, y, x]: the shares of light that reach the visible matter of a cell, and that pass through the cell, along
    // a sweep; the optical depths of a path as long as a cell is wide.
    EACH_CALL Array<float, 4> along_x;
    // [3, x, y, z]: the same.
    EACH_CALL Array<float, 4> along_z;
};
LONG_KERNEL(prepare_cells, PrepareCells)

// Multiply the mean radiance of a block of cells by their albedos: the light that they scatter to each direction.
struct ScatterLight {
    // [3, z, y, x]: the albedos.
    Array<const float, 4> albedos;
    // [3, z, y, x]: the mean radiance without straight light of the key light.
    Array<const float, 4> radiance;
    // [z, y, x]: the share of the key light that reaches each cell.
    Array<const float, 3> key;
    // [rgb]: the mean radiance of the whole key light.
    float key_radiance[3];
    // The index of the block, along z.
    EACH_CALL int64_t block;
    // [3, z, y, x] and [3, x, y, z]: the light that cells scatter.
    EACH_CALL Array<float, 4> along_x;
    EACH_CALL Array<float, 4> along_z;
};
LONG_KERNEL(scatter_light, ScatterLight)

// Carry light through all cells along four directions, whose largest part is along one axis.
struct SweepLight {
    // [3, planes, rows, cells] if `are_planes_first`, else [3, rows, planes, cells]: as PrepareCells writes it.
    Array<const float, 4> shares;
    // [3, ...]: the light that cells scatter, in the same order.
    Array<const float, 4> scattered;
    // Whether the planes of the sweep are along the first of the three axes, else along the second.
    bool are_planes_first;
    // Whether light goes towards higher numbers of planes.
    bool is_upwards;
    // [directions, 2]: the place from which light comes, in the plane before, in rows and in cells; from -1 to 1.
    Sized<const float, 2, 4, 2> offsets;
    // [directions, rgb]: the radiance that enters the grid.
    Sized<const float, 2, 4, 3> entering;
    // [directions]: the weight of each direction in the sum.
    float weights[4];
    // [3, ...]: the weighted sum of the radiances at the middles of cells, in the same order.
    Array<float, 4> out;
};
LONG_KERNEL(sweep_light, SweepLight)

// Add the share of light of one direction that reaches each cell, without any that is scattered.
//
// Rays begin at the border and are moved from plane to plane, so that the edges of shadows stay sharp.
struct ShineKey {
    // [4, ...]: as in SweepLight.
    Array<const float, 4> shares;
    // Whether the planes are along the first of the three axes, else along the second.
    bool are_planes_first;
    // Whether light goes towards higher numbers of planes.
    bool is_upwards;
    // The place from which light comes, in the plane before, in rows and in cells; from -1 to 1.
    float offset[2];
    // The length of the path through a plane, in widths of a cell.
    float path;
    // The share of the key light that this direction stands for.
    float weight;
    // [1, ...]: the sum of the shares over directions.
    Array<float, 4> out;
};
LONG_KERNEL(shine_key, ShineKey)

// Add up sums of sweeps over a block of cells, in a fixed order.
struct GatherLight {
    // [sums, channels, z, y, x]: the sums of sweeps along y and z.
    Array<const float, 5> along_x;
    // [sums, channels, x, y, z]: the sums of sweeps along x.
    Array<const float, 5> along_z;
    // The index of the block, along z.
    EACH_CALL int64_t block;
    // [channels, z, y, x]: all sums.
    EACH_CALL Array<float, 4> out;
};
LONG_KERNEL(gather_light, GatherLight)

// Find the inner products of the change of a round with the changes of the last rounds, over one slab of cells.
struct MeasureRound {
    // [rounds, 3, z, y, x]: the mean radiances that the last rounds began with.
    Array<const float, 5> begun;
    // [rounds, 3, z, y, x]: the mean radiances that they ended with.
    Array<const float, 5> ended;
    // The number of the round.
    int64_t number;
    // The index of the slab of cells, along z.
    EACH_CALL int64_t slab;
    // [z, 3, rounds]: for each slab and colour, the products.
    EACH_CALL Array<double, 3> products;
    // [z]: for each slab, the largest change of the round.
    EACH_CALL Array<float, 1> largest;
};
LONG_KERNEL(measure_round, MeasureRound)

// Mix the results of rounds, over one slab of cells.
struct MixRounds {
    // [rounds, 3, z, y, x]: the mean radiances that rounds ended with.
    Array<const float, 5> ended;
    // [rounds, 3]: the weight of each round, for each colour.
    Sized<const float, 2, 3> weights;
    // The index of the slab of cells, along z.
    EACH_CALL int64_t slab;
    // [3, z, y, x]: the mix, nowhere below 0.
    EACH_CALL Array<float, 4> out;
};
LONG_KERNEL(mix_rounds, MixRounds)
