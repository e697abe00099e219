// Whether long kernels are to stop: the process was asked to end.
//
// A signal handler of Python runs between two bytecodes of the main thread, and a kernel has none. It sets a flag.
// Kernels that may take longer than a tenth of a second look at it (LONG_KERNEL in kernels.h). They then return STOPPED,
// and their arrays are unfinished.
#pragma once
#include "base/arrays.h"

extern const int32_t* stop_flag;

// Python sets the flag at any time.
INLINE bool is_stopped() { return __atomic_load_n(stop_flag, __ATOMIC_RELAXED) != 0; }
