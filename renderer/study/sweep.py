"""What a film costs and how near it comes to the truth, at each of many settings.

Every setting is drawn by the loop that makes films. A first pass over the frames warms up (shaders, buffers, caches)
and gives the pictures; the passes after it are timed.
"""

from __future__ import annotations

import statistics
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from renderer.frame import Clock, Frame, Rasterizer, Stage, render_frames
from renderer.scene import ErrorSpec, SplatSpec
from renderer.study.metrics import Accuracy, measure_accuracy, over_background, pool_accuracies
from renderer.study.thumbnails import difference_thumbnail, thumbnail
from renderer.study.truths import Truth

# What is timed once a frame, and once a cut, which stays while the tolerance does.
FRAME_STAGES = ("order", "draw", "quantize")
_CUT_STAGES = ("cut", "splats")
# A setting is not drawn again once it took this long: the median of fewer repetitions will do.
_PATIENCE_S = 4.0


class MemoryMeter(Protocol):
    """Tells the most memory that the process held since it was last reset, where the system knows; `trim` first gives
    back what was freed but is still held."""

    def trim(self) -> None: ...
    def reset(self) -> None: ...
    def peak_bytes(self) -> int | None: ...


@dataclass(frozen=True)
class Setting:
    """One way to draw the film: a point of a series.

    series: the curve that it belongs to: "gaussian, optical", "gouraud 8x3, rms, uncorrected", "vtk gpu".
    label: which point of it: "tolerance 0.1", "step 0.5".
    options: the choices by name, numbers and short words, for tables: tool, tolerance, footprint, ...
    """

    series: str
    label: str
    options: Mapping[str, str | float | bool]


@dataclass(frozen=True)
class FrameMeasurement:
    """One frame at one setting.

    num_splats: those that the frame can show; None for a peer, and for bricks, of which one does the work of many.
    seconds: by stage, one for each repetition, warm.
    """

    frame: int
    num_splats: int | None
    seconds: Mapping[str, tuple[float, ...]]
    accuracy: Accuracy

    @property
    def frame_seconds(self) -> tuple[float, ...]:
        """All stages of the frame together, for each repetition."""
        return tuple(map(sum, zip(*self.seconds.values(), strict=True)))


@dataclass(frozen=True)
class Measurement:
    """One setting on some frames.

    num_cells: of its cut, which may be bricks; None for a peer.
    pyramid_seconds: what building its pyramid, and bricks, took, once; None for a peer.
    seconds: what is done once for many frames (cut, splats), by stage, one for each repetition; empty for a peer.
    frames: one for each frame.
    overall: the accuracy over all frames together.
    peak_bytes: the most memory that the process held meanwhile; None where the system does not tell.
    picture, difference: uint8 [h, w, 3], the first frame and its difference from the truth times DIFFERENCE_GAIN, at
        most THUMBNAIL_PX wide and high.
    """

    setting: Setting
    num_cells: int | None
    pyramid_seconds: float | None
    seconds: Mapping[str, tuple[float, ...]]
    frames: tuple[FrameMeasurement, ...]
    overall: Accuracy
    peak_bytes: int | None
    picture: npt.NDArray[np.uint8]
    difference: npt.NDArray[np.uint8]

    @property
    def frame_seconds(self) -> float:
        """Median time of a frame, over frames and repetitions."""
        return statistics.median(self._all_frame_seconds)

    @property
    def frame_seconds_spread(self) -> tuple[float, float]:
        """First and third quartile of the time of a frame, over frames and repetitions."""
        low, high = np.quantile(self._all_frame_seconds, [0.25, 0.75])
        return float(low), float(high)

    @property
    def num_splats(self) -> float | None:
        """Mean over the frames."""
        counts = [sample.num_splats for sample in self.frames if sample.num_splats is not None]
        return statistics.fmean(counts) if counts else None

    @property
    def _all_frame_seconds(self) -> list[float]:
        return [seconds for sample in self.frames for seconds in sample.frame_seconds]


def splat_setting(error: ErrorSpec, splat: SplatSpec) -> Setting:
    """What hsplat draws at a constant tolerance, named by what differs between series."""
    footprint = f"gouraud {splat.angular}x{splat.radial}" if splat.footprint == "gouraud" else splat.footprint
    measure = error.measure if error.of == "classified" else f"{error.measure} of {error.of}"
    tolerance = error.tolerance[0][1]
    options: dict[str, str | float | bool] = {
        "tool": "hsplat",
        "tolerance": tolerance,
        "footprint": footprint,
        "measure": measure,
    }
    words = [footprint, measure]
    if splat.footprint != "integrated":
        words += [] if splat.opacity_correction else ["uncorrected"]
        options["opacity_correction"] = splat.opacity_correction
    return Setting(", ".join(words), f"tolerance {tolerance:g}", options)


def pyramid_seconds(stage: Stage) -> float:
    """What building the pyramid of a stage took, and its bricks."""
    return stage.seconds["pyramid"]


def measure_setting(
    stage: Stage, truths: Sequence[Truth], rasterizer: Rasterizer, *, clock: Clock, memory: MemoryMeter, repeats: int
) -> Measurement:
    """The film's own constant tolerance and splats, on the frames of the truths."""
    numbers = [truth.frame for truth in truths]
    background = stage.scene.output.background
    peaks: list[int] = []
    accuracies: list[Accuracy] = []
    first_pass: list[Frame] = []
    pictures = None
    memory.trim()
    memory.reset()
    for frame, truth in zip(render_frames(stage, numbers, rasterizer, clock=clock), truths, strict=True):
        peaks += [peak] if (peak := memory.peak_bytes()) is not None else []
        picture = over_background(frame.radiance, background)
        accuracies.append(measure_accuracy(picture, truth.picture, truth.on_volume))
        pictures = pictures or (thumbnail(picture), difference_thumbnail(picture, truth.picture))
        first_pass.append(_without_pictures(frame))
        memory.reset()
    passes = _timed_passes(stage, numbers, rasterizer, clock, repeats, first_pass)
    assert pictures is not None, "no frames"
    return Measurement(
        setting=splat_setting(stage.scene.error, stage.scene.splat),
        num_cells=first_pass[0].num_cells,
        pyramid_seconds=pyramid_seconds(stage),
        seconds=_repetitions([frames[0] for frames in passes], _CUT_STAGES),
        frames=tuple(
            FrameMeasurement(
                truth.frame,
                first_pass[i].num_splats if stage.bricks is None else None,
                _repetitions([frames[i] for frames in passes], FRAME_STAGES),
                accuracies[i],
            )
            for i, truth in enumerate(truths)
        ),
        overall=pool_accuracies(accuracies),
        peak_bytes=max(peaks, default=None),
        picture=pictures[0],
        difference=pictures[1],
    )


def _timed_passes(
    stage: Stage, numbers: Sequence[int], rasterizer: Rasterizer, clock: Clock, repeats: int, first_pass: list[Frame]
) -> list[list[Frame]]:
    """Up to `repeats` passes over the frames, all warm.

    Where the first pass alone tries the reader's patience, its first frame is drawn again; the others were warm.
    """
    spent = sum(sum(frame.seconds.values()) for frame in first_pass)
    if spent > _PATIENCE_S:
        (again,) = render_frames(stage, numbers[:1], rasterizer, clock=clock)
        return [[_without_pictures(again), *first_pass[1:]]]
    passes: list[list[Frame]] = []
    start = clock()
    while len(passes) < repeats and (not passes or clock() - start < _PATIENCE_S):
        frames = render_frames(stage, numbers, rasterizer, clock=clock)
        passes.append([_without_pictures(frame) for frame in frames])
    return passes


def _without_pictures(frame: Frame) -> Frame:
    return replace(frame, image=frame.image[:0].copy(), radiance=frame.radiance[:0].copy())


def _repetitions(frames: Sequence[Frame], stages: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Seconds by stage, one for each repetition of the same frame; stages that the film does not have are left out."""
    return {
        name: tuple(frame.seconds[name] for frame in frames)
        for name in stages
        if all(name in f.seconds for f in frames)
    }
