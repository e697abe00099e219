"""Where all figures are drawn: one rasteriser, one clock, and the program's own way from a scene to its frames."""

from __future__ import annotations

import statistics
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from renderer.integrator import integrate
from renderer.pipeline import Frame, Rasterizer, Stage, prepare, render_frames, view_of
from renderer.scene import Scene, VolumeSpec
from renderer.transfer import TransferFunction, make_transfer
from renderer.volume import Volume

Image = npt.NDArray[np.floating[Any]]

# What is done anew for every frame of a film; the rest is done once while the tolerance stays.
FRAME_STAGES = ("order", "draw", "quantize")


@dataclass(frozen=True)
class Studio:
    """volumes: those that have been read already. clock: gives seconds."""

    rasterizer: Rasterizer
    volumes: Mapping[VolumeSpec, Volume]
    clock: Callable[[], float]
    num_threads: int

    def stage(self, scene: Scene) -> Stage:
        """The scene with its volume and its pyramid."""
        volume = self.volumes.get(scene.volume)
        return prepare(scene, clock=self.clock, num_threads=self.num_threads, volume=volume)

    def draw(self, stage: Stage) -> Frame:
        """The first frame of the film."""
        return next(render_frames(stage, [0], self.rasterizer, clock=self.clock))

    def frame_seconds(self, stage: Stage, *, repetitions: int) -> float:
        """Median time of a frame of the film whose cut has been made, the first one left out."""
        frames = render_frames(stage, [0] * (repetitions + 1), self.rasterizer, clock=self.clock)
        next(frames)
        return statistics.median(sum(frame.seconds[name] for name in FRAME_STAGES) for frame in frames)

    def truth(self, stage: Stage) -> Image:
        """The ray integral of the first frame, accurate to about 1e-7: float64 [h, w, 4], premultiplied."""
        return integrate(
            stage.volume, transfer_of(stage), view_of(stage, 0), step_voxels=1.0, shading=stage.scene.shading
        )


def transfer_of(stage: Stage) -> TransferFunction:
    """The transfer function, with its opacities as extinctions of the volume's world units."""
    return make_transfer(stage.scene.transfer_function, float(stage.volume.spacing.min()))


def with_error(stage: Stage, **changes: Any) -> Stage:
    """The stage with other fields of its ErrorSpec; not `measure` or `of`, on which the pyramid depends."""
    return replace(stage, scene=replace(stage.scene, error=replace(stage.scene.error, **changes)))


def with_splat(stage: Stage, **changes: Any) -> Stage:
    """The stage with other fields of its SplatSpec."""
    return replace(stage, scene=replace(stage.scene, splat=replace(stage.scene.splat, **changes)))


def counted(num: int, noun: str) -> str:
    """`1 cell`, `8 cells`."""
    return f"{num} {noun}" if num == 1 else f"{num} {noun}s"
