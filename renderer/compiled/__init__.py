"""Loops that numba compiles: the one room that uses numba's and llvmlite's private interfaces.

In: functions on arrays and numbers. Out: the same functions, compiled when they are first called, cached on disk,
without the interpreter's lock, and with arithmetic as it is written.

- `compiler.py`: `jit` and `inline`, the cache of compiled loops, `fma` and `prefetch`.
- `lanes.py`: vectors of 16, 8 or 4 lanes in compiled loops, with the operators of numbers.
- `threads.py`: a pool of threads for compiled loops.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
