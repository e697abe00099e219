// The size of what each kernel takes, by which Python checks that both languages lay structs out alike.
#define KERNEL(name, Arguments) \
    extern "C" __attribute__((visibility("default"))) const int64_t name##_bytes = sizeof(Arguments);
#include "kernels.h"
