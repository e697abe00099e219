"""Project the largest or the smallest scalar of a ray, or where the largest one is."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.modes.projection import Projection, ramp
from renderer.transfer import TransferFunction


class Extremum(Projection):
    """A projection of the extreme scalar of each ray.

    Rays gather two channels: from 0, the end of the colour range that is the same as nothing, to 1, its other end, how
    extreme the scalar is; and how near it is, from 0 at the farthest point of the ball around the volume to 1.
    """

    @property
    def is_maximum(self) -> bool:
        """Return whether the largest scalar counts."""
        return self.spec.type == "maximum"

    @property
    def by_depth(self) -> bool:
        """Return whether colours tell where the scalar is."""
        return self.spec.color_by == "depth"

    def _make_optics(self) -> TransferFunction:
        """Show what is more extreme than one end of the colour range, about one optical depth in a voxel."""
        first, last = self.color_range
        densest = 1.0 / self.volume.finest_spacing
        return ramp(first, last, (0.0, densest) if self.is_maximum else (densest, 0.0))

    def shares(self, gathered: Any, chords: Any) -> Any:
        if self.by_depth:
            return 1.0 - gathered[..., 1]
        return gathered[..., 0] if self.is_maximum else 1.0 - gathered[..., 0]

    def brightness(self, gathered: Any) -> Any:
        return np.clip(gathered[..., :1], 0.0, 1.0) if self.by_depth else 1.0
