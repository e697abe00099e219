"""Define the base class of projections, which show one number of each ray as a colour."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from renderer.kernels import ThreadPool, kernels
from renderer.scene import ModeSpec
from renderer.transfer import TransferFunction
from renderer.volume import Float32, Float64, Volume


class Projection(ABC):
    """A projection: a mode that shows one number of each ray as a colour. The scene's opacities have no effect.

    color_range: the first and the last scalar of the scene's colours. Numbers are coloured as shares of this range.
    optics: the transfer function that is drawn in place of the scene's. The numbers of rays are computed from the
        picture drawn with it.
    tolerance_factor: the factor from the scene's tolerance, a share of the colour range, to the tolerance at which
        `optics` is drawn.
    """

    tolerance_factor: float = 1.0

    def __init__(self, spec: ModeSpec, colors: TransferFunction, volume: Volume) -> None:
        self.spec, self.volume = spec, volume
        self.color_range = float(colors.values[0]), float(colors.values[-1])
        shares = self.share_of(colors.values)
        self._colors = TransferFunction(shares, colors.colors, np.zeros(len(shares)), 1.0)
        self.optics = self._make_optics()

    def share_of(self, scalars: Any) -> Any:
        """Return the positions of scalars in the colour range: 0 at its start and 1 at its end."""
        first, last = self.color_range
        return (scalars / 2 - first / 2) / (last / 2 - first / 2)  # halves do not overflow

    @abstractmethod
    def _make_optics(self) -> TransferFunction:
        """Return the transfer function that is drawn in place of the scene's."""

    @abstractmethod
    def shares(self, gathered: Any, chords: Any) -> Any:
        """Return the number that each ray shows, as a share of the colour range: float [...].

        gathered: float [..., 4], the picture that is drawn with `optics`. chords: float [...], the world lengths of the
        rays inside the volume's box.
        """

    def brightness(self, gathered: Any) -> Any:
        """Return the factor on the colours of rays: float [..., 1], or 1 for all rays.

        gathered: float [..., 4], the picture that is drawn with `optics`.
        """
        return 1.0

    def picture(self, gathered: Float32, chords: Float32, threads: ThreadPool) -> Float32:
        """Return the picture: premultiplied RGBA, float32 [h, w, 4], opaque where rays meet the volume's box.

        gathered: float32 [h, w, 4], the picture that is drawn with `optics`. chords: float32 [h, w], the world lengths
        of the rays inside the volume's box.
        """
        image = np.empty_like(gathered)
        color = kernels().color_shares.partial(curve=self._colors.curve())

        def work(first: int, end: int) -> None:
            rays, lengths = gathered[first:end], chords[first:end]
            shares = np.clip(self.shares(rays, lengths), 0.0, 1.0).astype(np.float32)
            brightness = np.full((*shares.shape, 1), self.brightness(rays), np.float32)
            color(shares=shares, chords=lengths, brightness=brightness, image=image[first:end])

        threads.for_rows(work, chords)
        return image

    def exact_colors(self, gathered: Float64, chords: Float64) -> Float64:
        """Return the colours of rays as `picture` does, in double precision: float64 [n, 4].

        gathered: float64 [n, 4], exact radiance with `optics`. chords: float64 [n], the world lengths of the rays
        inside the volume's box.
        """
        colors, _ = self._colors.classify(self.shares(gathered, chords))
        is_met = (chords > 0)[:, None]
        return np.hstack([colors * is_met * self.brightness(gathered), is_met])


def ramp(first: float, last: float, extinctions: tuple[float, float]) -> TransferFunction:
    """Return a white transfer function whose extinction is linear between the scalars `first` and `last`.

    extinctions: the extinction per world unit at both scalars.
    """
    return TransferFunction(np.array([first, last]), np.ones((2, 3)), np.array(extinctions), 1.0)
