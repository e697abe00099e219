"""How exact and how fast is each mode, light and clipping? `python tests/bench/modes.py DATA` writes the page of it.

Each is drawn at several tolerances and compared with the means over some pixels, by exact rays. The page is
build/benchmarks/modes.md, the picture build/benchmarks/modes.jpg.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import imageio.v3 as iio
import numpy as np
from measuring import PAGES, THREADS, SampledTruth, machine_line, parser_of, write_page

import renderer
from renderer.draw import BrickRasterizer
from renderer.film import over_background
from renderer.frame import FilmStage, Frame, prepare_stage, render_frames
from renderer.readers import read_volume
from renderer.scene import Scene, parse_scene, scene_to_dict, with_tolerance
from renderer.volume import UInt8, Volume

PAGE, PICTURE = PAGES / "modes.md", PAGES / "modes.jpg"
SIZE, FRAMES, ROUNDS = (512, 512), (5, 35), 3
TOLERANCES = (1.0, 0.3, 0.1, 0.03, 0.01)
VOLUMES = {
    "engine, CT": "engine.nhdr",
    "bonsai, CT": "bonsai.nhdr",
    "head, CT": "medical/CT_pitch.nii.gz",
    "Marschner-Lobb": {"procedural": {"name": "marschner_lobb", "shape": [96, 96, 96]}},
}
Change = Callable[[Volume], dict[str, Any]]


def projection(mode: str | dict[str, Any], colormap: str = "gray") -> Change:
    """Colour a projection from the smallest scalar to the largest."""

    def change(volume: Volume) -> dict[str, Any]:
        return {"mode": mode, "transfer_function": {"colormap": colormap, "range": list(volume.value_range())}}

    return change


def attenuation(volume: Volume) -> dict[str, Any]:
    """Let a tenth of the largest scalar's attenuation be left after ten lengths of the finest spacing or so."""
    low, high = volume.value_range()
    scale = 0.1 / (high - low) / volume.finest_spacing
    return {
        "mode": {"type": "attenuation", "scale": scale, "zero": low},
        "transfer_function": {"colormap": "gray_r", "range": [0, 1]},
    }


def lit(**shading: Any) -> Change:
    """Light the suggested scene."""
    return lambda _: {"shading": {"ambient": 0.5, "diffuse": 0.6, "light": [0.5, -0.8, 1]} | shading}


def gradient_opacity(volume: Volume) -> dict[str, Any]:
    """Show where the gradient is above a twentieth of the range in a finest spacing, and light it from the camera."""
    low, high = volume.value_range()
    per_spacing = (high - low) / volume.finest_spacing
    points = [[0.01 * per_spacing, 0], [0.1 * per_spacing, 1]]
    return lit(light="camera", specular=0.3, gradient_opacity=points)(volume)


def clip(fixed: str) -> Change:
    """Clip the lit object in the middle."""

    def change(volume: Volume) -> dict[str, Any]:
        point = volume.centre.tolist() if fixed == "object" else [0, 0, 0]
        normal = [1, -1, 0] if fixed == "object" else [0, 0, 1]
        return lit()(volume) | {"clip": [{"plane": {"point": point, "normal": normal}, "fixed": fixed}]}

    return change


def corner(volume: Volume) -> dict[str, Any]:
    """Clip a corner of the lit object."""
    (x, y, z), reach = volume.centre.tolist(), 2 * volume.half_diagonal
    box = [[x, y - reach, z], [x + reach, y, z + reach]]
    return lit()(volume) | {"clip": [{"box": box}]}


LOOKS: dict[str, Change] = {
    "emission and absorption": lambda _: {},
    "maximum": projection("maximum"),
    "maximum, by depth": projection({"type": "maximum", "color_by": "depth"}, "turbo"),
    "minimum": projection("minimum"),
    "mean": projection("mean"),
    "attenuation": attenuation,
    "fixed light": lit(),
    "light from the camera": lit(light="camera"),
    "camera, highlights": lit(light="camera", specular=0.3),
    "camera, highlights, gradient opacity": gradient_opacity,
    "occlusion": lit(occlusion=0.7),
    "occlusion, shadow": lit(occlusion=0.7, shadow=0.7),
    "plane": clip("object"),
    "plane before the camera": clip("camera"),
    "corner box": corner,
}
PICTURED_TOLERANCE = 0.1


class Figures(NamedTuple):
    """A mode of a volume at one tolerance: decibels, milliseconds, seconds to prepare, and one picture."""

    psnr: float
    ms: float
    first: float
    image: UInt8


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    lines = [machine_line(), ""]
    rows: dict[str, list[UInt8]] = {name: [] for name in LOOKS}
    for name, source in VOLUMES.items():
        lines += [f"## {name}", "", "| what | first | " + " | ".join(f"{t:g}" for t in TOLERANCES) + " |"]
        lines += ["|---|---|" + "---|" * len(TOLERANCES)]
        base = tree_of(data, source)
        volume = read_volume(parse_scene(base, base=Path("/")).layers[0].volume)
        for look, change in LOOKS.items():
            found = list(measured(parse_scene(base | change(volume), base=Path("/"))))
            cells = " | ".join(f"{decibels(each.psnr)}, {each.ms:.0f} ms" for each in found)
            lines.append(f"| {look} | {found[0].first:.2f} s | {cells} |")
            rows[look].append(found[TOLERANCES.index(PICTURED_TOLERANCE)].image)
            print(lines[-1], flush=True)
        lines.append("")
    write_page(PAGE, lines)
    pictures = [np.hstack([image[::3, ::3, :3] for image in row]) for row in rows.values()]
    iio.imwrite(PICTURE, np.vstack(pictures), quality=85)


def decibels(found: float) -> str:
    """Return a PSNR as text."""
    return f"{found:.1f} dB" if math.isfinite(found) else "not resolved"


def tree_of(data: Path, source: str | dict[str, Any]) -> dict[str, Any]:
    """Return the turntable of a volume without a light and clipping, as plain data."""
    if isinstance(source, str):
        tree = scene_to_dict(renderer.suggest_scene(data / source, size=SIZE))
        return {key: value for key, value in tree.items() if key not in ("shading", "clip")}
    points = [{"value": 110, "color": "black", "opacity": 0}, {"value": 200, "color": "white", "opacity": 0.4}]
    return {
        "volume": source, "transfer_function": {"points": points}, "output": {"file": "a.mp4", "size": list(SIZE)},
        "camera": {"path": {"type": "turntable", "frames": 120, "elevation": 20}},
    }  # fmt: skip


def measured(scene: Scene) -> Iterator[Figures]:
    """Draw a scene at each tolerance, and compare it with exact rays through some pixels."""
    with prepare_stage(scene, clock=time.perf_counter, num_threads=THREADS, any_tolerance=True) as stage:
        truth = SampledTruth(stage, FRAMES)
        for tolerance in TOLERANCES:
            at = replace(stage, scene=with_tolerance(stage.scene, tolerance))
            with BrickRasterizer(num_threads=THREADS) as rasterizer:
                rounds = [
                    list(render_frames(at, FRAMES, rasterizer, clock=time.perf_counter)) for _ in range(ROUNDS + 1)
                ]
            yield figures(at, rounds, truth)


def figures(stage: FilmStage, rounds: Sequence[Sequence[Frame]], truth: SampledTruth) -> Figures:
    """Return the figures of some rounds of frames, of which the first uploads bricks."""
    seconds = [sum(frame.seconds.values()) for frames in rounds[1:] for frame in frames]
    found = truth.psnr([over_background(frame.radiance, stage.scene.background) for frame in rounds[0]])
    return Figures(found, median(seconds) * 1e3, sum(stage.seconds.values()), rounds[0][1].image)


if __name__ == "__main__":
    main()
