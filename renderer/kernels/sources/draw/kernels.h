// The structs that the kernels of this folder take (base/kernels.h).
#pragma once
#include "bricks/kernels.h"
#include "volume/kernels.h"
#include "transfer/kernels.h"
#include "view/kernels.h"

// Find the rays and the tiles of a grid that bricks may cover.
struct PlaceBricks {
    // [bricks, 4]: left, top, right and bottom of each brick in the picture, in pixels.
    Sized<const double, 2, 4> rectangles_px;
    // The x and the y of the first ray of the grid, in pixels.
    double first_px[2];
    // The distance from one ray to the next along each axis, in pixels.
    double step_px;
    // Rays at most this far outside of a brick's rectangle count as inside, in pixels.
    double reach_px;
    // The number of columns and of rows of rays.
    int64_t shape[2];
    // The side of a tile, in rays.
    int64_t side;
    // [bricks, 4]: the rectangles of Grid; zeros for a brick that covers no ray.
    Sized<int64_t, 2, 4> rectangles;
    // [bricks, 4]: the windows of BinBricks.
    Sized<int64_t, 2, 4> tile_windows;
};
KERNEL(place_bricks, PlaceBricks)

// Sort bricks into the tiles of a grid.
struct BinBricks {
    // [bricks, 4]: the tiles that a brick is over: the first column and row, and the column and row after the last.
    Sized<const int64_t, 2, 4> tile_windows;
    // [rows, columns]: whether any ray of a tile is drawn; tiles without rays get no bricks.
    Array<const bool, 2> have_rays;
    // [tiles + 2]: the starts of Grid, and one number more; the caller must zero the array.
    Array<int64_t, 1> starts;
    // The numbers of bricks, as in Grid.
    Array<int64_t, 1> numbers;
};
KERNEL(bin_bricks, BinBricks)

// Interpolate rows of an image between the pixels of a grid (renderer/draw/bricks/subsampling.py).
struct UpsampleRows {
    // [h, w, 4]: every `factor`-th pixel of the image along both axes.
    Sized<const float, 3, 4> grid;
    // [h, w, 4]: the image.
    Sized<float, 3, 4> image;
    int64_t factor;
    // The first row of the image to interpolate.
    EACH_CALL int64_t first_row;
    // The row after the last row to interpolate.
    EACH_CALL int64_t end_row;
};
KERNEL(upsample_rows, UpsampleRows)

// Interpolate rows of a finer grid, and mark the pixels of it that must be drawn.
struct RefineRows {
    // [h, w, 4]: every `factor`-th pixel of the finer grid along both axes.
    Sized<const float, 3, 4> grid;
    // [h, w, 4]: the finer grid; 0 where pixels must be drawn.
    Sized<float, 3, 4> image;
    int64_t factor;
    // The first row of the finer grid to interpolate.
    EACH_CALL int64_t first_row;
    // The row after the last row to interpolate.
    EACH_CALL int64_t end_row;
    // Pixels between four pixels of `grid` are interpolated unless these differ, and bend, by more than this. A pixel bends
    // by |a - 2 b + c|, with b the pixel and a and c its neighbours in a row or column.
    float threshold;
    // Whether colours are linear light, and are compared as they are shown (shown.h).
    bool is_linear;
    // [h, w]: row-major numbers of the pixels of the finer grid that are to be drawn, and -1 of the others.
    Array<int32_t, 2> places;
};
KERNEL(refine_rows, RefineRows)

// Find the ends of the edges, along one axis, of the cells of a level (renderer/draw/overlay.py).
struct PlaceEdges {
    // [n]: the number of the corner at which each edge starts; the corners of all cells are numbered, x fastest.
    Array<const int64_t, 1> starts;
    // The number of corners of cells along x, y, z.
    int64_t num_corners[3];
    // The axis along which the edges lie: 0 for x.
    int64_t axis;
    // The level of the cells, which are 2^level voxels wide.
    int64_t level;
    // The number of voxels of the volume along x, y, z.
    int64_t shape[3];
    // [3, 3]: the matrix from voxels to model units, in world axes.
    double model_from_index[9];
    // [n, 7]: the lines, as in Lines (renderer/draw/overlay.py); the first six columns are written.
    Sized<float, 2, 7> vertices;
};
KERNEL(place_edges, PlaceEdges)

// Draw lines over an image (renderer/draw/lines.py).
struct DrawLines {
    // [n, 7]: the lines, as in Lines (renderer/draw/overlay.py).
    Sized<const float, 2, 7> vertices;
    // The shortest side of a cell of level 0, as in Lines.
    double voxel_side;
    // [levels, 4]: the RGBA of lines by the level of their cell; the last colour is for all coarser levels.
    Sized<const double, 2, 4> colors;
    ModelView camera;
    // The factor by which the side of a line's cell in model units, times this side in pixels, gives the line's opacity.
    double cover;
    // The largest opacity of a line.
    double opacity;
    // Edges of a cell whose shortest side is shorter than this, in pixels, are not drawn.
    double min_side_px;
    // [h, w, 4]: the image, premultiplied RGBA.
    Sized<float, 3, 4> image;
};
KERNEL(draw_lines, DrawLines)

// Mark pixels that differ from a neighbour and so need several rays, in some rows of a picture.
struct MarkContrasts {
    // [h, w, 4]: premultiplied RGBA.
    Sized<const float, 3, 4> image;
    // A pixel is marked if a channel differs from one of its eight neighbours by more than this.
    float threshold;
    // As in RefineRows.
    bool is_linear;
    // The first row of pixels to mark.
    EACH_CALL int64_t first_row;
    // The row after the last row of pixels to mark.
    EACH_CALL int64_t end_row;
    // [h, w]: set to 2, a pixel that is to get 4 rays, for marked pixels; others stay as they are.
    Array<uint8_t, 2> marks;
};
KERNEL(mark_contrasts, MarkContrasts)

// Mark neighbours of some pixels, if they differ from the pixel and have no mark. Members as in MarkContrasts.
struct SpreadContrasts {
    Sized<const float, 3, 4> image;
    float threshold;
    bool is_linear;
    // [n]: row-major numbers of the pixels whose neighbours may be marked.
    Array<const int64_t, 1> pixels;
    Array<uint8_t, 2> marks;
};
KERNEL(spread_contrasts, SpreadContrasts)

// Find the pixels, among some, that lie on a thin line, and mark their neighbours. Members as in SpreadContrasts.
struct FollowLines {
    Sized<const float, 3, 4> image;
    // A pixel lies on a line if a channel is larger than in both pixels on opposite sides by more than this, or smaller.
    float threshold;
    bool is_linear;
    Array<const int64_t, 1> pixels;
    // [h, w]: 3 for a pixel that has its 16 rays; set to 4, a pixel that is to get 16 rays, for marked pixels.
    Array<uint8_t, 2> marks;
};
KERNEL(follow_lines, FollowLines)

// Average the rays of each of some pixels.
struct AverageRays {
    // [n * num_rays, 4]: premultiplied RGBA of the rays, pixel by pixel.
    Sized<const float, 2, 4> rays;
    // The number of rays of a pixel.
    int64_t num_rays;
    // [n]: row-major numbers of the pixels in the image.
    Array<const int64_t, 1> pixels;
    // The rays of a pixel differ if a channel varies among them by more than this.
    float threshold;
    // As in RefineRows.
    bool is_linear;
    // [h * w, 4]: the picture, in which the pixels get the means of their rays.
    Sized<float, 2, 4> image;
    // [n]: whether the rays of a pixel differ.
    Array<bool, 1> differ;
};
KERNEL(average_rays, AverageRays)

// A grid of rays into which bricks are drawn, in tiles (renderer/draw/bricks/grid.py).
struct Grid {
    // The side of a tile, in rays; a multiple of `rays_across`.
    int64_t side;
    // The pixels of the grid are every `stride`-th pixel of the picture along both axes, from pixel 0 on.
    int64_t stride;
    // The number of rays along each side of a pixel.
    int64_t rays_across;
    // Whether the only ray of a pixel passes through a random place in it, and not through its middle.
    bool is_scattered;
    // The row of the picture that is the first row of the grid.
    int64_t first_row;
    // The number of rows and of columns of pixels.
    int64_t shape[2];
    // [n, 4]: left, top, right and bottom of each brick, half-open, counted in rays of the grid and clipped to it.
    Sized<const int64_t, 2, 4> rectangles;
    // [tiles + 1]: the bricks over tile k are `numbers[starts[k] : starts[k + 1]]`.
    Array<const int64_t, 1> starts;
    // The numbers of the bricks over tiles, tile by tile, in draw order.
    Array<const int64_t, 1> numbers;
    // [rows, columns]: the index in `rays` of each pixel's first ray, or -1 if the pixel is not drawn; None if pixel k
    // has ray k alone.
    Maybe<Array<const int32_t, 2>> places;
    // [rays, 4]: premultiplied RGBA of the rays, or other amounts that they gather.
    Sized<float, 2, 4> rays;
};

// The coefficients of a light, as in ShadingSpec (renderer/scene/shading_section.py).
struct Shading {
    float ambient;
    float diffuse;
    float specular;
    float shininess;
    float silhouette;
    bool two_sided;
};

// The light on a layer and factors on its extinction, if these depend on the view or on the gradient's length.
struct Light {
    Shading shading;
    // The share of the light that reaches each position.
    LightGrid grid;
    // Whether the light comes from the viewer, and not from `toward`.
    bool is_camera;
    // The unit vector towards the light, in world axes; unused if the light comes from the viewer.
    float toward[3];
    // [3, 3]: the matrix from directions in index space to the world, up to a common factor.
    float world_from_index[9];
    // [n, 3]: the length of a gradient between texels, the factor on extinction at this length, and the slope of the
    // factor up to the next row's length.
    Sized<const float, 2, 3> factors;
    // The position of the volume's centre in `grid` (x, y, z), in cells.
    double first_cell[3];
    // The change over the finest spacing, in texels, along a gradient of the length 1 between texels; of labels, in
    // smoothed opacities.
    float change_per_length;
};

// The mask that limits where a field is drawn: a volume of labels.
struct FieldMask {
    // The mask's grid, for positions relative to the centre of the field's volume.
    MaskGrid grid;
    // [bricks]: whether a part of a brick is outside the mask.
    Array<const bool, 1> are_cut;
};

// The texels of bricks in an atlas. Missing texels of bricks of voxels are made when a ray first meets their brick
// (atlas.h).
struct AtlasTexels {
    // For each brick of voxels, PADDED_BRICK_SIZE^3 texels; if the layer is lit, PADDED_BRICK_SIZE^3 gradients (x, y, z)
    // follow them. If voxels are colours, each texel is (tau c, tau). If texels are voxels, it has their bytes.
    Array<float, 1> texels;
    // [bricks]: the position of each brick's first texel in its atlas; -1 for a brick that shows nothing, -2 for one
    // whose texels are missing. Kernels write the positions of the texels that they make.
    Array<int64_t, 1> offsets;
    // The rules by which texels are made; None if kernels do not make them.
    Maybe<TexelRules> rules;
    // [bricks, 3]: the place (x, y, z) of each brick, in widths of a brick.
    Sized<const int32_t, 2, 3> cells;
    // [n]: the positions in `texels` for missing bricks, which are taken in this order. There may be fewer than bricks.
    Array<const int64_t, 1> free;
    // [1]: the number of positions of `free` that are taken; more than there are if a brick found none.
    Array<int64_t, 1> num_taken;
    // [bricks]: whether a ray has met each brick. Kernels set it.
    Array<bool, 1> are_met;
};

// The field of a layer: the texels of all bricks, in two atlases, and the table that classifies them.
struct Field {
    // The texels of bricks of voxels, and the offsets of all bricks, each in its atlas.
    AtlasTexels voxels;
    // For each brick of means, PADDED_BRICK_SIZE^3 texels (tau c, tau).
    Array<const float, 1> means;
    PiecewiseTransfer pieces;
    // A factor on the layer's extinction.
    float weight;
    // The unit vector towards the light (x, y, z), the ambient and the diffuse coefficient; used if `is_lit`.
    float lambert[5];
    // Whether the volume has voxels without data.
    bool has_absent;
    // Whether the scalars are numbers of labels.
    bool is_labels;
    // Whether voxels are colours.
    bool has_colors;
    // Whether the light follows Lambert's law alone, from a fixed direction.
    bool is_lit;
    // Whether faces that clipping cuts are lit by their own normals.
    bool lights_faces;
    // The light; None without a light, or if `lambert` is all of it.
    Maybe<Light> light;
    // The mask that limits the field; None without a mask.
    Maybe<FieldMask> mask;
};

// The light on surfaces, as in SurfaceLight (renderer/lighting/scene_light.py).
struct SurfaceCells {
    // The share of light that a surface reflects, from 0 to 1; the remainder is scattered.
    float share;
    // The coefficient and the exponent of highlights.
    float specular;
    float shininess;
    // The unit vector to the middle of the key light, in world axes.
    float key[3];
    // [rgb]: the irradiance of the key light, divided by pi.
    float key_light[3];
};

// The mean radiance in matter that scatters light, on a grid over all layers (renderer/lighting/scene_light.py).
struct RadianceCells {
    // [z, y, x, 4]: the mean radiance (r, g, b) at the middles of cells, and the share of the key light that arrives
    // straight. With surfaces [z, y, x, 16]: then the flux along x (r, g, b), y and z, and three numbers more.
    Array<const float, 4> cells;
    // The light on surfaces; None if no surface reflects light. Otherwise fields have a light of the viewer, for their
    // gradients.
    Maybe<SurfaceCells> surface;
    // [3, 4]: the matrix from positions in index space, relative to the centre of the layers' volume, to cells. The
    // middle of cell i is at i.
    double cells_from_index[12];
};

// The fog in a grid of voxels: the share of its colour, which is linear in the depth (renderer/view/camera.py).
struct FogRamp {
    // [rgb]: the colour of the fog.
    float color[3];
    // The share at the centre of the volume, not limited to numbers from 0 to 1.
    double share;
    // The change of the share per voxel along x, y and z.
    double per_index[3];
};

// The bricks of layers on one grid of voxels.
struct LayerBricks {
    RaySetup rays;
    // The number of finest voxel spacings in a model unit.
    float spacings_per_model_unit;
    // [bricks, 11]: the boxes of bricks, as in BrickView (renderer/draw/bricks/brick_cache.py).
    Sized<const double, 2, 11> boxes;
    // [bricks]: whether the texels of a brick are means. The first field holds the means of all layers, with the
    // layers' weights.
    Array<const bool, 1> is_mean;
    // [bricks]: whether a brick is near a face that clipping cuts.
    Array<const bool, 1> have_faces;
    // Points up to this distance from a face that clipping cuts, in units of the world, are lit by the face's normal.
    double face_depth;
    // The light by which colours are multiplied, which are then albedos; None if matter does not scatter light.
    Maybe<RadianceCells> radiance;
    // The fog; None without fog.
    Maybe<FogRamp> fog;
    // One field for each layer.
    Array<const Field, 1> fields;
};

// Composite bricks in some tiles of the image, or add up their light if nothing is absorbed.
struct DrawTiles {
    Grid grid;
    LayerBricks bricks;
    // The alpha beyond which a ray ends.
    float termination_alpha;
    // Whether light adds up and nothing is absorbed; the alpha of rays is then their optical depth.
    bool is_additive;
    // The numbers of the tiles to draw.
    EACH_CALL Array<const int64_t, 1> tiles;
};
LONG_KERNEL(draw_tiles, DrawTiles)

// Composite the bricks of several volumes into some tiles of the image, mixed at every point.
struct DrawMixture {
    Grid grid;
    // The bricks of the layers on each grid of voxels.
    Array<const LayerBricks, 1> groups;
    // [n, 2]: the bricks, as in Mixture (renderer/draw/bricks/mixture.py).
    Sized<const int64_t, 2, 2> members;
    // [n, 3]: the depths of the bricks, as in Mixture.
    Sized<const double, 2, 3> depths;
    // The alpha beyond which a ray ends.
    float termination_alpha;
    // The numbers of the tiles to draw.
    EACH_CALL Array<const int64_t, 1> tiles;
};
LONG_KERNEL(draw_mixture, DrawMixture)

// The rules of a search for the most extreme scalar, which are the same in all bricks.
//
// A texel u stands for the number `offset + slope * u`, whose maximum is sought: 0 for a scalar that shows nothing,
// and 1 at the other end of the colour range.
struct SearchRules {
    // The number of texel 0.
    float offset;
    // The change of the number with the texel; below 0 to find the smallest scalar.
    float slope;
    // A brick or a cell is searched only if its bound exceeds the largest number so far by more than this.
    float slack;
    // A number replaces the largest number so far only if it exceeds it by more than this.
    float min_rise;
    // The number from which on a ray ends, as it needs no larger one.
    float ceiling;
    // Whether bricks come in the order of falling bounds; otherwise they come front to back.
    bool is_sorted;
    // Whether the volume has voxels without data.
    bool has_absent;
    // The change of nearness over a step along each index axis; zeros if depth does not count. Nearness falls from 1 to
    // 0 through the ball around the volume.
    double forward[3];
};

// Find the most extreme scalar along the rays of some tiles of the image.
struct DrawExtremes {
    Grid grid;
    RaySetup rays;
    // [bricks, 11]: the boxes of bricks, as in BrickView (renderer/draw/bricks/brick_cache.py).
    Sized<const double, 2, 11> boxes;
    // The numbers of the tiles to draw.
    EACH_CALL Array<const int64_t, 1> tiles;
    // [bricks]: an upper bound of the numbers in each brick.
    Array<const double, 1> tops;
    // The texels of all bricks: scalars.
    AtlasTexels voxels;
    SearchRules rules;
};
LONG_KERNEL(draw_extremes, DrawExtremes)
