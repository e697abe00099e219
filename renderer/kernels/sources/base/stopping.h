// Tell long kernels to stop when the process is asked to end.
//
// A signal handler of Python runs between two bytecodes of the main thread, and a kernel has none. The handler
// therefore sets a flag. Kernels that may take longer than a tenth of a second (LONG_KERNEL in kernels.h) watch it.
// Once it is set, they return STOPPED, with unfinished arrays.
#pragma once
#include "base/arrays.h"

extern const int32_t* stop_flag;

// Python may set the flag at any time.
INLINE bool is_stopped() { return __atomic_load_n(stop_flag, __ATOMIC_RELAXED) != 0; }
