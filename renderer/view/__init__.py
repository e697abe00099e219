"""Place the camera on its path, and find the splats and bricks that it sees, in their order.

In: `CameraSpec`, and world positions of visible cells. Out: a `View` for each frame, at a distance at which all visible
cells are in the picture; the order of the splats or bricks that it sees, and their place on the image.

- `camera.py`: the view of one frame
- `paths.py`: camera paths: turntables, rockers (back and forth), keyframes and sequences of paths
- `key_light.py`: a key light that follows the camera
- `flights.py`: paths on which the eye flies along a curve
- `framing.py`: the camera distance at which all visible cells are in the image
- `seen.py`: the visible cells that decide how a volume is framed
- `splat_projection.py`: the splats that a view sees, sorted, and the pixels that they cover
- `order_blending.py`: several draw orders of splats, blended while a turning camera passes from one to the next
- `brick_projection.py`: the bricks that a view sees, their rectangles on the image, and the rays through them
- `clip_slabs.py`: the scene's clip planes and boxes in the index space of rays
- `depth_order.py`: splats sorted by depth, and bricks and octree cells sorted as boxes (Laur and Hanrahan 1991)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
