// Tell long kernels to stop when the process is asked to end.
//
// Python runs signal handlers in the main thread, while long kernels run on other threads. The handler sets a flag.
// Kernels that may take longer than a tenth of a second (LONG_KERNEL in kernels.h) watch the flag. Once it is set, they
// return STOPPED, with unfinished arrays.
#pragma once
#include "base/arrays.h"

extern const int32_t* stop_flag;

// Return whether long kernels are asked to stop. Python may set the flag at any time.
INLINE bool is_stopped() { return __atomic_load_n(stop_flag, __ATOMIC_RELAXED) != 0; }
