"""Compute the truth of a frame, and choose the frames that are worth comparing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from renderer.draw import Rasterizer
from renderer.film import over_background
from renderer.frame import Clock, Stage, render_frames, view_of
from renderer.scene import CameraPath, KeyframePath, with_tolerance
from renderer.study.metrics import FloatImage
from renderer.transfer import make_transfer_function
from renderer.truth import Convergence, converged_image
from renderer.volume import Bools

T = TypeVar("T")

# The convergence of a truth in every channel: a thousandth of the RMSE of a picture with 40 dB.
TRUTH_TOLERANCE = 1e-5

# The opacity from which a pixel counts as covered: the smallest that 8 bits show.
_MIN_COVERED_OPACITY = 1 / 255


@dataclass(frozen=True)
class Truth:
    """A truth: the converged ray integral of one frame.

    picture: float64 [h, w, 3], over the scene's background, clipped to [0, 1].
    on_volume: bool [h, w], where anything of the volume is visible.
    convergence: the changes as the step was halved. seconds: the time that it took, where somebody has timed it.
    """

    frame: int
    picture: FloatImage
    on_volume: Bools
    convergence: Convergence
    seconds: float = 0.0

    @property
    def share_on_volume(self) -> float:
        """Return the share of the pixels that show the volume."""
        return float(self.on_volume.mean())


def compute_truth(stage: Stage, frame: int, tolerance: float, **options: Any) -> Truth:
    """Compute the truth of a frame to `tolerance` in every channel. Raises RenderError if it does not converge.

    options: num_threads and on_progress, as in `converged_image`.
    """
    scene, view = stage.scene, view_of(stage, frame)
    transfer = make_transfer_function(scene.transfer_function, stage.volume.finest_spacing)
    image, convergence = converged_image(
        stage.volume, transfer, view, tolerance=tolerance, shading=scene.shading, **options
    )
    return Truth(frame, over_background(image, scene.output.background), image[..., 3] > 0, convergence)


def is_loop(path: CameraPath) -> bool:
    """Return whether the last frame of a path leads back to the first."""
    return not isinstance(path, KeyframePath) or path.loop


def spread_evenly(items: Sequence[T], num: int, *, is_loop: bool) -> list[T]:
    """Return at most `num` evenly spread items, such as frames: around a loop, or with the first and the last."""
    num = min(num, len(items))
    span = len(items) if is_loop or num == 1 else len(items) - 1
    return [items[i * span // (num if is_loop or num == 1 else num - 1)] for i in range(num)]


def extreme_coverage_frames(
    stage: Stage, frames: Sequence[int], tolerance: float, rasterizer: Rasterizer, *, clock: Clock
) -> tuple[int, int]:
    """Return the frames on which the volume covers the smallest and the largest part of the picture.

    All frames are drawn, at a (coarse) tolerance. The first of equal frames is returned.
    """
    coarse = replace(stage, scene=with_tolerance(stage.scene, tolerance))
    covered = [
        int(np.count_nonzero(frame.radiance[..., 3] >= _MIN_COVERED_OPACITY))
        for frame in render_frames(coarse, frames, rasterizer, clock=clock)
    ]
    return frames[int(np.argmin(covered))], frames[int(np.argmax(covered))]
