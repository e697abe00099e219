"""Frames of several scenes, ready to be drawn, on which the figures of a comparison are measured."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from golden_cases import SCENE

from renderer.bricks import BrickBatch, BrickCut
from renderer.draw import BrickRasterizer, Rasterizer, SplatRasterizer
from renderer.frame import (
    DrawList,
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
from renderer.scene import Scene, load_scene, tolerance_at
from renderer.splats import SplatBatch
from renderer.view import View
from renderer.volume import UInt8, UInt32, Volume

CONFIGS = SCENE.parents[2] / "configs"

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
        """The scene as the command reads it."""
        return load_scene(self.file, overrides=self.changes, is_single_frame=True)


_TRANSPARENT = "output.background=transparent"
_COARSE = "error.tolerance=0.8"
_SPLATS = "splat={footprint: gaussian}"
_SOLID = (
    "transfer_function={unit: 1.0, points: [{value: 40, color: '#4060c0', opacity: 0}, {value: 90, color: '#40a060',"
    " opacity: 0.9}, {value: 255, color: '#f0e0c0', opacity: 1}]}"
)

SPLATS = (
    Subject("turntable", "glass and steel, fine, 96 x 96", SCENE, frame=4),
    Subject("coarse", "the same as few large cells, 96 x 96", SCENE, (_COARSE,)),
    Subject("transparent", "the same without a background, 96 x 96", SCENE, (_TRANSPARENT,)),
    Subject("near_plane", "clipped by the near plane, 96 x 96", SCENE, ("camera.distance=70", "camera.near=66")),
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

# The same frames with the default footprint.
BRICKS = tuple(
    replace(subject, name=f"bricks_{subject.name}", changes=(*subject.changes, "splat=null"))
    for subject in SPLATS
    if subject.name != "gouraud"
)


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
        """Draw a frame by the product's own last step."""
        return draw_frame(draw_list, self.rasterizer if rasterizer is None else rasterizer, _stopwatch())


@dataclass(frozen=True)
class Change:
    """A change of a frame's picture.

    make: draws a shot with it; returns None where there is nothing to change. level: the strictest at which it has to
    pass; None for a defect. of: the splats or bricks that it is made for, unless it is for both.
    """

    name: str
    make: Callable[[Shot], Pixels | None]
    level: str | None = None
    of: type[SplatBatch | BrickBatch] | None = None

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
