"""Where all figures are drawn: one rasteriser, one clock, and the program's own way from a scene to its frames."""

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

# An alpha from here on is too near to 1, in float32 and with ripple, for the optical depth to be found from it.
OPAQUE = 0.9999


@dataclass(frozen=True)
class Studio:
    """volumes: those that have been read already. clock: gives seconds."""

    rasterizer: Rasterizer
    volumes: Mapping[VolumeSpec, Volume]
    clock: Callable[[], float]
    num_threads: int

    def stage(self, scene: Scene) -> Stage:
        """The scene with its volume and its pyramid; at tolerance 0 if it asks for anything but a tolerance."""
        scene = scene if scene.error.goal is None else with_tolerance(scene, 0.0)
        volume = self.volumes.get(scene.volume)
        return prepare_stage(scene, clock=self.clock, num_threads=self.num_threads, volume=volume, any_tolerance=True)

    def draw(self, stage: Stage) -> Frame:
        """The first frame of the film."""
        return next(render_frames(stage, [0], self.rasterizer, clock=self.clock))

    def frame_seconds(self, stage: Stage, *, repetitions: int) -> float:
        """Median time of a frame of the film whose cut has been made, the first one left out."""
        frames = render_frames(stage, [0] * (repetitions + 1), self.rasterizer, clock=self.clock)
        next(frames)
        return statistics.median(sum(frame.seconds[name] for name in FRAME_STAGES) for frame in frames)

    def truth(self, stage: Stage) -> FloatImage:
        """The ray integral of the first frame, to TRUTH_TOLERANCE: float64 [h, w, 3], over the scene's background."""
        return compute_truth(stage, 0, TRUTH_TOLERANCE, num_threads=self.num_threads).picture


def transfer_of(stage: Stage) -> TransferFunction:
    """The transfer function, with its opacities as extinctions of the volume's world units."""
    return make_transfer_function(stage.scene.transfer_function, stage.volume.finest_spacing)


def with_error(stage: Stage, **changes: Any) -> Stage:
    """The stage with other fields of its ErrorSpec; not `measure` or `of`, on which the pyramid depends."""
    return replace(stage, scene=replace(stage.scene, error=replace(stage.scene.error, **changes)))


def with_splat(stage: Stage, **changes: Any) -> Stage:
    """The stage with other fields of its SplatSpec."""
    return replace(stage, scene=replace(stage.scene, splat=replace(stage.scene.splat, **changes)))
