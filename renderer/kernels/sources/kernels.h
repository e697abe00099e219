// What kernels take: the one place where both languages read it.
//
// Python reads this file, too (binding.py), and fills each struct by the names of its members, from a NamedTuple or from
// keyword arguments. It knows these types of members, and refuses a file with others:
//
//     int64_t, float, double, bool, ...   a number
//     double x[3]                         a sequence of three numbers, or an array of that size
//     Array<const float, 2>               an array of that dtype and number of dimensions, contiguous; without `const`
//                                         it must be writeable, too
//     AnyArray<3>                         an array of any dtype, contiguous, read only
//     Struct                              one that is defined above
//     Maybe<any of these but numbers>     the same, or None
//
// KERNEL(name, Struct) declares a kernel that takes a Struct. Rooms are in the order of docs/architecture.md.
#pragma once
#include "arrays.h"

#ifndef KERNEL
#define KERNEL(name, Arguments) \
    extern "C" __attribute__((visibility("default"))) Status name(const Arguments* arguments);
#endif

// ---- transfer

// As in renderer/transfer/piecewise.py.
struct TransferTable {
    Array<const double, 1> values;
    Array<const double, 2> rows;
    double scale;
    Array<const uint64_t, 1> guide;
    double buckets_per_unit;
};

// As in renderer/transfer/piecewise.py.
struct PiecewiseTransfer {
    Array<const float, 2> rows;
    Array<const int32_t, 1> guide;
};

// As in renderer/transfer/light_field.py.
struct LightField {
    Array<const int32_t, 1> corners;
    double cell_size;
    float occlusion_strength;
    float shadow_strength;
};

// ---- pyramid

// ---- lighting

// ---- splats

// ---- bricks

// ---- view

// As in renderer/view/cutting.py.
struct Cuts {
    Array<const double, 2> slabs;
    Array<const double, 3> boxes;
};

// As in renderer/view/brick_projection.py.
struct RaySetup {
    Array<const double, 2> origins;
    Array<const double, 2> directions;
    double slope_per_px;
    double start;
    double center_px[2];
    Maybe<Cuts> cuts;
};

// As in renderer/view/splat_projection.py.
struct ModelView {
    Array<const double, 2> view_from_model;
    bool perspective;
    double scale_px;
    int64_t size[2];
    double near;
    Array<const double, 1> slope_limit;
};

// ---- modes

// ---- draw

struct BinBricks {
    Array<const int64_t, 2> tile_windows;
    int64_t num_columns;
    int64_t num_rows;
    Array<int64_t, 1> starts;
    Array<int64_t, 1> numbers;
};
KERNEL(bin_bricks, BinBricks)

// As in renderer/draw/subsampling.py. factor: every which pixel of the image the grid has.
struct UpsampleRows {
    Array<const float, 3> grid;
    int64_t factor;
    Array<float, 3> image;
    int64_t first_row;
    int64_t end_row;
};
KERNEL(upsample_rows, UpsampleRows)

struct MarkDiffering {
    Array<const float, 3> grid;
    float threshold;
    Array<bool, 2> differ;
};
KERNEL(mark_differing, MarkDiffering)

struct RefineRows {
    Array<const float, 3> grid;
    int64_t factor;
    Array<float, 3> image;
    int64_t first_row;
    int64_t end_row;
    Array<const bool, 2> differ;
    Array<bool, 2> is_drawn;
};
KERNEL(refine_rows, RefineRows)

// starts, num_corners: as in renderer/draw/overlay.py. axis: along which the edges are. shape: of the volume.
struct PlaceEdges {
    Array<const int64_t, 1> starts;
    int64_t num_corners[3];
    int64_t axis;
    int64_t level;
    int64_t shape[3];
    double model_from_index[9];
    Array<float, 2> vertices;
};
KERNEL(place_edges, PlaceEdges)

// vertices, voxel_side: as in Lines. colors: [n, 4], by level. Others: constants of renderer/draw/cpu/lines.py.
struct DrawLines {
    Array<const float, 2> vertices;
    double voxel_side;
    Array<const double, 2> colors;
    ModelView camera;
    double cover;
    double opacity;
    double min_side_px;
    Array<float, 3> image;
};
KERNEL(draw_lines, DrawLines)

// As in the files of renderer/draw/cpu/, and so are those that follow it.
struct TileBins {
    int64_t side;
    Array<const int64_t, 2> rectangles;
    Array<const int64_t, 1> starts;
    Array<const int64_t, 1> numbers;
};

struct Grid {
    TileBins bins;
    int64_t stride;
    RaySetup rays;
    Array<const double, 2> boxes;
    Array<const int64_t, 1> texel_offsets;
    Array<const bool, 2> is_drawn;
    Array<float, 3> image;
};

struct Field {
    Array<const float, 1> scalars;
    Array<const float, 1> means;
    PiecewiseTransfer pieces;
    float lowest_visible;
    float termination_alpha;
    float spacings_per_model_unit;
    bool has_absent;
    bool is_lit;
    float light[5];
};

// As ShadingSpec in renderer/scene/shading_section.py.
struct Shading {
    float ambient;
    float diffuse;
    float specular;
    float shininess;
    bool two_sided;
};

struct Light {
    Shading shading;
    LightField field;
    bool is_camera;
    float toward[3];
    float world_from_index[9];
    Array<const float, 2> factors;
    int64_t grid_shape[3];
    double first_cell[3];
};

struct DrawTiles {
    Grid grid;
    Array<const bool, 1> is_mean;
    Field field;
    Maybe<Light> light;
    Array<const int64_t, 1> tiles;
};
KERNEL(draw_tiles, DrawTiles)

struct Search {
    float offset;
    float slope;
    float slack;
    float min_rise;
    float ceiling;
    bool is_sorted;
    bool has_absent;
    double forward[3];
};

// tops: upper bounds of what is in each brick.
struct DrawExtremes {
    Grid grid;
    Array<const double, 1> tops;
    Array<const float, 1> scalars;
    Search search;
    Array<const int64_t, 1> tiles;
};
KERNEL(draw_extremes, DrawExtremes)

// ---- film

struct Quantize {
    Array<const float, 3> image;
    float background[3];
    Array<uint8_t, 3> result;
};
KERNEL(quantize, Quantize)

// ---- truth
