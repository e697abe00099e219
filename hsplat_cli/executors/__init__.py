"""Draws the frames of a film: in this process, with workers on this machine, or on a cluster.

In: a plan and frame numbers. Out: `FrameResult`s in order, the same bytes from every executor. `open_executor` is the
entrance; `schedule.py` decides which worker draws which frame, for `workers/` and `cluster/` alike.

- `executor.py`: `open_executor`; `options.py`: `--workers` and `--scheduler`; `schedule.py`: who draws which frame.
- `frame_result.py`: a drawn frame, and the executor of this process; `rasterizers.py`: opens OpenGL or the CPU's loops.
- `workers/`: processes of this machine: `pool.py`, `process.py` (one worker; whether it hangs), `worker.py` (its
  program), `shared_stage.py` (memory for all), `child_processes.py` (none outlives its parent).
- `cluster/`: Dask: `cluster_executor.py`, `connection.py`, `registry.py` (workers come and go), `worker.py`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
