"""A camera for one frame: where the eye is and how the world lands on pixels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

Float64 = npt.NDArray[np.float64]


@dataclass(frozen=True)
class View:
    """A right-handed camera that looks along -z of its view space, x to the right and y up; image row 0 is the top.

    view_from_world: float64 [4, 4], a rigid motion (no scale).
    projection: perspective or orthographic.
    scale_px: perspective: focal length in pixels; orthographic: pixels per world unit.
    size: (width, height) in pixels.
    near: world distance from the eye plane within which nothing is drawn, >= 0.

    A view-space point (x, y, z) lands on column `width / 2 + scale_px * x / w`, row `height / 2 - scale_px * y / w`, in
    pixels from the top left corner of the image, with w = -z in perspective and 1 otherwise.
    """

    view_from_world: Float64
    projection: Literal["perspective", "orthographic"]
    scale_px: float
    size: tuple[int, int]
    near: float = 0.0

    @property
    def eye(self) -> Float64:
        """float64 [3]: the eye in world coordinates (orthographic: a point on the eye plane)."""
        return np.asarray(-self.view_from_world[:3, :3].T @ self.view_from_world[:3, 3])

    @property
    def forward(self) -> Float64:
        """float64 [3]: unit viewing direction in world coordinates."""
        return -self.view_from_world[2, :3]
