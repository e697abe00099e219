// What kernels take: the one place where both languages read it. Each folder has the header of its kernels.
//
// Python reads these files, too (header.py), and fills each struct by the names of its members, from a NamedTuple, a
// dictionary or keyword arguments. It knows these types of members, and refuses a file with others:
//
//     int64_t, float, double, bool, ...   a number
//     double x[3]                         a sequence of three numbers, or an array of that size
//     Array<const float, 2>               an array of that dtype and number of dimensions, contiguous; without `const`
//                                         it must be writeable, too
//     Sized<const float, 3, 5, 4>         the same of 3 dimensions, of which the last have sizes 5 and 4
//     AnyArray<3>                         an array of any dtype, contiguous, read only
//     Struct                              one that is defined above, or in a header that is included
//     Array<const Struct, 1>              a sequence of what such structs are filled from
//     Maybe<any of these but numbers>     the same, or None
//
// Members of one type may share a line. KERNEL(name, Struct) declares a kernel that takes a Struct; LONG_KERNEL one that
// may take longer than a tenth of a second, and stops when it is asked to (stopping.h).
#pragma once
#include "base/arrays.h"

#ifndef KERNEL
#define KERNEL(name, Arguments) \
    extern "C" __attribute__((visibility("default"))) Status name(const Arguments* arguments);
#endif
#define LONG_KERNEL KERNEL

struct GuardRegions {
    Sized<int64_t, 2, 4> regions;
    int64_t page_size;
};
KERNEL(guard_regions, GuardRegions)

struct HeedFlag {
    Array<const int32_t, 1> flag;
};
KERNEL(heed_flag, HeedFlag)
