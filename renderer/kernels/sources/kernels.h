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

// ---- pyramid

// ---- lighting

// ---- splats

// ---- bricks

// ---- view

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

// ---- film

// ---- truth

// As in renderer/truth/optics.py.
struct Intervals {
    Array<const double, 1> knots;
    Array<const double, 2> rows;
    double scale;
};

// Of a LightField.
struct ArrivingLight {
    Array<const float, 3> occlusion;
    Array<const float, 3> shadow;
    double cell_size;
    double occlusion_strength;
    double shadow_strength;
};

// As in renderer/truth/optics.py.
struct Gloss {
    bool is_camera;
    bool is_two_sided;
    double specular;
    double shininess;
    double world_from_index[9];
    Array<const double, 2> factors;
    ArrivingLight field;
};

struct LambertShading {
    double ambient;
    double diffuse;
    double light[3];
    double world_from_index_gradient[9];
    Maybe<Gloss> gloss;
};

// n rays in index space, as in renderer/truth/integrator.py.
struct IndexRays {
    Array<const double, 2> origins;
    Array<const double, 2> directions;
    Array<const double, 3> parts;
};

struct IntegrateRays {
    AnyArray<3> values;
    Array<uint8_t, 3> macrocells;
    Intervals intervals;
    Maybe<LambertShading> shading;
    Array<const double, 1> max_steps;
    IndexRays rays;
    Array<double, 3> radiance;
};
KERNEL(integrate_rays, IntegrateRays)

struct SearchRays {
    AnyArray<3> values;
    Array<double, 3> tops;
    double sign;
    double least_rise;
    IndexRays rays;
    Array<double, 2> found;
};
KERNEL(search_rays, SearchRays)
