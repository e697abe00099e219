// Find the x86-64 level (1 to 4) that this processor and its operating system offer; 0 on other machines.
//
// This file becomes a library of its own, compiled for the lowest level, because it must run on every processor. It
// asks the processor itself, because zig's `__builtin_cpu_supports` always says no.
#if defined(__x86_64__)
#include <cpuid.h>

static unsigned saved_registers() {
    unsigned low, high;
    __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
    return low;
}

static bool has_all(unsigned features, unsigned wanted) {
    return (features & wanted) == wanted;
}

static int level() {
    unsigned a, b, c, d, e, extended;
    if (!__get_cpuid(1, &a, &b, &c, &d)) return 1;
    if (!has_all(c, bit_SSE3 | bit_SSSE3 | bit_CMPXCHG16B | bit_SSE4_1 | bit_SSE4_2 | bit_POPCNT)) return 1;
    if (!__get_cpuid(0x80000001, &a, &b, &extended, &d) || !has_all(extended, bit_LAHF_LM)) return 1;
    if (!has_all(c, bit_OSXSAVE | bit_AVX | bit_FMA | bit_F16C | bit_MOVBE)) return 2;
    if (!has_all(extended, bit_LZCNT) || !has_all(saved_registers(), 0x06)) return 2;
    if (!__get_cpuid_count(7, 0, &a, &e, &c, &d) || !has_all(e, bit_AVX2 | bit_BMI | bit_BMI2)) return 2;
    if (!has_all(e, bit_AVX512F | bit_AVX512BW | bit_AVX512CD | bit_AVX512DQ | bit_AVX512VL)) return 3;
    return has_all(saved_registers(), 0xe6) ? 4 : 3;
}
#else
static int level() {
    return 0;
}
#endif

extern "C" __attribute__((visibility("default"))) int processor_level() {
    return level();
}
