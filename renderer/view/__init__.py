"""The camera, its path, and what it sees in which order.

In: `CameraSpec`, and world positions of what is visible. Out: a `View` for each frame, framed so that nothing is
clipped; the order of the splats or bricks that it sees, and their place on the image.

- `camera.py`: the view of one frame. `paths.py`: turntables, rockers and keyframes. `framing.py`: the camera distance
  at which all that is visible is in the image.
- `splat_projection.py` culls and sorts splats; `order_blending.py` blends depth orders while a film turns.
- `brick_projection.py` culls bricks, finds their rectangles on the image, and sets up the rays that meet them.
- `visibility.py`: orders by depth, and of the octree's nodes as boxes (Laur and Hanrahan 1991).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
