"""hsplat as a library: scalar volumes to pictures and films.

In: a scene file, a Scene or a numpy array [z, y, x]. Out: a frame, a film, or the exact picture, drawn in this process
to the same bytes as by the command `hsplat render`. `docs/api.md` has all of it, with examples.

- `api.py`: the functions of this door. `errors.py`: every error that a user sees. `printable.py`: text
  from outside, as it is shown.
- `jit.py` compiles loops and caches them; `lanes.py`: vectors in them; `threads.py`: a pool of threads for them;
  `cores.py`: how many processors this process may use; `memory.py`: how much memory is left for it. `runs.py`:
  consecutive numbers as ranges. `versions.py`: versions of what made an output. `child_processes.py`: processes that
  end with this one.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
