"""Make stages of small films, one for each kind of data that a process needs to draw a film."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from renderer.frame import ScheduleController, Stage, prepare_stage
from renderer.job import FilmPlan
from renderer.scene import (
    AnnotationSpec,
    CameraSpec,
    ColormapSpec,
    ControlPoint,
    ErrorSpec,
    Keyframe,
    KeyframePath,
    KeySpec,
    LayerSpec,
    LightSpec,
    Motion,
    OutputSpec,
    ProceduralSource,
    PyramidSpec,
    Scene,
    ShadingSpec,
    SplatSpec,
    TransferSpec,
    TurntablePath,
    VolumeSpec,
    moving,
)
from renderer.volume import Volume, make_volume

POINTS = (
    ControlPoint(60.0, (0.2, 0.3, 0.9), 0.0),
    ControlPoint(90.0, (0.4, 0.6, 0.9), 0.05),
    ControlPoint(200.0, (1.0, 0.8, 0.4), 0.6),
)

PLAIN = Scene(
    layers=(LayerSpec(VolumeSpec(ProceduralSource("engine_block", (32, 28, 20))), TransferSpec(POINTS)),),
    camera=CameraSpec(TurntablePath(8, elevation=20.0)),
    output=OutputSpec(Path("film.mp4"), (40, 30)),
    error=ErrorSpec(0.05),
)
SPLATS = replace(PLAIN, splat=SplatSpec("gaussian"))
LIT = PLAIN.with_layers(shading=ShadingSpec())

KEYS = (Keyframe(0, 0.0, 0.0), Keyframe(3, 40.0, 30.0, 2.0), Keyframe(6, -20.0, 80.0))


def scheduled(*entries: tuple[int, float]) -> Any:
    """Return a value that moves over frames, as in the section `error`. entries: keys, each a frame and its value."""
    frames, values = zip(*entries, strict=True)
    return moving(Motion(frames, values, kind="ratio"))


SCENES = {
    "plain": PLAIN,
    "tolerance by frame": replace(PLAIN, error=ErrorSpec(scheduled((0, 0.5), (3, 0.5), (7, 0.01)))),
    "every voxel": replace(PLAIN, error=ErrorSpec(0.0)),
    "transparent": replace(PLAIN, output=OutputSpec(Path("{frame}.png"), (40, 30), background=None)),
    "gaussian": SPLATS,
    "gouraud": replace(PLAIN, splat=SplatSpec("gouraud")),
    "boxes": replace(SPLATS, splat=SplatSpec("gaussian", order="boxes")),
    "octree": replace(PLAIN, annotation=AnnotationSpec(octree=True)),
    "shading": LIT,
    "light": replace(PLAIN, light=LightSpec(key=KeySpec())),
    "means of opacity": replace(PLAIN, pyramid=PyramidSpec("opacity", "single"), error=ErrorSpec(0.02, "rms")),
    "errors of scalars": replace(PLAIN, error=ErrorSpec(9.0, "rms", "scalar", finest_level=1)),
    "keyframes": replace(PLAIN, camera=CameraSpec(KeyframePath(8, KEYS, False), "orthographic", target=(15, 14, 9))),
    "colormap": PLAIN.with_layers(
        transfer_function=TransferSpec(ColormapSpec("viridis", (50.0, 220.0), ((90.0, 0.0), (200.0, 0.5))), unit=2.0),
    ),
    "nothing to see": PLAIN.with_layers(transfer_function=TransferSpec((ControlPoint(0.0, (1.0, 1.0, 1.0), 0.0),))),
}


def stage_of(scene: Scene, volume: Volume | None = None) -> Stage:
    """Return the stage of a scene, prepared on one thread. volume: drawn in place of the scene's volume."""
    volumes = None if volume is None else [volume]
    return prepare_stage(scene, clock=itertools.count().__next__, num_threads=1, volumes=volumes)


def plan_of(stage: Stage) -> FilmPlan:
    """Return the plan that draws a stage at the tolerances of its scene."""
    return FilmPlan(stage, ScheduleController(stage))


def waves(dtype: str) -> Volume:
    """Return a sheared volume of smooth waves with values from 0 to 255."""
    z, y, x = np.indices((18, 22, 26))
    values = 127.5 + 127.5 * np.sin(x / 3.0) * np.cos(y / 4.0) * np.sin(z / 5.0 + x / 7.0)
    world_from_index = np.eye(4)
    world_from_index[:3] = [[1.0, 0.2, 0.0, 5.0], [0.0, 1.1, 0.1, -3.0], [0.1, 0.0, 0.9, 2.0]]
    return make_volume(values.astype(dtype), world_from_index, "waves")


# Scenes by name. If a scene has a dtype beside it, `waves` of this dtype are drawn in place of the scene's volume.
KINDS: dict[str, tuple[Scene, str | None]] = {name: (scene, None) for name, scene in SCENES.items()} | {
    "float32": (PLAIN, "float32"),
    "float32, shading": (LIT, "float32"),
    "float32, splats, shading": (SPLATS.with_layers(shading=ShadingSpec()), "float32"),
    "int16": (PLAIN, "int16"),
}


def stage_of_kind(kind: str) -> Stage:
    """Return the stage of a scene in KINDS. kind: the name of the scene."""
    scene, dtype = KINDS[kind]
    return stage_of(scene, None if dtype is None else waves(dtype))
