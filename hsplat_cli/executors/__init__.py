"""Draws the frames of a film: in this process, with workers on this machine, or on a cluster.

In: a plan and frame numbers. Out: `FrameResult`s in order, the same bytes from every executor. `open_executor` is the
entrance.

- `executor.py`: `open_executor`; `options.py`: `--workers` and `--scheduler`; `schedule.py`: frames that are drawn
  ahead, in order.
- `frame_result.py`: a drawn frame, and how this process draws it.
- `workers/`: processes of this machine: `pool.py`, `process.py` (one worker; whether it hangs), `worker.py` (its
  program), `shared_stage.py` (memory for all).
- `cluster/`: Dask: `cluster_executor.py`, `connection.py`, `local_cluster.py` (of this machine, with TLS),
  `registry.py` (workers come and go), `worker.py`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
