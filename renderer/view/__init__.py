"""The camera, its path, and what it sees in which order.

In: `CameraSpec`, and world positions of what is visible. Out: a `View` for each frame, framed so that nothing is
clipped; the order of the splats or bricks that it sees, and their place on the image.

- `camera.py`: the view of one frame. `paths.py`: turntables, rockers (back and forth) and keyframes; `flights.py`: eyes
  that fly along a curve. `framing.py`: the camera distance at which all that is visible is in the image; `seen.py`:
  which of it decides that.
- `splat_projection.py` leaves out the splats that a view does not see, and sorts the others. `order_blending.py`:
  splats are drawn in several orders, and blended, while a turning camera passes from one to the other.
- `brick_projection.py`: the bricks that a view sees, their rectangles on the image, and the rays that meet them.
- `clip_slabs.py`: the scene's clip planes and boxes where the rays of bricks are.
- `depth_order.py`: back to front, of points by depth and of octree nodes as boxes (Laur and Hanrahan 1991).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
