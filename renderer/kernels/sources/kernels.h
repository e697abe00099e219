// What kernels take: the one place where both languages read it.
//
// Python reads this file, too (binding.py), and fills each struct by the names of its members, from a NamedTuple, a
// dictionary or keyword arguments. It knows these types of members, and refuses a file with others:
//
//     int64_t, float, double, bool, ...   a number
//     double x[3]                         a sequence of three numbers, or an array of that size
//     Array<const float, 2>               an array of that dtype and number of dimensions, contiguous; without `const`
//                                         it must be writeable, too
//     Sized<const float, 3, 5, 4>         the same of 3 dimensions, of which the last have sizes 5 and 4
//     AnyArray<3>                         an array of any dtype, contiguous, read only
//     Struct                              one that is defined above
//     Array<const Struct, 1>              a sequence of what such structs are filled from
//     Maybe<any of these but numbers>     the same, or None
//
// Members of one type may share a line. KERNEL(name, Struct) declares a kernel that takes a Struct; LONG_KERNEL one that
// may take longer than a tenth of a second, and stops when it is asked to (stopping.h). Rooms are in the order of
// docs/architecture.md.
#pragma once
#include "arrays.h"

#ifndef KERNEL
#define KERNEL(name, Arguments) \
    extern "C" __attribute__((visibility("default"))) Status name(const Arguments* arguments);
#endif
#define LONG_KERNEL KERNEL

// ---- kernels

struct GuardRegions {
    Sized<int64_t, 2, 4> regions;
    int64_t page_size;
};
KERNEL(guard_regions, GuardRegions)

struct HeedFlag {
    Array<const int32_t, 1> flag;
};
KERNEL(heed_flag, HeedFlag)

// ---- volume

// As in renderer/volume/mask.py. from_index: rows of a matrix of 3 x 4.
struct MaskGrid {
    Array<const uint16_t, 3> planes;
    double from_index[12];
};

struct MarkVoxels {
    MaskGrid mask;
    Array<uint8_t, 3> out;
};
KERNEL(mark_voxels, MarkVoxels)

// ---- transfer

// As in renderer/transfer/piecewise.py.
struct TransferTable {
    Array<const double, 1> values;
    Array<const double, 2> rows;
    double scale;
    Array<const uint64_t, 1> guide;
    double buckets_per_unit;
};

// As in renderer/transfer/light_factors.py.
struct LightGrid {
    Array<const float, 3> occlusion, shadow;
    Array<const int32_t, 1> corners;
    double cell_size, occlusion_strength, shadow_strength;
};

// As in renderer/transfer/classify.py, and the next one.
struct VoxelLighting {
    double light[5], world_from_gradient[9];
    LightGrid grid;
};

struct Classifier {
    Maybe<Array<const float, 2>> table;
    Maybe<Array<const double, 1>> scalars;
    Maybe<TransferTable> curve;
    bool is_opacity;
    Maybe<VoxelLighting> lighting;
    Array<const double, 1> breakpoints;
    Maybe<Sized<const uint8_t, 4, 3>> colors;
    Maybe<Array<const uint8_t, 3>> shown;
};

// As in renderer/transfer/piecewise.py.
struct PiecewiseTransfer {
    Array<const float, 2> rows;
    Array<const int32_t, 1> guide;
    float lowest_visible;
};

// ---- pyramid

// As in renderer/pyramid/nodes.py.
struct VisibleNodes {
    Array<float, 2> means;
    Array<float, 1> deviations;
    Array<uint8_t, 1> masks;
    Array<int32_t, 2> cells;
    Array<int64_t, 1> sizes, counts;
    Array<float, 2> root_means;
    Array<double, 2> root_error_means, root_variances;
};

struct BuildBlocks {
    AnyArray<3> raw;
    Classifier classifier;
    Maybe<Classifier> error_classifier;
    Maybe<Array<const double, 1>> normalization;
    double leaf_variance_limits[2];
    Array<bool, 3> occupied;
    int64_t occupied_level;
    Array<const int64_t, 2> starts, extents;
    Array<bool, 1> visible;
    VisibleNodes nodes;
};
LONG_KERNEL(build_blocks, BuildBlocks)

struct MergeTier {
    Array<const float, 2> means;
    Array<const double, 2> error_means, variances;
    Array<const int64_t, 1> places;
    Array<const int64_t, 2> extents;
    int64_t side;
    VisibleNodes nodes;
};
KERNEL(merge_tier, MergeTier)

struct AverageCells {
    AnyArray<3> raw;
    Classifier classifier;
    int64_t level;
    Array<const int64_t, 2> corners;
    Array<float, 5> means;
};
KERNEL(average_cells, AverageCells)

struct StoreFloat16 {
    Array<const float, 1> values;
    float factor;
    Array<uint16_t, 1> out;
};
KERNEL(store_float16, StoreFloat16)

struct ListChildren {
    Array<const int64_t, 1> nodes, first_children;
    Array<const int32_t, 2> cells;
    Array<const uint8_t, 1> masks;
    Array<int64_t, 1> child_nodes;
    Array<int32_t, 2> child_cells;
};
KERNEL(list_children, ListChildren)

struct FindVoxels {
    AnyArray<3> raw;
    Classifier classifier;
    Array<const int32_t, 2> parents;
    Array<uint8_t, 1> counts;
    Array<int32_t, 2> cells;
    Array<float, 2> depths;
};
KERNEL(find_voxels, FindVoxels)

// ---- lighting

struct AverageVoxels {
    AnyArray<3> raw;
    Maybe<Array<const float, 1>> by_pattern;
    Maybe<TransferTable> curve;
    int64_t level, slab;
    Array<float, 2> out;
};
LONG_KERNEL(average_voxels, AverageVoxels)

struct Transmit {
    Array<const float, 3> depths, offsets;
    Array<const bool, 3> filled;
    Array<const float, 1> lengths;
    float end[3];
    int64_t slab;
    Array<float, 2> out;
};
LONG_KERNEL(transmit, Transmit)

// ---- splats

struct PlaceSplats {
    Array<const uint8_t, 1> levels, shapes;
    Sized<const int32_t, 2, 3> cells;
    Sized<const float, 2, 4> depths;
    Sized<const double, 2, 3> shift_of_shape;
    Array<const double, 1> area_of_shape;
    double model_from_index[9];
    Sized<float, 2, 8> vertices;
};
KERNEL(place_splats, PlaceSplats)

// ---- bricks

// As in renderer/bricks/layout.py.
struct Voxels {
    AnyArray<3> raw;
    Maybe<Array<const double, 1>> scalars;
    bool has_absent, is_labels;
};

struct MeasureVoxelBricks {
    Voxels voxels;
    Array<const int32_t, 2> cells;
    Array<const double, 1> breakpoints;
    TransferTable curve;
    Maybe<Array<const uint8_t, 3>> shown;
    bool are_lit;
    Maybe<Array<const float, 5>> texels;
    Array<float, 5> bounds;
    Array<double, 4> measures;
};
LONG_KERNEL(measure_voxel_bricks, MeasureVoxelBricks)

struct MeasureRanges {
    Voxels voxels;
    Array<const int32_t, 2> cells;
    Array<double, 2> ranges;
};
KERNEL(measure_ranges, MeasureRanges)

struct AddNodes {
    Array<const int32_t, 2> cells;
    Array<const int64_t, 1> sizes;
    Array<const double, 1> errors;
    Array<const bool, 1> is_visible;
    Array<double, 6> max_error_by_neighbour;
    Array<uint8_t, 8> bounds_by_neighbour;
    Array<double, 3> max_error_below, squared_errors_below;
};
KERNEL(add_nodes, AddNodes)

struct FillScalarTexels {
    Voxels voxels;
    Array<const int32_t, 2> cells;
    double first, width, factor, world_from_gradient[9], scale, toward_light[3];
    Array<const double, 1> opacities;
    Array<float, 2> texels;
};
KERNEL(fill_scalar_texels, FillScalarTexels)

struct ExtrapolateBorder {
    Array<const int32_t, 2> cells;
    double extents[3], brightest;
    Array<float, 5> texels;
};
KERNEL(extrapolate_border, ExtrapolateBorder)

// ---- view

// As in renderer/view/clip_slabs.py.
struct ClipRegion {
    Sized<const double, 2, 8> slabs;
    Sized<const double, 3, 3, 8> boxes;
};

// As in renderer/view/brick_projection.py.
struct RaySetup {
    double origins[9], directions[9], slope_per_px, start, center_px[2];
    Maybe<ClipRegion> clip;
};

// As in renderer/view/splat_projection.py.
struct ModelView {
    double view_from_model[12];
    bool perspective;
    double scale_px;
    int64_t size[2];
    double near, slope_limit[2];
};

struct ProjectBounds {
    Sized<const double, 3, 2, 3> bounds;
    ModelView camera;
    int64_t beyond;
    Sized<double, 2, 4> rectangles;
};
KERNEL(project_bounds, ProjectBounds)

struct CullSplats {
    Sized<const float, 2, 8> vertices;
    Array<const double, 1> sigmas;
    double cutoff, min_sigma_px, clipped_sigmas, culled_sigmas;
    ModelView camera;
    double along[3];
    Array<float, 1> depths;
    Array<bool, 1> is_visible;
};
KERNEL(cull_splats, CullSplats)

struct DepthOrder {
    Array<const float, 1> depths;
    Array<uint32_t, 1> order;
};
KERNEL(depth_order, DepthOrder)

struct BoxOrder {
    Array<const uint8_t, 1> levels;
    Sized<const int32_t, 2, 3> cells;
    double eye[3];
    int64_t shape[3];
    Array<uint32_t, 1> order;
};
KERNEL(box_order, BoxOrder)

// ---- modes

struct MeasureChords {
    RaySetup rays;
    int64_t shape[3], first_row;
    Maybe<Array<const bool, 3>> absent;
    double unit;
    Array<float, 2> lengths;
};
LONG_KERNEL(measure_chords, MeasureChords)

struct ColorShares {
    TransferTable curve;
    Array<const float, 2> shares, chords;
    Sized<const float, 3, 1> brightness;
    Sized<float, 3, 4> image;
};
KERNEL(color_shares, ColorShares)

// ---- draw

struct BinBricks {
    Sized<const int64_t, 2, 4> tile_windows;
    int64_t num_columns, num_rows;
    Array<int64_t, 1> starts, numbers;
};
KERNEL(bin_bricks, BinBricks)

// As in renderer/draw/subsampling.py. factor: every which pixel of the image the grid has.
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
    Array<int32_t, 2> places;
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

// vertices, voxel_side: as in Lines. colors: [n, 4], by level. Others: constants of renderer/draw/cpu/lines.py.
struct DrawLines {
    Sized<const float, 2, 7> vertices;
    double voxel_side;
    Sized<const double, 2, 4> colors;
    ModelView camera;
    double cover, opacity, min_side_px;
    Sized<float, 3, 4> image;
};
KERNEL(draw_lines, DrawLines)

struct MarkContrasts {
    Sized<const float, 3, 4> image;
    float threshold;
    int64_t first_row, end_row;
    Array<bool, 2> is_marked;
};
KERNEL(mark_contrasts, MarkContrasts)

struct AverageRays {
    Sized<const float, 2, 4> rays;
    int64_t num_rays;
    Array<const int64_t, 1> pixels;
    float threshold;
    Sized<float, 2, 4> image;
    Array<bool, 1> differ;
};
KERNEL(average_rays, AverageRays)

// As in the files of renderer/draw/cpu/, and so are those that follow it.
struct Grid {
    int64_t side;
    int64_t stride;
    int64_t rays_across;
    Sized<const int64_t, 2, 4> rectangles;
    Array<const int64_t, 1> starts, numbers;
    Array<const int32_t, 2> places;
    Sized<float, 2, 4> rays;
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

// As in renderer/draw/cpu/mixture.py.
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

// ---- film

struct Quantize {
    Sized<const float, 3, 4> image;
    Sized<const float, 2, 3> background;  // of each row
    Array<uint8_t, 3> result;
};
KERNEL(quantize, Quantize)

// ---- truth

// As in renderer/truth/optics.py, and the next one.
struct Intervals {
    Array<const double, 1> knots;
    Array<const double, 2> rows;
    double scale;
};

struct RayShading {
    bool is_plain, is_camera, two_sided;
    double ambient, diffuse, specular, shininess, silhouette, face_depth;
    double light[3], world_from_index[9], world_from_gradient[9];
    Array<const double, 2> factors;
    LightGrid grid;
};

// As in renderer/truth/kept_parts.py.
struct RemovedSet {
    double own_from_index[12], world_from_own[9], low[3], high[3];
};

// n rays in index space, as in renderer/truth/integrator.py.
struct IndexRays {
    Array<const double, 2> origins, directions;
    Array<const double, 3> parts;
    Array<const RemovedSet, 1> removed;
};

// As `optics_of` there. macrocells: what is known of each; zeros at first, and updated. label_opacities: of labels
// alone, that of a voxel, by number; numbers above have the last one.
struct LayerOptics {
    AnyArray<3> values;
    Array<uint8_t, 3> macrocells;
    Intervals intervals;
    Maybe<RayShading> shading;
    double weight;
    Maybe<Sized<const uint8_t, 4, 3>> colors;
    Maybe<Array<const double, 1>> label_opacities;
};

// rays: of each layer. adds: whether what is behind is seen as if nothing were before it.
struct IntegrateRays {
    Array<const LayerOptics, 1> layers;
    Array<const IndexRays, 1> rays;
    bool adds;
    Array<const double, 1> max_steps;
    Array<double, 3> radiance;
};
LONG_KERNEL(integrate_rays, IntegrateRays)

struct MaskRays {
    LayerOptics layer;
    IndexRays rays;
    Array<double, 3> parts;
    Array<int64_t, 1> counts;
};
LONG_KERNEL(mask_rays, MaskRays)

struct SearchRays {
    AnyArray<3> values;
    Array<double, 3> tops;
    double sign, least_rise;
    IndexRays rays;
    Array<double, 2> found;
};
LONG_KERNEL(search_rays, SearchRays)
