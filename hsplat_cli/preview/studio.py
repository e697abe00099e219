"""Draw small pictures of a scene, from layers that are made once."""

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
from renderer.frame import ScheduleController, Stage, StageMaker, prepare_stage
from renderer.job import DrawnFrame, draw_frames
from renderer.scene import AnnotationSpec, Background, OutputSpec, Scene, with_tolerance
from renderer.system import num_cores
from renderer.volume import Volume

# In place of a goal, for which films search.
TOLERANCE = 0.1
# What differs less from the background, of 255, is not seen.
_UNSEEN = 2


@dataclass(frozen=True)
class Shot:
    """A small picture with its caption. seen: what is seen, in words. lines: of a scene."""

    caption: str
    pixels: Pixels
    seen: str
    lines: str = ""


@dataclass
class Studio:
    """Draws scenes that differ little, one after the other; what the last two have in common is made once."""

    rasterizer: Rasterizer
    maker: StageMaker = field(default_factory=lambda: StageMaker(num_cores(), any_tolerance=True))

    def stage(self, scene: Scene, volumes: Sequence[Volume] | None = None) -> Stage:
        """Return the stage of a scene. volumes: in place of the scene's."""
        maker = self.maker if volumes is None else StageMaker(num_cores(), any_tolerance=True)
        return prepare_stage(scene, clock=time.perf_counter, num_threads=num_cores(), volumes=volumes, maker=maker)

    def draw(self, stage: Stage, frames: Sequence[int], num_rays: int = 0) -> list[DrawnFrame]:
        """Draw frames, with their annotation. num_rays: exact rays of each frame, by which it is known what is seen."""
        prober = FrameProber(stage, num_rays, num_threads=num_cores()) if num_rays else None
        return [*draw_frames(stage, frames, self.rasterizer, ScheduleController(stage), prober)]

    def shoot(
        self, scene: Scene, frame: int, caption: str, lines: str, volumes: Sequence[Volume] | None = None
    ) -> Shot:
        """Draw one frame of a scene. volumes: as of `stage`. lines: that make it."""
        with self.stage(scene, volumes) as stage:
            (drawn,) = self.draw(stage, [frame])
        return shot_of(drawn, scene.output.background, caption, lines)


def small_scene(scene: Scene, side: int, *, is_annotated: bool = False) -> Scene:
    """Return a scene with pictures whose longer side has `side` pixels, for which no goal is searched."""
    output = scene.output
    width, height = (max(1, round(each * side / max(output.size))) for each in output.size)
    small = OutputSpec(Path("{frame}.png"), (width, height), output.frames_per_second, output.background)
    scene = scene if scene.error.goal is None else with_tolerance(scene, TOLERANCE)
    return replace(scene, output=small, annotation=scene.annotation if is_annotated else AnnotationSpec())


def shot_of(drawn: DrawnFrame, background: Background, caption: str, lines: str = "", side: int = 512) -> Shot:
    """Return the picture of a frame, reduced where it has more pixels along a side, and say what is seen."""
    picture = Image.fromarray(drawn.pictures[0].pixels)
    picture.thumbnail((side, side), Image.Resampling.LANCZOS)
    pixels = np.asarray(picture)
    behind = 255 * behind_rows(background, len(pixels))[:, None]
    differs = pixels[..., 3] if background is None else np.abs(pixels - behind).max(axis=2)
    share = float(np.mean(differs > _UNSEEN))
    return Shot(caption, pixels, f"the volume covers {100 * share:.0f} % of the picture", lines)
