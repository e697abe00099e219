"""The camera, its path, and what it sees in which order.

In: `CameraSpec`, the bounds of what is visible. Out: a `View` for each frame, framed so that nothing is clipped; the
splats and bricks that it sees, in order (Laur and Hanrahan 1991), with their place on the image (Zwicker et al. 2001).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
