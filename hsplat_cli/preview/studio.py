"""Draw small pictures of a scene, from layers that are made once."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from PIL import Image

from hsplat_cli.reports import webp_data_uri
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
    """A small picture as a page shows it. uri: of its data. seen: what is seen, in words. lines: of a scene."""

    caption: str
    uri: str
    size: tuple[int, int]
    seen: str
    lines: str = ""


@dataclass
class Studio:
    """Draws scenes that differ little, one after the other; what the last two have in common is made once."""

    rasterizer: Rasterizer
    maker: StageMaker = field(default_factory=lambda: StageMaker(num_cores(), any_tolerance=True))

    def stage(self, scene: Scene, volumes: Sequence[Volume] | None = None) -> Stage:
        """Return the stage of a scene. volumes: in place of the scene's."""
        maker = self.maker if volumes is None else None
        return prepare_stage(
            scene, clock=time.perf_counter, num_threads=num_cores(), volumes=volumes, maker=maker, any_tolerance=True
        )

    def draw(self, stage: Stage, frames: Sequence[int], num_rays: int = 0) -> list[DrawnFrame]:
        """Draw frames, with their annotation. num_rays: exact rays of each frame, by which it is known what is seen."""
        prober = FrameProber(stage, num_rays, num_threads=num_cores()) if num_rays else None
        drawn = draw_frames(stage, frames, self.rasterizer, ScheduleController(stage), prober)
        return [each.finished() for each in drawn]

    def shoot(self, scene: Scene, frame: int, caption: str, lines: str = "", volume: Volume | None = None) -> Shot:
        """Draw one frame of a scene."""
        with self.stage(scene, None if volume is None else [volume]) as stage:
            return shot_of(self.draw(stage, [frame])[0], scene.output.background, caption, lines=lines)


def small_scene(scene: Scene, side: int, *, is_annotated: bool = False) -> Scene:
    """Return a scene with pictures whose longer side has `side` pixels, for which no goal is searched."""
    factor = side / max(scene.output.size)
    width, height = (max(1, round(each * factor)) for each in scene.output.size)
    rate, background = scene.output.frames_per_second, scene.output.background
    scene = scene if scene.error.goal is None else with_tolerance(scene, TOLERANCE)
    annotation = scene.annotation if is_annotated else AnnotationSpec()
    return replace(
        scene, annotation=annotation, output=OutputSpec(Path("{frame}.png"), (width, height), rate, background)
    )


def pixels_of(drawn: DrawnFrame, side: int = 0) -> Pixels:
    """Return the picture of a frame; with `side` reduced, so that its longer side has at most so many pixels."""
    pixels = drawn.pictures[0].pixels
    if not side or max(pixels.shape[:2]) <= side:
        return pixels
    picture = Image.fromarray(pixels)
    picture.thumbnail((side, side), Image.Resampling.LANCZOS)
    return np.asarray(picture)


def shot_of(drawn: DrawnFrame, background: Background, caption: str, *, side: int = 0, lines: str = "") -> Shot:
    """Return the picture of a frame for the page."""
    pixels = pixels_of(drawn, side)
    share = covered_share(pixels, background)
    seen = f"what is visible covers {100 * share:.0f} % of the picture" if share else "nothing is visible"
    return Shot(caption, webp_data_uri(pixels), (pixels.shape[1], pixels.shape[0]), seen, lines)


def covered_share(pixels: Pixels, background: Background) -> float:
    """Return the share of a picture that differs from its background."""
    if pixels.shape[2] == 4:
        return float(np.mean(pixels[..., 3] > _UNSEEN))
    behind = 255 * behind_rows(background, len(pixels))[:, None]
    return float(np.mean(np.abs(pixels - behind).max(axis=2) > _UNSEEN))
