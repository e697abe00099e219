// Export the size of each kernel's struct. Python compares it with its own, to check that both languages lay structs
// out alike.
#define KERNEL(name, Arguments) \
    extern "C" __attribute__((visibility("default"))) const int64_t name##_bytes = sizeof(Arguments);
#include "base/kernels.h"
#include "volume/kernels.h"
#include "transfer/kernels.h"
#include "pyramid/kernels.h"
#include "lighting/kernels.h"
#include "splats/kernels.h"
#include "bricks/kernels.h"
#include "view/kernels.h"
#include "modes/kernels.h"
#include "draw/kernels.h"
#include "film/kernels.h"
#include "truth/kernels.h"
