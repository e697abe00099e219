"""Project the mean scalar of a ray, or its attenuation; both are found from an optical depth."""

from __future__ import annotations

from typing import Any

import numpy as np

from renderer.modes.projection import Projection, ramp
from renderer.transfer import MAX_VOXEL_DEPTH, TransferFunction


class Mean(Projection):
    """A projection of the mean scalar along each ray, inside the volume's box.

    The extinction is linear in the scalar: from the optical depth of a ray, which is at most 1, follows the integral of
    the scalar along the ray, and so the mean.
    """

    def _make_optics(self) -> TransferFunction:
        low, high = self.volume.value_range()
        if low == high:
            high = float(np.nextafter(low, np.inf))
        self._low_share, self._width_share = self.share_of(low), self.share_of(high) - self.share_of(low)
        self._depth_per_length = 1.0 / (2.0 * self.volume.half_diagonal)
        # An error of the picture, as a share of the colour range, times this factor is an error of the optical depth,
        # on a ray as long as the mean chord of the volume's box.
        self.tolerance_factor = self._mean_chord * self._depth_per_length / max(1.0, self._width_share)
        return ramp(low, high, (0.0, self._depth_per_length))

    @property
    def _mean_chord(self) -> float:
        """Return the mean length of rays inside the volume's box, 4 V / S (Cauchy 1841)."""
        edges = self.volume.world_from_index[:3, :3] / self.volume.finest_spacing * self.volume.shape_xyz
        surface = sum(np.linalg.norm(np.cross(edges[:, k], edges[:, k - 1])) for k in range(3)) * 2.0
        return float(4.0 * abs(np.linalg.det(edges)) / surface) * self.volume.finest_spacing

    def shares(self, gathered: Any, chords: Any) -> Any:
        depths = -np.log1p(-gathered[..., 3])
        lengths = np.where(chords > 0, chords, 1.0)
        return self._low_share + depths / (lengths * self._depth_per_length) * self._width_share


class Attenuation(Projection):
    """A projection of the attenuation of each ray: exp(-integral of mu), with mu = scale * max(s - zero, 0).

    s: the scalar. scale, zero: settings of the mode. mu: an extinction per world unit.
    """

    def _make_optics(self) -> TransferFunction:
        assert self.spec.scale is not None and self.spec.zero is not None, "checked with the scene"
        _, high = self.volume.value_range()
        opaque = self.spec.zero + MAX_VOXEL_DEPTH / self.volume.finest_spacing / self.spec.scale
        last = min(max(high, float(np.nextafter(self.spec.zero, np.inf))), opaque)
        first, end = self.color_range
        self.tolerance_factor = min(1.0, end - first)
        return ramp(self.spec.zero, last, (0.0, self.spec.scale * (last - self.spec.zero)))

    def shares(self, gathered: Any, chords: Any) -> Any:
        return self.share_of(1.0 - gathered[..., 3])
