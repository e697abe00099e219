"""Define the camera of one frame: the place of the eye, and the projection from the world to pixels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, NamedTuple

import numpy as np

from renderer.scene import ClipSpec
from renderer.volume import Float64


class Fog(NamedTuple):
    """The fog of a view: the share of a colour that matter shows in place of its own, by its depth.

    color: as the drawing calculates with colours: of linear light where the scene has `light`. begin, end: the depths
    from the target, along the viewing direction, where the share is 0 and 1.
    """

    color: tuple[float, float, float]
    begin: float
    end: float


@dataclass(frozen=True)
class View:
    """The camera of one frame, which looks along -z of its view space, with x to the right and y up.

    axes: float64 [3, 3], orthonormal; its rows are the view's x, y and z in the world: right, up, and backward.
    target: float64 [3], a world position on the optical axis. distance: the distance from the target to the eye, along
        the view's z.
    projection: perspective or orthographic.
    scale_px: the focal length in pixels (perspective), or pixels per world unit (orthographic).
    size: (width, height) of the image, in pixels; row 0 is the top.
    shift: how far the target is from the middle of the image: to the right as a share of the image's width, and up as a
        share of its height. The view does not turn; its frustum is off-centre.
    near: world distance from the eye plane within which nothing is drawn, >= 0.
    clip: the clip planes and boxes of the scene.
    fog: the fog of the scene; None without fog.

    A view-space point (x, y, z) projects to the column `center_px[0] + scale_px * x / w` and the row `center_px[1] -
    scale_px * y / w`, in pixels from the top left corner of the image, with w = -z in perspective and 1 otherwise.

    Target and distance are separate because their sum would be rounded: far from the world's origin, or from the
    volume, an eye in world coordinates has few digits, while the offset of a volume from the target beside it is exact.
    """

    axes: Float64
    target: Float64
    distance: float
    projection: Literal["perspective", "orthographic"]
    scale_px: float
    size: tuple[int, int]
    near: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    clip: tuple[ClipSpec, ...] = ()
    fog: Fog | None = None

    def view_from_world(self, points_world: Float64) -> Float64:
        """Return world positions, [..., 3], in view space, float64 [..., 3]. The target is subtracted first."""
        return np.asarray((points_world - self.target) @ self.axes.T - (0.0, 0.0, self.distance))

    def clipped(self, clip: tuple[ClipSpec, ...]) -> View:
        """Return the view with clip planes and boxes added to its own."""
        return replace(self, clip=self.clip + clip)

    def magnified(self, factor: int) -> View:
        """Return the view with `factor` times as many columns and rows of pixels."""
        width, height = self.size
        return replace(self, size=(factor * width, factor * height), scale_px=factor * self.scale_px)

    def fog_share(self, fog: Fog, origin: Float64, directions: Float64) -> tuple[Float64, Float64]:
        """Return the share of fog at a world position, and how much it changes along directions in the world.

        The share is not limited to numbers from 0 to 1. origin: float64 [..., 3]; directions: float64 [..., 3].
        """
        per_length = 1.0 / (fog.end - fog.begin)
        at_origin = ((origin - self.target) @ self.forward - fog.begin) * per_length
        return np.asarray(at_origin), np.asarray(directions @ self.forward * per_length)

    @property
    def center_px(self) -> Float64:
        """Return the position (x, y) of the optical axis in the image, in pixels from the top left corner."""
        return np.array(self.size) * (0.5 + self.shift[0], 0.5 - self.shift[1])

    @property
    def eye(self) -> Float64:
        """Return the position of the eye in the world, float64 [3]; a point on the eye plane if orthographic."""
        return np.asarray(self.target + self.distance * self.axes[2])

    @property
    def forward(self) -> Float64:
        """Return the viewing direction in the world, a unit vector, float64 [3]."""
        return np.asarray(-self.axes[2])
