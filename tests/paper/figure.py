"""Describe a figure of the paper, and draw and time the frames that it needs."""

from __future__ import annotations

import statistics
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any

from hsplat_cli.measure import FRAME_STEPS
from hsplat_cli.reports import Chart
from renderer.accuracy import TRUTH_TOLERANCE, FloatImage, compute_truth
from renderer.draw import Rasterizer
from renderer.film import Pixels, over_background
from renderer.frame import Clock, Frame, Stage, prepare_stage, render_frames
from renderer.scene import Scene
from renderer.transfer import TransferFunction, make_transfer_function


@dataclass(frozen=True)
class Claim:
    """A statement of the paper, in our words, and whether measurements confirm it.

    criterion: what must be measured to confirm it. measured: what was measured.
    """

    statement: str
    criterion: str
    measured: str
    is_confirmed: bool


# Pictures side by side, by the title of the row: uint8 [h, w, 3] or, with straight alpha, [h, w, 4], and a caption.
PictureRows = Mapping[str, Sequence[tuple[Pixels, str]]]


@dataclass(frozen=True)
class PaperFigure:
    """A figure of the paper, without its number.

    drawings: paths of SVG from -1 to 1, and captions. tables: by caption; each line maps headings to cells, and its
    first cell is its heading. notes: differences from the paper.
    """

    title: str
    description: str
    claims: tuple[Claim, ...]
    rows: PictureRows
    charts: tuple[Chart, ...] = ()
    drawings: Sequence[tuple[str, str]] = ()
    tables: Mapping[str, Sequence[Mapping[str, str]]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class FigureRenderer:
    """A rasterizer, a clock that returns seconds, and a number of threads, which all figures share."""

    rasterizer: Rasterizer
    clock: Clock
    num_threads: int

    @contextmanager
    def open_stage(self, scene: Scene) -> Iterator[FigureStage]:
        """Prepare a scene for any tolerance."""
        with prepare_stage(scene, clock=self.clock, num_threads=self.num_threads, any_tolerance=True) as stage:
            yield FigureStage(stage, self)


@dataclass(frozen=True)
class FigureStage:
    """A stage whose first frame is drawn with other values of its scene's keys.

    Keys are those of `error`, but `measure` and `of`, on which the pyramid depends; of `splat`; and `annotation`.
    """

    base: Stage
    renderer: FigureRenderer

    @property
    def transfer(self) -> TransferFunction:
        """Return the transfer function, with extinctions per world unit."""
        look = self.base.scene.layers[0].transfer_function
        return make_transfer_function(look, self.base.layers[0].volume.finest_spacing)

    @property
    def extinction(self) -> float:
        """Return the extinction of a volume of one material, per world unit."""
        return float(self.transfer.classify(self.base.layers[0].volume.values.reshape(-1)[:1])[1][0])

    def draw(self, **keys: Any) -> Frame:
        """Draw the frame."""
        return next(self._frames(1, keys))

    def draw_levels(self, num_levels: int, **keys: Any) -> list[Frame]:
        """Draw the frame with the cells of each level."""
        return [self.draw(finest_level=level, **keys) for level in range(num_levels)]

    def median_seconds(self, num_frames: int, **keys: Any) -> float:
        """Return the median time of a frame whose cut exists; a first frame warms up and is not counted."""
        _, *frames = self._frames(1 + num_frames, keys)
        return statistics.median(sum(frame.seconds[name] for name in FRAME_STEPS) for frame in frames)

    def truth(self) -> FloatImage:
        """Integrate the frame to TRUTH_TOLERANCE: float64 [h, w, 3], over the scene's background."""
        return compute_truth(self.base, 0, TRUTH_TOLERANCE, num_threads=self.renderer.num_threads).picture

    def rgb(self, frame: Frame) -> FloatImage:
        """Return a picture over the scene's background, float64 [h, w, 3]."""
        return over_background(frame.radiance, self.base.scene.background)

    def _frames(self, num: int, keys: Mapping[str, Any]) -> Iterator[Frame]:
        scene = self.base.scene
        for name in ("error", "splat"):
            section = getattr(scene, name)
            own = {key: value for key, value in keys.items() if hasattr(section, key)}
            scene = replace(scene, **{name: replace(section, **own)})
        stage = replace(self.base, scene=replace(scene, annotation=keys.get("annotation", scene.annotation)))
        return render_frames(stage, [0] * num, self.renderer.rasterizer, clock=self.renderer.clock)
