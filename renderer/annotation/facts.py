"""Say what an annotation shows: plain data, of a film and of one frame."""

from __future__ import annotations

from dataclasses import dataclass, field

from renderer.scene import Color, Vector


@dataclass(frozen=True)
class ColorBar:
    """A record of the colours of a transfer function over a range of its scalar.

    colors, opacities: samples at even distances of the bar, from `low` to `high`; no opacities of a projection.
    layer: the number of its volume. is_log: whether the samples are even in the logarithm of the scalar.
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
    """A record of what an annotation shows on all frames of a film.

    size: (width, height) of the picture. background: the colours of its top and its bottom row, None if transparent.
    unit: of world lengths: `mm`, or `voxels` where it is not known. is_perspective: of the camera.
    world_axes: where the world's axes point, such as `LPS`, or empty where nobody knows.
    legend: names and colours.
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
    """A record of what an annotation shows on one frame.

    seconds: of the film before it. time: of the step that is shown, None if there is none. moving: numbers by key.
    accuracy: how exact the frame is, in words. world_per_pixel: a pixel's side, at the camera's target.
    axes: the view's right, up and backward in the world.
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
        """Return the numbers that formats may name."""
        own = {"frame": self.frame, "seconds": self.seconds} | ({} if self.time is None else {"time": self.time})
        return own | self.moving
