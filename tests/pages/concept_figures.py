"""Draw the figures of docs/concepts: `python tests/pages/concept_figures.py [NAME ...]`, by default all.

A figure is rows of panels, and a panel is a frame of a scene. Captions are titles that hsplat draws.
"""

from __future__ import annotations

import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from renderer import ExactImage, Scene, integrate, load_scene, render_frame
from renderer.accuracy import psnr
from renderer.film import behind_rows, over_rows
from renderer.frame import prepare_stage, view_of
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.truth import SceneRays
from renderer.volume import UInt8

PAGES = Path(__file__).resolve().parents[2] / "docs" / "concepts"
# Pixels between two panels, which are transparent.
GAP = 8
# How many pixels of a figure, along a side, show one of an enlarged frame.
ZOOM = 4
# The convergence of exact rays: far below the difference of two levels of 255.
RAY_TOLERANCE = 1e-4
# Maps of errors are this many times as bright as the errors.
ERROR_GAIN = 8
# The quality of WebP, from 0 to 100: the largest figure has 40 kB.
QUALITY = 88

ENGINE = """\
volume: {procedural: {name: engine_block, shape: [128, 128, 64]}}
transfer_function:
  points:
    - {value: 70, color: "#7f8b99", opacity: 0}
    - {value: 95, color: "#9aa7b5", opacity: 0.6}
    - {value: 180, color: "#e8b23a", opacity: 0.9}
shading: {light: [1, -1, 1], ambient: 0.3, diffuse: 0.7}
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [256, 256], background: "#10141a"}
"""
# In smaller pictures, as exact ones take long. The object is framed with a caption as without one.
SMALL_ENGINE = ENGINE.replace("[256, 256]", "[200, 200]") + "annotation: {layout: over}\n"
GLASS = """\
volume: {procedural: {name: engine_block, shape: [128, 128, 64]}}
transfer_function:
  unit: 1
  points:
    - {value: 60, color: "#4d73cc", opacity: 0}
    - {value: 85, color: "#6699e6", opacity: 0.02}
    - {value: 125, color: "#80a6e6", opacity: 0.02}
    - {value: 145, color: "#f2b04d", opacity: 0.25}
    - {value: 200, color: "#ffd28c", opacity: 0.5}
    - {value: 255, color: "#fff2d9", opacity: 0.7}
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [256, 256], background: "#10141a"}
"""
SLICE = """\
volume: {procedural: {name: porous_rock, shape: [128, 128, 128]}, crop: {z: [64, 65]}}
transfer_function:
  points:
    - {value: 100, color: "#d8b98a", opacity: 0}
    - {value: 125, color: "#d8b98a", opacity: 0.9}
splat: {footprint: gaussian}
camera: {target: visible, projection: orthographic, path: {type: turntable, frames: 1, elevation: 90}}
annotation: {octree: true}
output: {file: a.png, size: [320, 360], background: "#10141a"}
"""
STUDIO = """\
volume: {procedural: {name: engine_block, shape: [128, 128, 64]}}
transfer_function:
  points:
    - {value: 70, color: "#c8642d", opacity: 0}
    - {value: 95, color: "#d0763c", opacity: 0.6}
    - {value: 140, color: "#d8cfc0", opacity: 0.8}
    - {value: 180, color: "#f0e9dc", opacity: 0.9}
clip:
  - box: [[64, -1, 32], [128, 64, 64]]
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [256, 256], background: "#10141a"}
"""
VESSELS = """\
volume: {procedural: {name: vessels, shape: [192, 128, 256]}}
labels: {colors: {1: "#e04a3b", 2: "#5b86e0"}}
shading: {light: [0.5, -0.8, 1], ambient: 0.45, diffuse: 0.6}
camera: {target: visible, path: {type: turntable, frames: 1, start: 20, elevation: 20}}
output: {file: a.png, size: [256, 320], background: "#10141a"}
"""
ATLAS = """\
volume: {procedural: {name: atlas, shape: [96, 96, 96]}}
labels: {}
shading: {light: [0.5, -0.8, 1], ambient: 0.45, diffuse: 0.6}
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [256, 256], background: "#10141a"}
"""
RINGS = """\
volume: {procedural: {name: marschner_lobb, shape: [96, 96, 96]}}
transfer_function:
  points:
    - {value: 118, color: "#2060c0", opacity: 0}
    - {value: 122, color: "#2060c0", opacity: 0.99}
    - {value: 150, color: "#ffd040", opacity: 0.99}
shading: {light: [0.5, -0.8, 1], ambient: 0.2, diffuse: 0.8}
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [256, 256], background: "#10141a"}
"""


# The light of STUDIO.
STUDIO_LIGHT = 'environment: studio, key: {direction: [0.5, -0.8, 1], color: "#fff2e0", strength: 2.5, radius: 12}'


class Panel(NamedTuple):
    """A frame of a figure: the text of a scene, changes of its keys, and the caption over the frame."""

    scene: str
    changes: tuple[str, ...] = ()
    caption: str = ""


class Figure(NamedTuple):
    """A figure: its panels, and the function that draws the pictures of one of them, which are a column."""

    panels: tuple[Panel, ...]
    draw: Callable[[Panel], Sequence[UInt8]]


def drawn(panel: Panel) -> list[UInt8]:
    """Return the picture of a panel."""
    return [np.asarray(render_frame(scene_of(panel)))]


def with_errors(panel: Panel) -> list[UInt8]:
    """Return the picture of a panel, with its accuracy in the caption, and the map of its errors."""
    scene = scene_of(panel._replace(caption=""))
    error = render_frame(scene) / 255.0 - exact_picture(panel.scene)
    caption = f"{panel.caption}: {psnr(float(np.mean(error**2))):.0f} dB"
    brightness = np.clip(ERROR_GAIN * np.abs(error).max(axis=2, keepdims=True), 0.0, 1.0)
    return [*drawn(panel._replace(caption=caption)), np.rint(255 * brightness).astype(np.uint8).repeat(3, axis=2)]


@cache
def exact_picture(text: str) -> ExactImage:
    """Return the exact picture of a scene, which no tolerance changes. It takes a minute."""
    return integrate(scene_of(Panel(text)))


def ray_and_mean(panel: Panel) -> list[UInt8]:
    """Return two enlarged pictures of a panel: of one exact ray through the centre of each pixel, and as drawn."""
    scene = resolve_scene(scene_of(panel), read_volume)
    width, height = scene.output.size
    with prepare_stage(scene, clock=time.perf_counter, num_threads=2) as stage:
        first = stage.first
        row, column = np.divmod(np.arange(width * height), width)
        places = np.stack([column + 0.5, row + 0.5], axis=1)
        radiance, _ = SceneRays(first).converge(view_of(first, 0), places, RAY_TOLERANCE)
        behind = np.repeat(behind_rows(first.scene.background, height), width, axis=0)
    rays = np.rint(255 * over_rows(radiance[:, None], behind)).astype(np.uint8).reshape(height, width, 3)
    return [each.repeat(ZOOM, axis=0).repeat(ZOOM, axis=1) for each in (rays, *drawn(panel))]


FIGURES = {
    "pyramid": Figure(
        tuple(
            Panel(VESSELS, ("shading=null", "error.tolerance=1e-6", f"error.finest_level={level}"), f"level {level}")
            for level in (0, 2, 4)
        ),
        drawn,
    ),
    "cut": Figure(
        tuple(Panel(SLICE, (f"error.tolerance={tolerance}",), f"tolerance {tolerance}") for tolerance in (4, 0.4)),
        drawn,
    ),
    "pixel": Figure((Panel(VESSELS, ("output.size=[72, 96]", "error.tolerance=0.05")),), ray_and_mean),
    "pixel_kinds": Figure(
        tuple(Panel(scene, ("output.size=[64, 64]", "error.tolerance=0.05")) for scene in (ATLAS, ENGINE, RINGS)),
        ray_and_mean,
    ),
    "unit": Figure(
        tuple(Panel(GLASS, (f"transfer_function.unit={unit}",), f"unit: {unit}") for unit in (0.25, 1, 4)), drawn
    ),
    "tolerance": Figure(
        tuple(Panel(SMALL_ENGINE, (f"error.tolerance={tolerance}",), f"{tolerance}") for tolerance in (2, 0.5, 0.1)),
        with_errors,
    ),
    "light": Figure(
        (
            Panel(STUDIO, ("shading={light: [0.5, -0.8, 1], ambient: 0.35, diffuse: 0.65}",), "shading"),
            Panel(STUDIO, (f"light={{{STUDIO_LIGHT}}}",), "light"),
            Panel(STUDIO, (f"light={{{STUDIO_LIGHT}, surface: 0.9}}",), "surface: 0.9"),
        ),
        drawn,
    ),
}


def scene_of(panel: Panel) -> Scene:
    """Return the scene of a panel, with its caption as the title."""
    title = f'annotation.title={{position: top, size: 0.1, text: "{panel.caption}"}}'
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.yaml"
        file.write_text(panel.scene, "utf-8")
        return load_scene(file, overrides=[*panel.changes, *([title] if panel.caption else [])])


def picture_of(figure: Figure) -> UInt8:
    """Return a figure, uint8 [h, w, 4] with alpha: each panel is a column, or a row if it is the only one."""
    columns = [figure.draw(panel) for panel in figure.panels]
    if len(columns) == 1:
        columns = [[picture] for picture in columns[0]]
    return _joined([_joined(column, axis=0) for column in columns], axis=1)


def _joined(pictures: Sequence[UInt8], *, axis: int) -> UInt8:
    """Return pictures beside each other along an axis, with transparent gaps."""
    parts = list[UInt8]()
    for picture in pictures:
        alpha = np.full((*picture.shape[:2], 1), 255, np.uint8)
        whole = picture if picture.shape[2] == 4 else np.concatenate([picture, alpha], axis=2)
        gap = np.zeros_like(whole[:GAP] if axis == 0 else whole[:, :GAP])
        parts += [whole, gap]
    return np.concatenate(parts[:-1], axis=axis)


def main(names: list[str]) -> None:
    """Draw figures, and print the bytes of each."""
    for name in names or FIGURES:
        file, start = PAGES / f"{name}.webp", time.perf_counter()
        figure = FIGURES[name]
        is_enlarged = figure.draw is ray_and_mean  # its squares keep their edges, in few bytes
        Image.fromarray(picture_of(figure)).save(file, quality=QUALITY, method=6, lossless=is_enlarged)
        print(f"{file.name}: {file.stat().st_size} bytes, {time.perf_counter() - start:.0f} s")


if __name__ == "__main__":
    main(sys.argv[1:])
