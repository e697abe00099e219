// What the kernels of this folder take (base/kernels.h).
#pragma once
#include "volume/kernels.h"
#include "transfer/kernels.h"
#include "view/kernels.h"

struct BinBricks {
    Sized<const int64_t, 2, 4> tile_windows;
    int64_t num_columns, num_rows;
    Array<int64_t, 1> starts, numbers;
};
KERNEL(bin_bricks, BinBricks)

// As in renderer/draw/bricks/subsampling.py. factor: every which pixel of the image the grid has.
struct UpsampleRows {
    Sized<const float, 3, 4> grid;
    Sized<float, 3, 4> image;
    int64_t factor, first_row, end_row;
};
KERNEL(upsample_rows, UpsampleRows)

struct RefineRows {
    Sized<const float, 3, 4> grid;
    Sized<float, 3, 4> image;
    int64_t factor, first_row, end_row;
    float threshold;
    Array<bool, 2> is_drawn;
};
KERNEL(refine_rows, RefineRows)

// starts, num_corners: as in renderer/draw/overlay.py. axis: along which the edges are. shape: of the volume.
struct PlaceEdges {
    Array<const int64_t, 1> starts;
    int64_t num_corners[3], axis, level, shape[3];
    double model_from_index[9];
    Sized<float, 2, 7> vertices;
};
KERNEL(place_edges, PlaceEdges)

// vertices, voxel_side: as in Lines. colors: [n, 4], by level. Others: constants of renderer/draw/lines.py.
struct DrawLines {
    Sized<const float, 2, 7> vertices;
    double voxel_side;
    Sized<const double, 2, 4> colors;
    ModelView camera;
    double cover, opacity, min_side_px;
    Sized<float, 3, 4> image;
};
KERNEL(draw_lines, DrawLines)

// As in the files of renderer/draw/bricks/, and so are those that follow it.
struct Grid {
    int64_t side, stride;
    Sized<const int64_t, 2, 4> rectangles;
    Array<const int64_t, 1> starts, numbers;
    Array<const bool, 2> is_drawn;
    Sized<float, 3, 4> image;
};

// As ShadingSpec in renderer/scene/shading_section.py.
struct Shading {
    float ambient, diffuse, specular, shininess, silhouette;
    bool two_sided;
};

struct Light {
    Shading shading;
    LightGrid grid;
    bool is_camera;
    float toward[3], world_from_index[9];
    Sized<const float, 2, 3> factors;
    double first_cell[3];
};

// are_cut: whether some of a brick is not in the mask.
struct FieldMask {
    MaskGrid grid;
    Array<const bool, 1> are_cut;
};

struct Field {
    Array<const float, 1> scalars, means;
    Array<const int64_t, 1> texel_offsets;
    PiecewiseTransfer pieces;
    float weight, lambert[5];
    bool has_absent, is_labels, has_colors, is_lit, lights_faces;
    Maybe<Light> light;
    Maybe<FieldMask> mask;
};

// The bricks of layers on one grid of voxels. is_mean: whether the texels of a brick are means: those of all layers are
// in the first field, with their weights. have_faces: whether a brick is near a face that clipping cuts; face_depth: how
// far its light reaches, as a length in the world.
struct LayerBricks {
    RaySetup rays;
    float spacings_per_model_unit;
    Sized<const double, 2, 11> boxes;
    Array<const bool, 1> is_mean, have_faces;
    double face_depth;
    Array<const Field, 1> fields;
};

struct DrawTiles {
    Grid grid;
    LayerBricks bricks;
    float termination_alpha;
    bool is_additive;
    Array<const int64_t, 1> tiles;
};
LONG_KERNEL(draw_tiles, DrawTiles)

// As in renderer/draw/bricks/mixture.py.
struct DrawMixture {
    Grid grid;
    Array<const LayerBricks, 1> groups;
    Sized<const int64_t, 2, 2> members;
    Sized<const double, 2, 3> depths;
    float termination_alpha;
    Array<const int64_t, 1> tiles;
};
LONG_KERNEL(draw_mixture, DrawMixture)

// tops: upper bounds of what is in each brick.
struct DrawExtremes {
    Grid grid;
    RaySetup rays;
    Sized<const double, 2, 11> boxes;
    Array<const int64_t, 1> texel_offsets, tiles;
    Array<const double, 1> tops;
    Array<const float, 1> scalars;
    float offset, slope, slack, min_rise, ceiling;
    bool is_sorted, has_absent;
    double forward[3];
};
LONG_KERNEL(draw_extremes, DrawExtremes)
