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

// ---- kernels

struct GuardRegions {
    Array<int64_t, 2> regions;
    int64_t page_size;
};
KERNEL(guard_regions, GuardRegions)

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
