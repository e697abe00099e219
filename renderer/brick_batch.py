"""Bricks as a rasteriser takes them, before any view is chosen: boxes, steps, and what may be spared at a tolerance.

What both rasterisers draw. The ray through a pixel's centre meets a brick's box from t0 to t1, world lengths, near
plane considered. In index space, in cells of the brick, that way is L long, and is cut into
`n = max(1, ceil(L / step))` equal parts of the world length h. In the middle of each the field is looked up, linear
between the centres of cells:

    level 0     u, a scalar; then (tau c, tau) = table(u), linear between its entries; with light, c times the factor
                of the interpolated gradient
    above       (tau c, tau), divided by the finest spacing

and a part has the alpha `1 - exp(-tau h)` and the colour `tau c / tau`. Parts, and bricks, are composited front to
back.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from renderer.bricks import BrickCut, Bricks
from renderer.scene import ShadingSpec

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Thrift:
    """What a picture need not be exact in.

    strides: falling, from which lattices of pixels the picture is made: on the first, every so manieth pixel along both
        axes is drawn. On each that follows only those blocks between four nodes of the one before are drawn whose nodes
        differ; the others are interpolated (bilinear), as are pixels between the nodes of the last lattice. (1,) draws
        every pixel.
    spread: four nodes differ where any channel (premultiplied RGBA) differs by more than this among them.
    least_transmittance: what lies behind less than this is not drawn.
    """

    strides: tuple[int, ...]
    spread: float
    least_transmittance: float


@dataclass(frozen=True)
class BrickBatch:
    """Boxes in the order of their cut.

    steps: float64 [n], the longest step in cells of the brick.
    table: float32 [k, 4], (tau c, tau), 1 / world unit, evenly spaced; texel 0 is the first entry, texel 1 the last.
    origin: float64 [3], world position of the model's origin, the volume's centre. length: world units in a model unit.
    """

    cut: BrickCut
    bricks: Bricks
    steps: Float64
    table: npt.NDArray[np.float32]
    shading: ShadingSpec | None
    thrift: Thrift
    origin: Float64
    length: float

    def __len__(self) -> int:
        return len(self.cut)
