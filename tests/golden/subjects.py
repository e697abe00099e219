"""Frames of several scenes, ready to be drawn, on which the figures of a comparison are measured."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from golden_cases import SCENE

from hsplat_cli.scenes import SceneRequest, load_job
from renderer.accuracy import FrameProber, open_prober, psnr
from renderer.bricks import BrickBatch, BrickCut
from renderer.draw import BrickRasterizer, Rasterizer, SplatRasterizer
from renderer.film import quantize
from renderer.frame import (
    DrawList,
    FilmAnnotation,
    Frame,
    Stage,
    Stopwatch,
    draw_frame,
    finest_level_at,
    make_draw_list,
    make_primitive,
    prepare_stage,
)
from renderer.pyramid import Cut, cut_pyramid
from renderer.scene import Background, Scene, tolerance_at
from renderer.splats import SplatBatch
from renderer.view import View
from renderer.volume import Bools, Float32, UInt8, UInt32, Volume

Pixels = UInt8


@dataclass(frozen=True)
class Subject:
    """A frame of a scene file with changes, as `--set` takes them. what: a short description."""

    name: str
    what: str
    file: Path
    changes: tuple[str, ...] = ()
    frame: int = 0

    @property
    def scene(self) -> Scene:
        """The scene at its frame, with nothing left open, as the command reads it."""
        return load_job(SceneRequest(self.file, self.changes), "nothing").scene.at(self.frame)


_POINTS = (
    "transfer_function={unit: 1.0, points: [{value: 40, color: '#4060c0', opacity: 0}, {value: 110, color: '#40a060',"
    " opacity: 0.15}, {value: 170, color: '#e0a040', opacity: 0.3}, {value: 255, color: '#f0e0c0', opacity: 0.9}]}"
)
_DEFAULT = "splat=null"
_GOURAUD = "splat={footprint: gouraud, angular: 6, radial: 2}"
_TRANSPARENT = "output.background=transparent"


def _volume(name: str, shape: str, more: str = "") -> str:
    return f"volume={{procedural: {{name: {name}, shape: {shape}{more}}}}}"


_MEMBRANES = (_volume("cell_membranes", "[56, 48, 40]"), _POINTS, "output.size=[160, 120]")
_HEART = (_volume("beating_heart", "[40, 40, 40]", ", phase: 0.3"), _POINTS, "output.size=[112, 112]", _TRANSPARENT)
_NUCLEI = (_volume("cell_nuclei", "[80, 64, 48]"), _POINTS, "error.tolerance=0.1", "output.size=[128, 128]")
_RINGS = (_volume("marschner_lobb", "[41, 41, 41]"), _POINTS, "error.tolerance=0.08", "camera.distance=55",
          "output.size=[160, 160]")  # fmt: skip
_BLOCK = (_volume("engine_block", "[64, 40, 32]", ", seed: 9"), "output.background='#ffffff'", "output.size=[144, 144]")
_ATLAS = (
    "volume={procedural: {name: atlas, shape: [40, 36, 32], seed: 5}}",
    "transfer_function=null",
    "labels={opacity: 0.6, colors: auto}",
    "output.size=[128, 128]",
)
_ANNOTATION = (
    "annotation={layout: over, title: Block, time: 'frame {frame}', scale_bar: true, orientation: true,"
    " color_bar: true}"
)

SPLATS = (
    Subject("membranes", "five hollow cells", SCENE, _MEMBRANES, frame=3),
    Subject("heart", "a heart without a background", SCENE, _HEART, frame=7),
    Subject("nuclei", "five filled cells, coarse", SCENE, _NUCLEI, frame=5),
    Subject("rings", "the signal of Marschner and Lobb, nearer to the eye", SCENE, (*_RINGS, _GOURAUD), frame=2),
)

# All but `rings` have pixels of several rays.
BRICKS = (
    Subject("lit_membranes", "five hollow cells in light", SCENE, (*_MEMBRANES, _DEFAULT, "shading={}"), frame=3),
    Subject("clear_heart", "a heart without a background", SCENE, (*_HEART, _DEFAULT), frame=7),
    Subject("coarse_nuclei", "five filled cells, coarse", SCENE, (*_NUCLEI, _DEFAULT), frame=5),
    Subject("near_rings", "the signal of Marschner and Lobb, nearer to the eye", SCENE, (*_RINGS, _DEFAULT), frame=2),
    Subject("block", "another engine block before white", SCENE, (*_BLOCK, _DEFAULT), frame=9),
    Subject("labels", "a ball of 200 labels", SCENE, (*_ATLAS, _DEFAULT), frame=6),
    Subject("annotated", "the block with a title, a time, bars and axes", SCENE, (
        *_BLOCK, _DEFAULT, "output.size=[240, 200]", _ANNOTATION), frame=4),
)  # fmt: skip


class Shot:
    """The frame of a subject on its stage, and its correct picture.

    of_splats: draws splats. of_bricks: draws bricks.
    """

    def __init__(self, subject: Subject, of_splats: SplatRasterizer, of_bricks: BrickRasterizer) -> None:
        self.subject = subject
        self.stage = self.staged(subject.scene)
        self.rasterizer: Rasterizer = of_splats if self.stage.scene.needs_opengl else of_bricks
        self.tolerance = tolerance_at(self.stage.scene.error, subject.frame)
        self.draw_list = self.make_draw_list(self.stage)

    def __str__(self) -> str:
        return self.subject.name

    @cached_property
    def frame(self) -> Frame:
        """The frame as the product draws it."""
        return self.drawn(self.draw_list)

    @property
    def golden(self) -> Pixels:
        """uint8 [h, w, 3 or 4]."""
        return self.frame.image

    @property
    def batch(self) -> SplatBatch | BrickBatch:
        """All splats or bricks of the cut."""
        batch: SplatBatch | BrickBatch = self.draw_list.lod.batches[0]
        return batch

    @property
    def order(self) -> UInt32:
        """Return the visible cells, in the order in which they are drawn."""
        return self.draw_list.orders[0][1][0]

    @cached_property
    def cut(self) -> Cut | BrickCut:
        """The cells that the splats were made of, or the bricks."""
        if isinstance(self.batch, BrickBatch):
            return self.batch.cut
        finest_level = finest_level_at(self.stage, self.tolerance)
        return cut_pyramid(self.stage.layers[0].pyramid, self.tolerance, finest_level=finest_level)

    @property
    def view(self) -> View:
        """Where the camera is."""
        return self.draw_list.view

    def staged(self, scene: Scene, volume: Volume | None = None) -> Stage:
        """Return the stage of a scene, or of the scene with another volume."""
        volumes = None if volume is None else [volume]
        return prepare_stage(scene, clock=time.perf_counter, num_threads=1, volumes=volumes)

    def make_draw_list(self, stage: Stage, *, tolerance: float | None = None, frame: int | None = None) -> DrawList:
        """Prepare a frame on a stage, by default at the tolerance and of the number of the subject."""
        lod = make_primitive(stage).make_lod(self.tolerance if tolerance is None else tolerance, _stopwatch().lap)
        return make_draw_list(stage, lod, self.subject.frame if frame is None else frame, _stopwatch())

    def drawn_of(self, batch: SplatBatch | BrickBatch) -> Pixels:
        """Draw other splats or bricks from the same view."""
        return self.seen_from(self.view, replace(self.draw_list.lod, batches=[batch]))

    def seen_from(self, view: View, lod: Any = None) -> Pixels:
        """Draw a level of detail, by default this frame's, from another view."""
        lod = self.draw_list.lod if lod is None else lod
        return self.drawn(replace(self.draw_list, lod=lod, view=view, orders=lod.orders(view))).image

    def drawn(self, draw_list: DrawList, rasterizer: Rasterizer | None = None) -> Frame:
        """Draw a frame by the product's own last step, with its annotation."""
        frame = draw_frame(draw_list, self.rasterizer if rasterizer is None else rasterizer, _stopwatch())
        return replace(frame, image=self.finished(frame.radiance))

    def finished(self, radiance: Float32, background: Background | None = None, *, shift: int = 0) -> Pixels:
        """Return the picture of a radiance: annotated, over a background, by default the scene's, and rounded.

        shift: the distance by which the annotation is too far to the right, in pixels.
        """
        output = self.stage.scene.output
        if self.stage.scene.annotation.entries:
            radiance = np.roll(radiance, -shift, axis=1)
            FilmAnnotation(self.stage).draw(radiance, output.kind, self.stage, self.subject.frame, None)
            radiance = np.roll(radiance, shift, axis=1)
        return quantize(radiance, output.background if background is None else background)

    @cached_property
    def _prober(self) -> FrameProber:
        prober = open_prober(self.stage, 2)
        assert prober is not None
        return prober

    @cached_property
    def _covered(self) -> Bools | None:
        return FilmAnnotation(self.stage).covered(self.subject.frame, None)

    def stated(self, picture: Pixels) -> float:
        """Return the accuracy that a picture of this frame states, in dB: the low end of the interval of its probes."""
        exact = self._prober.exact_pixels(self.subject.frame, picture)
        return psnr(exact.compare_image(picture, self._covered).samples.interval[1])

    @cached_property
    def stated_by_golden(self) -> float:
        """Return the accuracy that the golden states, in dB."""
        return self.stated(self.golden)


@dataclass(frozen=True)
class Change:
    """A change of a frame's picture.

    make: draws a shot with it; returns None where there is nothing to change. limit: the strictest limit at which it
    has to pass; None for a defect. of: the splats or bricks that it is made for, unless it is for both. is_in_scene:
    whether exact rays have the defect, too, so that the picture states the accuracy of the golden.
    """

    name: str
    make: Callable[[Shot], Pixels | None]
    limit: str | None = None
    of: type[SplatBatch | BrickBatch] | None = None
    is_in_scene: bool = False

    def __str__(self) -> str:
        return self.name

    def picture(self, shot: Shot) -> Pixels | None:
        """Return the changed picture of a shot; None where there is nothing to change."""
        return self.make(shot) if self.of is None or isinstance(shot.batch, self.of) else None


def shifted(shot: Shot, pixels: float) -> Pixels:
    """Draw what lies at the target's distance further to the left."""
    view = shot.view
    step = pixels / view.scale_px * (view.distance if view.projection == "perspective" else 1.0)
    return shot.seen_from(replace(view, target=view.target + step * view.axes[0]))


def _stopwatch() -> Stopwatch:
    return Stopwatch(time.perf_counter)
