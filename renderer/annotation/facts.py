"""Define the facts that an annotation shows, about a film and about one frame, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Literal

from renderer.scene import Color, Vector

# The side of the picture at which a name is.
Side = Literal["left", "right"]
# The end of a line to a label: its column and row, in pixels.
Anchor = tuple[float, float]


@dataclass(frozen=True)
class ColorBar:
    """A color bar: the colours and opacities of a transfer function over a range of its scalar.

    name, unit: the name of the layer, and the unit of its scalar.
    low, high: the ends of the range.
    colors, opacities: samples at even distances along the bar, from `low` to `high`. A layer that shows one value for
        each ray, such as the maximum, has no opacities.
    layer: the number of the layer with the transfer function. is_log: whether the samples are evenly spaced in the
        logarithm of the scalar.
    """

    name: str
    unit: str
    low: float
    high: float
    colors: tuple[Color, ...]
    opacities: tuple[float, ...] = ()
    layer: int = 0
    is_log: bool = False


@dataclass(frozen=True)
class AnnotationFacts:
    """The facts about a film that an annotation shows, on all frames alike.

    size: (width, height) of the picture, in pixels.
    background: the colours of the top and the bottom row of the picture, None if the background is transparent.
    unit: the unit of world lengths, such as `mm`, or `voxels` if the unit is unknown.
    is_perspective: whether the camera's projection is perspective.
    world_axes: the anatomical directions of the world's axes, such as `LPS`, or empty if they are unknown.
    bars: the color bars of the layers.
    legend: the names of labels or volumes, with their colours.
    names: the names of labels at the left and at the right side, from top to bottom, with their colours.
    """

    size: tuple[int, int]
    background: tuple[Color, Color] | None = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    unit: str = "voxels"
    is_perspective: bool = False
    world_axes: str = ""
    bars: tuple[ColorBar, ...] = ()
    legend: tuple[tuple[str, Color], ...] = ()
    names: tuple[tuple[tuple[str, Color], ...], tuple[tuple[str, Color], ...]] = ((), ())


@dataclass(frozen=True)
class FrameFacts:
    """The facts about one frame that an annotation shows.

    frame: the number of the frame.
    seconds: the time of the frame in the film.
    time: the time that the shown volume of a time series has; None without a time series.
    moving: the scene's values that change from frame to frame, as they are on this frame, by their keys in the scene.
    accuracy: the accuracy of the frame, in words.
    world_per_pixel: the world length of a pixel's side, at the camera's target.
    axes: the view's right, up and backward directions in the world.
    anchors: the ends of lines to labels, by the side and the rank of the label's name.
    """

    frame: int = 0
    seconds: float = 0.0
    time: float | None = None
    moving: dict[str, float] = field(default_factory=dict)
    accuracy: str = ""
    world_per_pixel: float = 1.0
    anchors: dict[tuple[Side, int], Anchor] = field(default_factory=dict)
    axes: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    def with_accuracy(self, psnr: float | None) -> FrameFacts:
        """Return these facts with the accuracy of the frame: its PSNR in decibels, None if it was not measured."""
        return self if psnr is None else replace(self, accuracy=f"frame PSNR {psnr:.1f} dB")

    @property
    def numbers(self) -> dict[str, float]:
        """Return the numbers that a text of the annotation may show by name, such as `{seconds}`."""
        own = {"frame": self.frame, "seconds": self.seconds} | ({} if self.time is None else {"time": self.time})
        return own | self.moving
