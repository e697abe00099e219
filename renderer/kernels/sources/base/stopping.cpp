// The flag that tells long kernels to stop (stopping.h).
#include "base/kernels.h"
#include "base/stopping.h"

namespace {

// The flag before Python gives one: kernels never stop.
const int32_t never = 0;

}  // namespace

const int32_t* stop_flag = &never;

// Set the flag that long kernels watch: from now on they stop if it is not 0.
Status heed_flag(const HeedFlag* arguments) {
    if (!has_shape(arguments->flag, 1)) return OUT_OF_BOUNDS;
    stop_flag = arguments->flag.data;
    return DONE;
}
