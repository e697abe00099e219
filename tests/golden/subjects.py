"""Frames of several scenes, ready to be drawn: what the figures of a comparison are measured on."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
from golden_cases import SCENE

from renderer.frame import (
    Frame,
    Rasterizer,
    Stage,
    Stopwatch,
    draw_frame,
    finest_level_at,
    make_draw_list,
    make_primitive,
    prepare_stage,
)
from renderer.frame.frame import DrawList
from renderer.frame.primitives import LOD, SplatLOD
from renderer.pyramid import Cut, cut_pyramid
from renderer.scene import Scene, load_scene, tolerance_at
from renderer.splats import SplatBatch
from renderer.view import View

CONFIGS = SCENE.parents[2] / "configs"

Pixels = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class Subject:
    """A frame of a scene file with changes, as `--set` takes them. what: it is, in a few words."""

    name: str
    what: str
    file: Path
    changes: tuple[str, ...] = ()
    frame: int = 0

    @property
    def scene(self) -> Scene:
        """As the command would have it."""
        return load_scene(self.file, overrides=self.changes, is_single_frame=True)


_TRANSPARENT = "output.background=transparent"
_COARSE = "error.tolerance=0.8"
_SPLATS = "splat={footprint: gaussian}"
_SOLID = (
    "transfer_function={unit: 1.0, points: [{value: 40, color: '#4060c0', opacity: 0}, {value: 90, color: '#40a060',"
    " opacity: 0.9}, {value: 255, color: '#f0e0c0', opacity: 1}]}"
)

SUBJECTS = (
    Subject("turntable", "glass and steel, fine, 96 x 96", SCENE, frame=4),
    Subject("coarse", "the same as few large cells, 96 x 96", SCENE, (_COARSE,)),
    Subject("transparent", "the same without a background, 96 x 96", SCENE, (_TRANSPARENT,)),
    Subject("near_plane", "cut open by the near plane, 96 x 96", SCENE, ("camera.distance=70", "camera.near=66")),
    Subject("inside", "the eye inside, 160 x 120", SCENE, (
        "camera.distance=6", "camera.field_of_view=70", "output.size=[160, 120]")),
    Subject("gouraud", "the paper's footprints, few large cells, 128 x 128", SCENE, (
        "splat={footprint: gouraud, angular: 6, radial: 2}", _COARSE, "output.size=[128, 128]")),
    Subject("empty", "a small thing in a large picture, 256 x 256", SCENE, (
        "camera.distance=900", "output.size=[256, 256]", "output.background='#000000'")),
    Subject("solid", "opaque and filling the picture, 256 x 256", SCENE, (
        _SOLID, "camera.distance=60", "output.size=[256, 256]")),
    Subject("demo", "configs/demo.yaml at a coarser tolerance, 384 x 384", CONFIGS / "demo.yaml", (
        _SPLATS, "error.tolerance=0.1"), frame=5),
    Subject("demo_clear", "the same without a background, 192 x 192", CONFIGS / "demo.yaml", (
        _SPLATS, "error.tolerance=0.1", "output={file: 'x.png', size: [192, 192], background: transparent}"), frame=31),
    Subject("rings", "configs/marschner_lobb.yaml, 512 x 512", CONFIGS / "marschner_lobb.yaml", (
        _SPLATS,), frame=11),
)  # fmt: skip


class Shot:
    """The frame of a subject on its stage, and what it looks like when it is drawn rightly."""

    def __init__(self, subject: Subject, rasterizer: Rasterizer) -> None:
        self.subject, self.rasterizer = subject, rasterizer
        self.stage = self.staged(subject.scene)
        self.tolerance = tolerance_at(self.stage.scene.error, subject.frame)
        self.draw_list = self.make_draw_list(self.stage)

    def __str__(self) -> str:
        return self.subject.name

    @cached_property
    def frame(self) -> Frame:
        """As the product draws it."""
        return self.drawn(self.draw_list)

    @property
    def golden(self) -> Pixels:
        """uint8 [h, w, 3 or 4]."""
        return self.frame.image

    @cached_property
    def cut(self) -> Cut:
        """What the splats were made of, cell by cell."""
        finest_level = finest_level_at(self.stage, self.tolerance)
        return cut_pyramid(self.stage.pyramid, self.tolerance, finest_level=finest_level)

    @property
    def splats(self) -> SplatBatch:
        """All that the cut has."""
        splats = self.draw_list.lod.batch
        assert isinstance(splats, SplatBatch)
        return splats

    @property
    def view(self) -> View:
        """Where the camera is."""
        return self.draw_list.view

    def staged(self, scene: Scene) -> Stage:
        """Another scene's stage, which serves coarser cuts, too."""
        return prepare_stage(scene, clock=time.perf_counter, num_threads=1)

    def make_draw_list(self, stage: Stage, *, tolerance: float | None = None, frame: int | None = None) -> DrawList:
        """A frame of a stage, this one unless it is said."""
        lod = make_primitive(stage).make_lod(self.tolerance if tolerance is None else tolerance, _stopwatch().lap)
        return make_draw_list(stage, lod, self.subject.frame if frame is None else frame, _stopwatch())

    def with_splats(self, splats: SplatBatch) -> DrawList:
        """The same pose of other splats."""
        lod = self.draw_list.lod
        assert isinstance(lod, SplatLOD)
        return self.seen_from(self.view, replace(lod, batch=splats))

    def seen_from(self, view: View, lod: LOD | None = None) -> DrawList:
        """The same detail, sorted for another view."""
        lod = self.draw_list.lod if lod is None else lod
        return replace(self.draw_list, lod=lod, view=view, orders=lod.orders(view))

    def drawn(self, draw_list: DrawList, rasterizer: Rasterizer | None = None) -> Frame:
        """By the product's own last step."""
        return draw_frame(self.stage, draw_list, self.rasterizer if rasterizer is None else rasterizer, _stopwatch())


def _stopwatch() -> Stopwatch:
    return Stopwatch(time.perf_counter)
