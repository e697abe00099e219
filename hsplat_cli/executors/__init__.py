"""Draws the frames of a film: in this process, with workers on this machine, or on a cluster.

In: a plan and frame numbers. Out: `FrameResult`s in order, the same bytes from every executor. `open_executor` is the
entrance; `schedule.py` decides which worker draws which frame, for `workers/` and `cluster/` alike.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
