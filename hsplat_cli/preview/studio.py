"""Draws small pictures of a scene, from layers (pyramids and bricks) that are made once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from PIL import Image

from renderer.accuracy import FrameProber
from renderer.draw import Rasterizer
from renderer.film import Pixels, behind_rows
from renderer.frame import FilmStage, ScheduleController, StageMaker, prepare_stage
from renderer.job import DrawnFrame, draw_frames
from renderer.scene import AnnotationSpec, AnyScene, Background, FilmScene, OutputSpec, with_tolerance
from renderer.system import num_cores
from renderer.volume import Volume

# Tolerance of small pictures of a scene with an accuracy or a budget as its goal: a search for the tolerance that
# reaches the goal would take long.
TOLERANCE = 0.1
# Largest difference from the background, in grey steps of 255, at which a pixel counts as empty.
_UNSEEN = 2


@dataclass(frozen=True)
class Shot:
    """Holds a small picture with its caption.

    seen: a description for readers who cannot see the picture. lines: the lines of YAML that make it.
    """

    caption: str
    pixels: Pixels
    seen: str
    lines: str = ""


@dataclass
class Studio:
    """Draws similar scenes, one after the other, and reuses everything that a scene has in common with the last one."""

    rasterizer: Rasterizer
    maker: StageMaker = field(default_factory=lambda: StageMaker(num_cores(), any_tolerance=True))

    def stage(self, scene: FilmScene, volumes: Sequence[Volume] | None = None) -> FilmStage:
        """Return the stage of a scene. volumes: volumes that are drawn in place of the scene's volumes."""
        maker = self.maker if volumes is None else StageMaker(num_cores(), any_tolerance=True)
        return prepare_stage(scene, clock=time.perf_counter, num_threads=num_cores(), volumes=volumes, maker=maker)

    def draw(self, stage: FilmStage, frames: Sequence[int], num_rays: int = 0) -> list[DrawnFrame]:
        """Draw frames, with their annotation. num_rays: number of exact rays, which measure the accuracy."""
        prober = FrameProber(stage.first, num_rays, num_threads=num_cores()) if num_rays else None
        return [*draw_frames(stage, frames, self.rasterizer, ScheduleController(stage), prober)]

    def shoot(
        self, scene: FilmScene, frame: int, caption: str, lines: str, volumes: Sequence[Volume] | None = None
    ) -> Shot:
        """Draw one frame of a scene, with a caption.

        lines: the lines of YAML that make the picture. volumes: volumes in place of the scene's volumes.
        """
        with self.stage(scene, volumes) as stage:
            (drawn,) = self.draw(stage, [frame])
        return shot_of(drawn, scene.output.background_at(frame), caption, lines)


def small_scene(scene: AnyScene, side: int, *, is_annotated: bool = False) -> AnyScene:
    """Return the scene with a longer side of `side` pixels, and with a tolerance in place of a goal to reach."""
    output = scene.output
    width, height = (max(1, round(each * side / max(output.size))) for each in output.size)
    small = OutputSpec(Path("{frame}.png"), (width, height), output.frames_per_second, output.background)
    scene = scene if scene.error.goal is None else with_tolerance(scene, TOLERANCE)
    small_scene = scene.changed(lambda each: replace(each, output=small))
    return small_scene if is_annotated else small_scene.changed(lambda each: replace(each, annotation=AnnotationSpec()))


def shot_of(drawn: DrawnFrame, background: Background, caption: str, lines: str = "", side: int = 512) -> Shot:
    """Return the picture of a frame, reduced to at most `side` pixels along a side, and describe it."""
    picture = Image.fromarray(drawn.pictures[0].pixels)
    picture.thumbnail((side, side), Image.Resampling.LANCZOS)
    pixels = np.asarray(picture)
    behind = 255 * behind_rows(background, len(pixels))[:, None]
    differs = pixels[..., 3] if background is None else np.abs(pixels - behind).max(axis=2)
    share = float(np.mean(differs > _UNSEEN))
    return Shot(caption, pixels, f"the volume covers {100 * share:.0f} % of the picture", lines)
