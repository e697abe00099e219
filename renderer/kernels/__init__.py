"""Kernels: loops in C++, which are compiled before they are installed, once for each level of processors.

In: arrays and numbers. Out: the same arrays, filled. The interpreter's lock is released while kernels run.

- `binding.py`: `kernels()`, whose attributes are the kernels.
- `header.py`: reads the structs that kernels take from the files `kernels.h` of `sources/`.
- `records.py`: a record for each struct that is a member of another struct; `signatures.pyi`: the parameters of each
  kernel, for mypy. Both files are made from the headers.
- `library.py`: finds, verifies and loads the library for this processor.
- `build.py`: compiles the libraries.
- `bus_errors.py`: makes reads beyond the end of a mapped file give zeros.
- `threads.py`: a pool of threads, on which kernels run side by side.
- `sources/`: a folder for the kernels of each room, and `base/`, which all of them use: arrays, vectors of lanes,
  exponentials, the flag that stops long kernels. `kernels.h` in each folder declares the structs that its kernels take.
  `truth/` shares no code with the kernels that it checks.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
