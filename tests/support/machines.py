"""A simulated machine: drawing takes the time of a formula, and everything else none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from renderer.bricks import BrickBatch
from renderer.draw import BrickRasterizer, SplatRasterizer
from renderer.frame import num_samples
from renderer.splats import SplatBatch
from renderer.view import View, model_view, total_square_area_px
from renderer.volume import Float32, UInt32


class WithoutUploads:
    """The part of a rasteriser that keeps nothing between pictures, and draws no rays."""

    num_rays = 0

    def upload(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> bool:
        """Upload nothing."""
        return False


class Painter(WithoutUploads):
    """A rasteriser whose picture, RGBA or one of it for all pixels, follows from what is drawn and the view."""

    def __init__(self, paint: Callable[[Any, View], npt.ArrayLike]) -> None:
        self._paint = paint

    def rasterize(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> Float32:
        """Return the picture."""
        shape = (view.size[1], view.size[0], 4)
        return np.broadcast_to(np.asarray(self._paint(batches[0], view), np.float32), shape).copy()


class SimulatedMachine(WithoutUploads):
    """A clock and a rasteriser that draws nothing.

    A drawing takes `per_frame + per_splat * splats + per_pixel * pixels`, or samples of bricks, times `pace(number of
    drawings so far)` and a random factor of mean 1 and relative deviation `noise`.
    """

    def __init__(
        self,
        *,
        per_frame: float = 4e-3,
        per_splat: float = 1e-6,
        per_pixel: float = 8e-9,
        noise: float = 0.0,
        pace: Callable[[int], float] = lambda number: 1.0,
        seed: int = 0,
    ) -> None:
        self.now, self.num_drawings = 0.0, 0
        self._rates, self._noise, self._pace = (per_frame, per_splat, per_pixel), noise, pace
        self._random = np.random.default_rng(seed)

    def clock(self) -> float:
        """Return the seconds so far."""
        return self.now

    def rasterize(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> Float32:
        """Return an empty picture after its time."""
        seconds = self.seconds_of(batches, orders, view)
        self.now += seconds * self._pace(self.num_drawings) * (1 + self._noise * self._random.standard_normal())
        self.num_drawings += 1
        return np.zeros((view.size[1], view.size[0], 4), np.float32)

    def seconds_of(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> float:
        """Return the seconds of a drawing of one batch at the usual pace."""
        (batch,), (order,) = batches, orders
        if isinstance(batch, BrickBatch):
            num_pixels = num_samples(batch, order, view)
        else:
            num_pixels = total_square_area_px(batch, order, model_view(batch, view))
        per_frame, per_splat, per_pixel = self._rates
        return per_frame + per_splat * len(order) + per_pixel * num_pixels


class UploadingMachine(SimulatedMachine):
    """A machine that keeps one batch, which takes `times` as long to upload as to draw.

    A batch that was not uploaded is uploaded when it is drawn.
    """

    def __init__(self, times: float = 10.0, **options: Any) -> None:
        super().__init__(**options)
        self._times = times
        self._uploaded: SplatBatch | BrickBatch | None = None

    def upload(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> bool:
        """Take the time of an upload unless the batch is there."""
        if self._uploaded is batches[0]:
            return False
        self._uploaded = batches[0]
        self.now += self._times * self.seconds_of(batches, orders, view)
        return True

    def rasterize(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> Float32:
        """Return an empty picture after its time."""
        self.upload(batches, orders, view)
        return super().rasterize(batches, orders, view)


def set_device(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Give rasterisers another device."""
    other = property(lambda _: name, lambda _, own: None)
    for kind in (SplatRasterizer, BrickRasterizer):
        monkeypatch.setattr(kind, "device", other, raising=False)
