"""The camera, its path, and what it sees in which order.

In: `CameraSpec`, bounds of what is visible. Out: `View` for each frame, framed so that nothing is clipped; splats and
bricks projected into it (Zwicker et al. 2001), back to front or front to back.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
