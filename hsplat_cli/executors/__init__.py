"""Who draws a frame: this process, workers on this machine, or a cluster.

In: a plan and frame numbers. Out: drawn frames in order, from whichever executor; the same bytes from all.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
