"""Draws the frames of a film: in this process, or on a Dask cluster.

In: a plan and frame numbers. Out: drawn frames in order, the same bytes from every executor. `open_executor` is the
entrance; it opens an `Executor` of `renderer.job`.

- `scheduler.py`: `open_executor` and the executor that uses Dask; `drawing_options.py`: `--scheduler` and `--memory`.
- `cluster/`: Dask: `cluster_drawing.py` (frames are drawn ahead, and come in order), `connection.py`, `registry.py`
  (workers come and go), `worker.py`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
