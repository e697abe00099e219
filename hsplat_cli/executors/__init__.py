"""Draws the frames of a film: in this process, or on a Dask cluster.

In: the plan of a film (its stage, and the tolerances of its frames) and frame numbers. Out: drawn frames in order, with
the same bytes from every executor. `open_executor` opens an `Executor` of `renderer.job`.

- `scheduler.py`: `open_executor` and the executor that uses Dask; `drawing_options.py`: `--scheduler` and `--memory`.
- `cluster/` uses Dask: `cluster_drawing.py` draws frames ahead and returns them in order, `connection.py` connects to
  the scheduler, `registry.py` keeps track of the workers, `worker.py` runs on them and gets the voxels once.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
