// The structs that kernels take, declared once for C++ and for Python. Each folder has the header of its kernels.
//
// Python reads these files, too (header.py), and fills each struct by the names of its members, from a record or from
// keyword arguments. `tests/support/kernel_records.py` writes Python's records and signatures from them, comments
// included. A member has its own line, below its comment. A header may only have these types of members:
//
//     int64_t, float, double, bool, ...   a number
//     int64_t x[3]                        a tuple of three integers
//     double x[3]                         an array of three numbers
//     Array<const float, 2>               an array of that dtype and number of dimensions, contiguous; without `const`
//                                         it must be writeable, too
//     Sized<const float, 3, 5, 4>         an array of 3 dimensions, the last two of which have sizes 5 and 4
//     AnyArray<3>                         an array of any dtype, contiguous, read only
//     Struct                              a struct that is defined above, or in an included header
//     Array<const Struct, 1>              a sequence of such records
//     Maybe<any of these but numbers>     a value of one of these types, or None
//
// KERNEL(name, Struct) declares a kernel that takes a Struct. LONG_KERNEL(name, Struct) declares a kernel that may take
// longer than a tenth of a second, and stops when the process is asked to end (stopping.h). Members marked EACH_CALL
// differ from call to call: in Python, `kernel.partial(...)` takes the members without the mark, and returns a function
// of the members with it.
#pragma once
#include "base/arrays.h"

#ifndef KERNEL
#define KERNEL(name, Arguments) \
    extern "C" __attribute__((visibility("default"))) Status name(const Arguments* arguments);
#endif
#define LONG_KERNEL KERNEL
#define EACH_CALL

// Install a handler of SIGBUS, which makes reads beyond the end of mapped files give zeros.
struct GuardRegions {
    // [n, 4]: the guarded regions, as `guarded_regions` returns them (renderer/kernels/bus_errors.py). The array stays
    // at its address while the process lives.
    Sized<int64_t, 2, 4> regions;
    // The size of a page of memory, in bytes.
    int64_t page_size;
};
KERNEL(guard_regions, GuardRegions)

// Tell long kernels which flag stops them.
struct HeedFlag {
    // [1]: the flag, 0 as long as kernels may run. The array stays at its address while the process lives.
    Array<const int32_t, 1> flag;
};
KERNEL(heed_flag, HeedFlag)
