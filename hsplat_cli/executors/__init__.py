"""Draws the frames of a film: in this process, or in several by Dask, on this machine or on a cluster.

In: a plan and frame numbers. Out: drawn frames in order, the same bytes from every executor. `open_executor` is the
entrance; it opens an `Executor` of `renderer.job`.

- `executor.py`: `open_executor` and the executors that use Dask; `options.py`: `--workers` and `--scheduler`.
- `cluster/`: Dask: `cluster_drawing.py` (frames are drawn ahead, and come in order), `connection.py`, `registry.py`
  (workers come and go), `worker.py`, `local_cluster.py` and `local_worker.py` (processes of this machine, with TLS),
  `silence.py` (no log of libraries).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
