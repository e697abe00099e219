"""A simulated machine, on which drawing takes the time of a formula, and everything else takes no time."""

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
    """The base of rasterisers that keep no data on a device between pictures, and draw no rays."""

    num_rays = 0

    def upload(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> bool:
        """Return False, as nothing is uploaded."""
        return False


class Painter(WithoutUploads):
    """A rasteriser that draws by a function. paint: returns RGBA, [h, w, 4] or [4], for the first batch and a view."""

    def __init__(self, paint: Callable[[Any, View], npt.ArrayLike]) -> None:
        self._paint = paint

    def rasterize(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> Float32:
        """Return the picture that the function paints for the first batch."""
        shape = (view.size[1], view.size[0], 4)
        return np.broadcast_to(np.asarray(self._paint(batches[0], view), np.float32), shape).copy()


class SimulatedMachine(WithoutUploads):
    """A clock, and a rasteriser that draws nothing.

    A drawing takes `per_frame + per_splat * splats + per_pixel * pixels` seconds, with bricks and samples in place of
    splats and pixels where bricks are drawn. This is multiplied by `pace(number of drawings so far)`, and by a random
    factor of mean 1 and standard deviation `noise`.
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
        """Return the time in seconds."""
        return self.now

    def rasterize(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> Float32:
        """Let the seconds of the drawing pass, and return an empty picture."""
        seconds = self.seconds_of(batches, orders, view)
        self.now += seconds * self._pace(self.num_drawings) * (1 + self._noise * self._random.standard_normal())
        self.num_drawings += 1
        return np.zeros((view.size[1], view.size[0], 4), np.float32)

    def seconds_of(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> float:
        """Return the seconds of drawing one batch, without the factors of pace and noise."""
        (batch,), (order,) = batches, orders
        if isinstance(batch, BrickBatch):
            num_pixels = num_samples(batch, order, view)
        else:
            num_pixels = total_square_area_px(batch, order, model_view(batch, view.magnified(batch.samples_across)))
        per_frame, per_splat, per_pixel = self._rates
        return per_frame + per_splat * len(order) + per_pixel * num_pixels


class UploadingMachine(SimulatedMachine):
    """A simulated machine that keeps one batch. It takes `times` as long to upload a batch as to draw it.

    A batch that was not uploaded is uploaded when it is drawn.
    """

    def __init__(self, times: float = 10.0, **options: Any) -> None:
        super().__init__(**options)
        self._times = times
        self._uploaded: SplatBatch | BrickBatch | None = None

    def upload(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> bool:
        """Upload the batch, which takes time, and return True; return False if it is uploaded already."""
        if self._uploaded is batches[0]:
            return False
        self._uploaded = batches[0]
        self.now += self._times * self.seconds_of(batches, orders, view)
        return True

    def rasterize(self, batches: Sequence[Any], orders: Sequence[UInt32], view: View) -> Float32:
        """Let the seconds of the drawing pass, and return an empty picture."""
        self.upload(batches, orders, view)
        return super().rasterize(batches, orders, view)


def set_device(monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    """Let all rasterisers of splats and bricks tell this name of their device."""
    other = property(lambda _: name, lambda _, own: None)
    for kind in (SplatRasterizer, BrickRasterizer):
        monkeypatch.setattr(kind, "device", other, raising=False)
