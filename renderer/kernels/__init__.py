"""Kernels: loops in C++, compiled before they are installed, for each level of processors.

In: arrays and numbers. Out: the same arrays, filled. Kernels run without the interpreter's lock.

- `binding.py`: `kernels()`, whose attributes are the kernels.
- `header.py`: what they take, read from `sources/kernels.h`.
- `library.py`: the library for this processor, found, verified and loaded.
- `build.py`: compiles the libraries.
- `bus_errors.py`: reads of mapped files that have become shorter give zeros.
- `threads.py`: a pool of threads, on which kernels run side by side.
- `sources/`: kernels.h, what kernels take; arrays.h and lanes.h, arrays and vectors; a file for each algorithm.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
