// Functions of float64 whose results depend on no C library.
#pragma once
#include "arrays.h"

#include <stdint.h>

INLINE double exp_of(double x) { return __builtin_exp(x); }
INLINE double expm1_of(double x) { return __builtin_expm1(x); }
INLINE double power_of(double x, double y) { return __builtin_pow(x, y); }
