"""Project the largest or the smallest scalar of a ray, or the depth of the largest one."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.modes.projection import Projection, ramp
from renderer.transfer import TransferFunction


class Extremum(Projection):
    """A projection of the extreme scalar of each ray, the largest or the smallest one, or of the largest one's depth.

    Rays gather two numbers. The first is the position of the extreme scalar in the colour range, from 0 for the least
    extreme end, which shows nothing, to 1 for the most extreme end. The second is its nearness to the eye, from 0 at
    the farthest point of the ball around the volume to 1 at the nearest.
    """

    @property
    def is_maximum(self) -> bool:
        """Return whether the projection is of the largest scalar, not of the smallest."""
        return self.spec.type == "maximum"

    @property
    def by_depth(self) -> bool:
        """Return whether colours show the depth of the extreme scalar, not its value."""
        return self.spec.color_by == "depth"

    def _make_optics(self) -> TransferFunction:
        """Return a ramp over the colour range, from transparent to an optical depth of about 1 in a voxel."""
        first, last = self.color_range
        densest = 1.0 / self.volume.finest_spacing
        return ramp(first, last, (0.0, densest) if self.is_maximum else (densest, 0.0))

    def shares(self, gathered: Any, chords: Any) -> Any:
        if self.by_depth:
            return 1.0 - gathered[..., 1]
        return gathered[..., 0] if self.is_maximum else 1.0 - gathered[..., 0]

    def brightness(self, gathered: Any) -> Any:
        return np.clip(gathered[..., :1], 0.0, 1.0) if self.by_depth else 1.0
