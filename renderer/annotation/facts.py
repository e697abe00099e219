"""Define the facts that an annotation shows, about a film and about one frame, as plain data."""

from __future__ import annotations

from dataclasses import dataclass, field

from renderer.scene import Color, Vector


@dataclass(frozen=True)
class ColorBar:
    """A record of the colours of a transfer function over a range of its scalar.

    colors, opacities: samples at even distances along the bar, from `low` to `high`. A projection has no opacities.
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
    """A record of the facts that hold on all frames of a film.

    size: (width, height) of the picture. background: the colours of its top and its bottom row, None if transparent.
    unit: the unit of world lengths, such as `mm`, or `voxels` if it is unknown. is_perspective: whether the camera's
        projection is perspective.
    world_axes: the directions of the world's axes, such as `LPS`, or empty if they are unknown.
    legend: names and their colours.
    """

    size: tuple[int, int]
    background: tuple[Color, Color] | None = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    unit: str = "voxels"
    is_perspective: bool = False
    world_axes: str = ""
    bars: tuple[ColorBar, ...] = ()
    legend: tuple[tuple[str, Color], ...] = ()


@dataclass(frozen=True)
class FrameFacts:
    """A record of the facts about one frame.

    seconds: the time of the frame in the film. time: the time of the step that is shown, None without steps in time.
    moving: the scene's values that move, by key. accuracy: the accuracy of the frame, in words.
    world_per_pixel: the world length of a pixel's side, at the camera's target.
    axes: the view's right, up and backward directions in the world.
    """

    frame: int = 0
    seconds: float = 0.0
    time: float | None = None
    moving: dict[str, float] = field(default_factory=dict)
    accuracy: str = ""
    world_per_pixel: float = 1.0
    axes: tuple[Vector, Vector, Vector] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))

    @property
    def numbers(self) -> dict[str, float]:
        """Return the numbers that format strings of texts may name."""
        own = {"frame": self.frame, "seconds": self.seconds} | ({} if self.time is None else {"time": self.time})
        return own | self.moving
