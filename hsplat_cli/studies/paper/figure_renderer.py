"""Draw and time the scenes of the paper's figures with one rasterizer and one clock."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from renderer.frame import Frame, Rasterizer, Stage, prepare_stage, render_frames
from renderer.scene import Scene, VolumeSpec, with_tolerance
from renderer.study import FRAME_STAGES, TRUTH_TOLERANCE, FloatImage, compute_truth
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.volume import Volume

# Above this alpha, float32 and the footprint's ripple hide the optical depth.
SATURATED_ALPHA = 0.9999


@dataclass(frozen=True)
class FigureRenderer:
    """A rasterizer with what all figures share. volumes: those already read. clock: returns seconds."""

    rasterizer: Rasterizer
    volumes: Mapping[VolumeSpec, Volume]
    clock: Callable[[], float]
    num_threads: int

    def stage(self, scene: Scene) -> Stage:
        """Prepare a scene for any tolerance; tolerance 0 replaces a budget or an accuracy."""
        scene = scene if scene.error.goal is None else with_tolerance(scene, 0.0)
        volume = self.volumes.get(scene.volume)
        return prepare_stage(scene, clock=self.clock, num_threads=self.num_threads, volume=volume, any_tolerance=True)

    def draw(self, stage: Stage) -> Frame:
        """Draw the first frame of the film."""
        return next(render_frames(stage, [0], self.rasterizer, clock=self.clock))

    def frame_seconds(self, stage: Stage, *, repetitions: int) -> float:
        """Return the median time of a frame whose cut exists; a first frame warms up and is not counted."""
        frames = render_frames(stage, [0] * (repetitions + 1), self.rasterizer, clock=self.clock)
        next(frames)
        return statistics.median(sum(frame.seconds[name] for name in FRAME_STAGES) for frame in frames)

    def truth(self, stage: Stage) -> FloatImage:
        """Integrate the first frame to TRUTH_TOLERANCE: float64 [h, w, 3], over the scene's background."""
        return compute_truth(stage, 0, TRUTH_TOLERANCE, num_threads=self.num_threads).picture


def transfer_of(stage: Stage) -> TransferFunction:
    """Return the stage's transfer function, with extinctions per world unit."""
    return make_transfer_function(stage.scene.transfer_function, stage.volume.finest_spacing)


def with_error(stage: Stage, **changes: Any) -> Stage:
    """Return the stage with other fields in its ErrorSpec; not `measure` or `of`, on which the pyramid depends."""
    return replace(stage, scene=replace(stage.scene, error=replace(stage.scene.error, **changes)))


def with_splat(stage: Stage, **changes: Any) -> Stage:
    """Return the stage with other fields in its SplatSpec."""
    return replace(stage, scene=replace(stage.scene, splat=replace(stage.scene.splat, **changes)))
