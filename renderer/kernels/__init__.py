"""Kernels: loops in C++, compiled before they are installed, for each level of processors.

In: arrays and numbers. Out: the same arrays, filled. Kernels run without the interpreter's lock.

- `binding.py`: `kernels()`, whose attributes are the kernels.
- `header.py`: reads the structs that kernels take from the files `kernels.h` of `sources/`.
- `records.py`: records of the structs that are members of others; `signatures.pyi`: the parameters of each kernel, for
  mypy. Both are made from the headers.
- `library.py`: the library for this processor, found, verified and loaded.
- `build.py`: compiles the libraries.
- `bus_errors.py`: reads of mapped files that have become shorter give zeros.
- `threads.py`: a pool of threads, on which kernels run side by side.
- `sources/`: a folder for the kernels of each room, and `base/`, which all use: arrays, vectors of lanes, exponentials,
  the flag that stops long kernels. `kernels.h` in each folder declares the structs that its kernels take. `truth/`
  shares no code with the kernels that it checks.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
