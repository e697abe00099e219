"""How exact and how fast is each mode? `python tests/bench/modes.py DATA` writes the page of it, and its picture.

Each projection is drawn at several tolerances and compared with the exact rays of all pixels. The page is
docs/benchmarks/modes.md, the picture docs/benchmarks/modes.png.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import imageio.v3 as iio
import numpy as np
from measuring import PAGES, THREADS, machine_line, parser_of

import renderer
from renderer.draw import CPURasterizer
from renderer.frame import Frame, Stage, open_stage, render_frames, view_of
from renderer.probes import psnr
from renderer.readers import read_volume
from renderer.scene import Scene, parse_scene, scene_to_dict, with_tolerance
from renderer.truth import SceneRays
from renderer.volume import Float64, UInt8

PAGE, PICTURE = PAGES / "modes.md", PAGES / "modes.png"
SIZE, FRAMES, ROUNDS = (512, 512), (5, 35), 5
TOLERANCES = (1.0, 0.3, 0.1, 0.03, 0.01, 0.0)
VOLUMES = {
    "engine, CT": "engine.nhdr",
    "bonsai, CT": "bonsai.nhdr",
    "abdomen, CT": "medical/CT_pitch.nii.gz",
    "Marschner-Lobb": {"procedural": {"name": "marschner_lobb", "shape": [96, 96, 96]}},
}
MODES = ("emission_absorption", "maximum", "maximum by depth", "minimum", "mean", "attenuation")
PICTURED_TOLERANCE = 0.1

HEAD = """# How exact and how fast is each mode?

Footprint: integrated. Measure again when a mode, the drawing of bricks or the choice of pixels changes.

`python tests/bench/modes.py DATA` writes this page and its picture. Frames {frames} of turntables, {width} x {height};
colours from the smallest scalar to the largest. PSNR is of the colours before they are rounded, against the exact rays
of all pixels; milliseconds by the clock of frames whose bricks are in memory, medians of {rounds} rounds, {threads}
threads. Emission and absorption is the suggested scene without a light. *First* is the time to build what all frames
share.

{machine}

Each row of the picture is a mode, in the order of the tables, at tolerance {pictured:g}.

![engine, bonsai, abdomen and Marschner-Lobb in each mode](modes.png)
"""


class Figures(NamedTuple):
    """A mode of a volume at one tolerance: decibels, milliseconds, seconds to prepare, and one picture."""

    psnr: float
    ms: float
    first: float
    image: UInt8


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    lines = [
        HEAD.format(
            frames=" and ".join(map(str, FRAMES)), width=SIZE[0], height=SIZE[1], rounds=ROUNDS, threads=THREADS,
            machine=machine_line(), pictured=PICTURED_TOLERANCE,
        )
    ]  # fmt: skip
    rows: list[list[UInt8]] = [[] for _ in MODES]
    for name, volume in VOLUMES.items():
        lines += [f"## {name}", "", "| mode | first | " + " | ".join(f"{t:g}" for t in TOLERANCES) + " |"]
        lines += ["|---|---|" + "---|" * len(TOLERANCES)]
        for row, mode in zip(rows, MODES, strict=True):
            found = list(measured(scene_of(data, volume, mode)))
            cells = " | ".join(f"{each.psnr:.1f} dB, {each.ms:.0f} ms" for each in found)
            lines.append(f"| {mode.replace('_', ' and ')} | {found[0].first:.2f} s | {cells} |")
            row.append(found[TOLERANCES.index(PICTURED_TOLERANCE)].image)
            print(lines[-1], flush=True)
        lines.append("")
    PAGE.write_text("\n".join(lines), encoding="utf-8")
    iio.imwrite(PICTURE, np.vstack([np.hstack([image[::2, ::2, :3] for image in row]) for row in rows]))


def scene_of(data: Path, source: str | dict[str, Any], mode: str) -> Scene:
    """Return the turntable of a volume in a mode."""
    tree: dict[str, Any]
    if isinstance(source, str):
        tree = scene_to_dict(renderer.suggest_scene(data / source, size=SIZE))
    else:
        points = [{"value": 110, "color": "black", "opacity": 0}, {"value": 200, "color": "white", "opacity": 0.4}]
        tree = {
            "volume": source, "transfer_function": {"points": points}, "output": {"file": "a.mp4", "size": list(SIZE)},
            "camera": {"path": {"type": "turntable", "frames": 120, "elevation": 20}},
        }  # fmt: skip
    tree.pop("shading", None)
    scene = parse_scene(tree, base=Path("/"))
    if mode == "emission_absorption":
        return scene
    low, high = read_volume(scene.volume).value_range()
    tree["transfer_function"] = {"colormap": "gray", "range": [low, high]}
    tree["mode"] = {"type": mode.split(maxsplit=1)[0]}
    if mode == "maximum by depth":
        tree["mode"]["color_by"], tree["transfer_function"]["colormap"] = "depth", "turbo"
    if mode == "attenuation":
        tree["mode"] |= {"scale": 0.1 / (high - low), "zero": low}
        tree["transfer_function"] = {"colormap": "gray_r", "range": [0, 1]}
    return parse_scene(tree, base=Path("/"))


def measured(scene: Scene) -> Iterator[Figures]:
    """Draw a scene at each tolerance, and compare it with its exact rays."""
    truths: list[Float64] = []
    for tolerance in TOLERANCES:
        at = with_tolerance(scene, tolerance)
        with (
            open_stage(at, clock=time.perf_counter, num_threads=THREADS) as stage,
            CPURasterizer(num_threads=THREADS) as rasterizer,
        ):
            truths = truths or [truth(stage, frame) for frame in FRAMES]
            rounds = [
                list(render_frames(stage, FRAMES, rasterizer, clock=time.perf_counter)) for _ in range(ROUNDS + 1)
            ]
            yield figures(stage, rounds, truths)


def drawn(stage: Stage, rasterizer: CPURasterizer) -> list[Frame]:
    """Draw the frames once."""
    return list(render_frames(stage, FRAMES, rasterizer, clock=time.perf_counter))


def truth(stage: Stage, frame: int) -> Float64:
    """Return the exact colours of a frame, float64 [h, w, 3]."""
    width, height = SIZE
    rays = SceneRays(stage, num_threads=THREADS)
    return rays.integrate(view_of(stage, frame), np.arange(width * height), 0.5).reshape(height, width, 4)[..., :3]


def figures(stage: Stage, rounds: Sequence[Sequence[Frame]], truths: Sequence[Float64]) -> Figures:
    """Return the figures of some rounds of frames, of which the first uploads bricks."""
    seconds = [sum(frame.seconds.values()) for frames in rounds[1:] for frame in frames]
    errors = [np.mean((frame.radiance[..., :3] - exact) ** 2) for frame, exact in zip(rounds[0], truths, strict=True)]
    first = sum(stage.seconds.values())
    return Figures(psnr(float(np.mean(errors))), median(seconds) * 1e3, first, rounds[0][1].image)


if __name__ == "__main__":
    main()
