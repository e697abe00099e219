"""Define what all frames of a film share, and how a frame is looked up and timed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from renderer.bricks import BrickBatch, Bricks
from renderer.modes import Projection
from renderer.pyramid import Pyramid
from renderer.scene import Scene, Vector
from renderer.view import OrderBlending, View, make_view
from renderer.volume import Volume

Clock = Callable[[], float]


@dataclass(frozen=True)
class Stage:
    """Everything in a film that does not change from frame to frame.

    target: the world position that the camera looks at.
    distance: from the eye to the target, in world units.
    finest_level: cells of lower levels would be too small to see on every frame.
    voxel_px: the finest spacing at the volume's centre, in pixels, where it is smallest along the path.
    order_blending: which neighbours change their order along the path.
    bricks: of the volume, if the footprint is drawn from bricks.
    projection: what the scene's mode colours; None for emission and absorption.
    extreme_bricks: those in which rays look for extremes, if they do.
    seconds: the time that each stage of the preparation took.
    """

    scene: Scene
    volume: Volume
    pyramid: Pyramid
    target: Vector
    distance: float
    finest_level: int
    voxel_px: float
    order_blending: OrderBlending
    bricks: Bricks | None
    projection: Projection | None
    extreme_bricks: BrickBatch | None
    seconds: dict[str, float]

    def close(self) -> None:
        """Let go of voxels, pyramid and bricks; nothing can be drawn from the stage any more."""
        for name in ("volume", "pyramid", "bricks", "extreme_bricks"):
            object.__setattr__(self, name, None)


class Stopwatch:
    """Measures seconds between laps, by name. The caller passes the clock."""

    def __init__(self, clock: Clock) -> None:
        self._clock, self._last = clock, clock()
        self.seconds: dict[str, float] = {}

    def lap(self, name: str) -> float:
        """Add the time since the last lap to `name`, and return it."""
        now = self._clock()
        seconds, self._last = now - self._last, now
        self.seconds[name] = self.seconds.get(name, 0.0) + seconds
        return seconds


def view_of(stage: Stage, frame: int) -> View:
    """Return the view of a frame of the film."""
    view = make_view(stage.scene.camera, frame, stage.target, stage.distance, stage.scene.output.size)
    return replace(view, clip=stage.scene.clip)


def draws_voxels_only(stage: Stage) -> bool:
    """Return whether voxels are drawn at every tolerance: their shading is not in the means of larger cells."""
    return stage.scene.shading is not None and stage.scene.shading.is_pointwise


def finest_level_at(stage: Stage, tolerance: float) -> int:
    """Return the finest level of the cells that are drawn at a tolerance."""
    if draws_voxels_only(stage):
        return 0
    return max(stage.scene.error.finest_level, stage.finest_level if tolerance > 0 else 0)
