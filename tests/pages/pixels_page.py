"""Draw the pictures of docs/pixels.md: `python tests/pages/pixels_page.py [NAME ...]`, by default all.

Each shows a part of a frame at four times its size: on the left one exact ray through the centre of each pixel, on the
right the pixels of the film.
"""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from renderer.draw import open_rasterizer
from renderer.film import behind_rows, encode_png, over_rows
from renderer.frame import FilmStage, prepare_stage, render_frames, view_of
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import load_scene
from renderer.truth import SceneRays
from renderer.volume import UInt8

PAGE = Path(__file__).resolve().parents[2] / "docs" / "pixels.md"
PICTURES = PAGE.with_name("pixels")
# Width and height of the part that is shown, in pixels of the frame.
PART = (48, 36)
# How many pixels of the picture, along a side, show one of the frame.
ZOOM = 4
# Pixels of the picture between its two halves.
GAP = 8
# The convergence of the exact rays: far below the difference of two levels of 255.
RAY_TOLERANCE = 1e-4


class Crop(NamedTuple):
    """A part of a frame: the scene, and the upper left corner of the part in pixels."""

    corner: tuple[int, int]
    scene: str


CROPS = {
    "labels": Crop((40, 44), """\
volume: {procedural: {name: atlas, shape: [96, 96, 96]}}
labels: {}
shading: {light: [0.5, -0.8, 1], ambient: 0.45, diffuse: 0.6}
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [128, 128]}
"""),
    "metal": Crop((40, 44), """\
volume: {procedural: {name: engine_block, shape: [128, 128, 64]}}
transfer_function:
  points:
    - {value: 70, color: "#7f8b99", opacity: 0}
    - {value: 95, color: "#9aa7b5", opacity: 0.6}
    - {value: 180, color: "#e8b23a", opacity: 0.9}
shading: {light: camera, ambient: 0.3, diffuse: 0.6, specular: 0.5, occlusion: 0.6}
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [128, 128]}
"""),
    "wires": Crop((16, 22), """\
volume: {file: wires.npy}
transfer_function:
  points:
    - {value: 90, color: "#c03020", opacity: 0}
    - {value: 170, color: "#ff6040", opacity: 0.9}
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [80, 80]}
"""),
    "thumbnail": Crop((8, 14), """\
volume: {procedural: {name: engine_block, shape: [256, 256, 128]}}
transfer_function:
  points:
    - {value: 70, color: "#7f8b99", opacity: 0}
    - {value: 95, color: "#9aa7b5", opacity: 0.6}
    - {value: 180, color: "#e8b23a", opacity: 0.9}
shading: {light: [1, -1, 1], ambient: 0.3, diffuse: 0.7}
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [64, 64]}
"""),
    "face": Crop((40, 44), """\
volume: {procedural: {name: atlas, shape: [96, 96, 96]}}
labels: {}
shading: {light: [0.5, -0.8, 1], ambient: 0.45, diffuse: 0.6}
clip:
  - box: [[48, -1, 48], [96, 48, 96]]
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [128, 128]}
"""),
    "ripples": Crop((40, 44), """\
volume: {procedural: {name: marschner_lobb, shape: [96, 96, 96]}}
transfer_function:
  points:
    - {value: 118, color: "#2060c0", opacity: 0}
    - {value: 122, color: "#2060c0", opacity: 0.99}
    - {value: 150, color: "#ffd040", opacity: 0.99}
shading: {light: [0.5, -0.8, 1], ambient: 0.2, diffuse: 0.8}
camera: {target: visible, path: {type: turntable, frames: 1, start: 30, elevation: 25}}
output: {file: a.png, size: [128, 128]}
"""),
}  # fmt: skip


def main(names: list[str]) -> None:
    """Draw pictures, and print the bytes of each."""
    PICTURES.mkdir(exist_ok=True)
    for name in names or CROPS:
        file = PICTURES / f"{name}.png"
        file.write_bytes(encode_png(picture_of(CROPS[name])))
        print(file, file.stat().st_size)


def picture_of(crop: Crop) -> UInt8:
    """Return the two halves of a picture, uint8 [h, w, 3]."""
    with tempfile.TemporaryDirectory() as folder:
        np.save(Path(folder) / "wires.npy", wires())
        (Path(folder) / "scene.yaml").write_text(crop.scene, "utf-8")
        scene = resolve_scene(load_scene(Path(folder) / "scene.yaml"), read_volume)
        with (
            prepare_stage(scene, clock=time.perf_counter, num_threads=2) as stage,
            open_rasterizer(scene) as rasterizer,
        ):
            (frame,) = render_frames(stage, [0], rasterizer, clock=time.perf_counter)
            x, y = crop.corner
            film = frame.image[y : y + PART[1], x : x + PART[0]]
            halves = [enlarged(each) for each in (rays_through_centres(stage, crop.corner), film)]
    between = np.full((halves[0].shape[0], GAP, 3), 255, np.uint8)
    return np.concatenate([halves[0], between, halves[1]], axis=1)


def rays_through_centres(stage: FilmStage, corner: tuple[int, int]) -> UInt8:
    """Return the part of the frame in which each pixel is one exact ray, uint8 [h, w, 3]."""
    first = stage.first
    row, column = np.divmod(np.arange(PART[0] * PART[1]), PART[0])
    places = np.stack([corner[0] + column + 0.5, corner[1] + row + 0.5], axis=1)
    radiance, _ = SceneRays(first).converge(view_of(first, 0), places, RAY_TOLERANCE)
    behind = np.repeat(behind_rows(first.scene.background, PART[1]), PART[0], axis=0)
    colors = over_rows(radiance[:, None], behind)[:, 0]
    return np.rint(255 * colors).astype(np.uint8).reshape(PART[1], PART[0], 3)


def enlarged(part: UInt8) -> UInt8:
    """Return a part of a frame with each pixel as a square."""
    return np.repeat(np.repeat(part, ZOOM, axis=0), ZOOM, axis=1)


def wires() -> UInt8:
    """Return a volume of a few wires, one voxel thick, that wind around an axis: uint8 [z, y, x]."""
    size, values = 160, np.zeros((160, 160, 160), np.float32)
    along = np.linspace(0.0, 1.0, 4000)
    z, y, x = np.mgrid[-2:3, -2:3, -2:3]
    for start in range(5):
        angle = 2 * np.pi * (start / 5 + (1 + start % 3) * along)
        radius = (0.12 + 0.07 * start) * size * (0.6 + 0.4 * np.sin(3 * angle / (1 + start % 3)))
        path = np.stack([6 + (size - 12) * along, size / 2 + radius * np.sin(angle), size / 2 + radius * np.cos(angle)])
        for point in path.T:
            k, j, i = np.rint(point).astype(int)
            near = np.s_[k - 2 : k + 3, j - 2 : j + 3, i - 2 : i + 3]
            distance = np.sqrt((z + k - point[0]) ** 2 + (y + j - point[1]) ** 2 + (x + i - point[2]) ** 2)
            values[near] = np.maximum(values[near], 255 * np.clip(1.3 - distance, 0.0, 1.0))
    return values.astype(np.uint8)


if __name__ == "__main__":
    main(sys.argv[1:])
