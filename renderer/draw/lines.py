"""Draw lines over a picture.

A line is one pixel wide: its opacity falls linearly to 0 at one pixel from its centre, round at the ends.
"""

from __future__ import annotations

import numpy as np

from renderer.draw.overlay import Lines
from renderer.kernels import kernels
from renderer.transfer import linear_of_srgb
from renderer.view import View, model_view
from renderer.volume import Float32

# In perspective, the parts of lines nearer to the eye than this depth, in model units, are cut off: the projection
# divides by the depth.
MIN_LINE_DEPTH = 1e-5
# The opacity of a line is LINE_COVER * s * p, where the side of its cell is s model units and p pixels long. Up to 2 /
# s cells lie behind one another, and the lines of one sheet of cells cover about 2 / p of the image: with a fixed
# opacity, all lines together would be a fog. With this opacity, their sum is bounded for cells of any size.
LINE_COVER = 0.75
# The largest opacity that a line may have.
LINE_OPACITY = 0.8
# The edges of a cell are drawn only if its shortest side is at least this long, in pixels.
MIN_SIDE_PX = 3.0
# The colours of lines by level, the finest level first, the last colour for all coarser levels: from orange to blue in
# even steps of lightness (CIE L* 62 to 41) and hue, as saturated as sRGB allows. The contrast to black and to white is
# at least 3 (WCAG 2.2, 1.4.11, for graphics), except for level 0 on white, where it is 2.97.
LEVEL_COLORS = tuple(
    tuple(channel / 255 for channel in bytes.fromhex(color))
    for color in ("ed730c", "f95b30", "fe414c", "fb2767", "f01483", "dc1e9f", "be33b8", "9446cd", "5354dc", "055ebf")
)


def draw_lines(lines: Lines, view: View, image: Float32, *, is_linear: bool = False) -> None:
    """Draw lines over an image, each over the lines before it.

    image: float32 [height, width, 4], premultiplied RGBA, changed in place. is_linear: whether it is linear light.
    """
    colors = linear_of_srgb(LEVEL_COLORS) if is_linear else LEVEL_COLORS
    camera = model_view(lines, view)
    if camera.perspective:
        camera = camera._replace(near=max(camera.near, MIN_LINE_DEPTH))
    kernels().draw_lines(
        vertices=lines.vertices,
        voxel_side=lines.voxel_side,
        colors=np.insert(colors, 3, 1.0, axis=1),
        camera=camera,
        cover=LINE_COVER,
        opacity=LINE_OPACITY,
        min_side_px=MIN_SIDE_PX,
        image=image,
    )
