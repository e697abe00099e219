"""Loops that numba compiles: the one room that uses numba's and llvmlite's private interfaces.

In: functions on arrays and numbers. Out: the same, compiled when first called, without the interpreter's lock, cached.
Private interfaces do what public ones cannot: loops over lanes draw a frame in 1 / 3.2 of the time, where loops that
the compiler vectorises take 1 / 1.1 to 1 / 1.4 (docs/decisions/046); the cache survives damage, and edits of functions
that a loop calls (048).

- `numba_inside.py`: numba and its private parts, imported in one place.
- `compiler.py`: `jit`, `inline`, `fma` and `prefetch`.
- `kernel_cache.py`: the cache of compiled loops, whose folder is found when it is first needed.
- `lanes.py`: vectors of 16, 8 or 4 lanes in compiled loops, with the operators of numbers.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
