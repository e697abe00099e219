"""Measure what a frame costs when the same object has more voxels.

`python tests/bench/growth.py DATA` writes docs/benchmarks/growth.md.

Objects are sampled with 128, 256 and 512 voxels along their longest side and drawn at one size and one tolerance:
processor milliseconds of all threads for a warm frame, medians, the sizes in turn.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from measuring import PAGES, ROOT, SCENES, THREADS, machine_line, medians_in_turns, parser_of

from renderer.draw import BrickRasterizer
from renderer.frame import Stage, prepare_stage, render_frames
from renderer.readers import read_volume
from renderer.readers.procedural import procedural_values
from renderer.scene import ProceduralSource, Scene, load_scene, with_tolerance
from renderer.study import FRAME_STEPS
from renderer.volume import UInt8, make_volume

PAGE = PAGES / "growth.md"
SIZES, TOLERANCES = (128, 256, 512), (0.3, 0.1)
SIZE_PX, FRAME, REPEATS, GOAL = 512, 11, 7, 1.5

Values = UInt8


def main() -> None:
    arguments = parser_of(__doc__).parse_args()
    lines = [
        "# What more voxels cost",
        "",
        "Footprint: `integrated`, the default. Measure again when the cut, the brick cache, the CPU loops or screen "
        "sampling change.",
        "",
        f"`python tests/bench/growth.py DATA` writes this page. It draws one frame of {SIZE_PX} x {SIZE_PX} of the "
        "same object at the same tolerance. The columns 128, 256 and 512 are the number of voxels along the longest "
        f"side. Times are processor time of all threads for a warm frame, the median of {REPEATS} runs that take "
        f"turns. Goal: a factor of {GOAL:g} from 128 to 512, which has 64 times the voxels.",
        "",
        machine_line(),
        "",
        "| object | tolerance | 128 | 256 | 512 | 512 / 128 |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, scenes in objects(arguments.data):
        for line in rows(name, scenes):
            print(line, flush=True)
            lines.append(line)
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def objects(data: Path) -> Iterator[tuple[str, list[tuple[Scene, Values]]]]:
    """Name, and for each size a scene and its voxels; of all the spacing times the number of voxels is the same."""
    lobb = load_scene(ROOT / "configs" / "marschner_lobb.yaml", overrides=[f"transfer_function.unit={256 / 41}"])
    yield (
        "Marschner-Lobb",
        [(lobb, procedural_values(ProceduralSource("marschner_lobb", (size,) * 3))) for size in SIZES],
    )
    engine = load_scene(SCENES / "engine_close.yaml", volume=data / "engine.nhdr")
    values = np.asarray(read_volume(engine.volume).values)
    yield "engine", [(engine, resampled(values, size / max(values.shape))) for size in SIZES]


def resampled(values: Values, factor: float) -> Values:
    """Linear between voxel centres; each new one is the mean of those that it covers where it is larger."""
    found = values.astype(np.float32)
    for axis in range(3):
        along = np.moveaxis(found, axis, 0)
        if factor < 1:
            width = round(1 / factor)
            along = along.reshape(-1, width, *along.shape[1:]).mean(axis=1)
        else:
            at = (np.arange(round(len(along) * factor)) + 0.5) / factor - 0.5
            low = np.clip(np.floor(at).astype(int), 0, len(along) - 2)
            part = np.clip(at - low, 0, 1)[:, None, None].astype(np.float32)
            along = along[low] * (1 - part) + along[low + 1] * part
        found = np.moveaxis(along, 0, axis)
    return np.ascontiguousarray(np.rint(found).astype(np.uint8))


def rows(name: str, scenes: list[tuple[Scene, Values]]) -> Iterator[str]:
    """A row for each tolerance."""
    stages = [staged(scene, values) for scene, values in scenes]
    with ExitStack() as stack:
        # One for each, whose atlas holds its bricks from frame to frame, as in a film.
        drawn = [(stage, stack.enter_context(BrickRasterizer())) for stage in stages]
        for tolerance in TOLERANCES:
            works = [partial(frame_s, stage, tolerance, gl) for stage, gl in drawn]
            ms = [1e3 * seconds for seconds in medians_in_turns(works, REPEATS)]  # the first compiles, and uploads
            figures = " | ".join(f"{each:.1f} ms" for each in ms)
            yield f"| {name} | {tolerance:g} | {figures} | {ms[-1] / ms[0]:.2f} |"


def staged(scene: Scene, values: Values) -> Stage:
    """An object of 256 world units along its longest side, filling the picture alike however many voxels it has."""
    spacing = 256 / max(values.shape)
    world_from_index = np.diag([spacing, spacing, spacing, 1.0])
    size = np.array(values.shape[::-1]) * spacing
    world_from_index[:3, 3] = (spacing - size) / 2
    return prepare_stage(
        replace(
            scene,
            camera=replace(scene.camera, target=(0.0, 0.0, 0.0), distance=1.8 * 256),
            output=replace(scene.output, size=(SIZE_PX, SIZE_PX)),
        ),
        clock=time.process_time,
        num_threads=THREADS,
        volumes=[make_volume(values, world_from_index, "resampled")],
        any_tolerance=True,
    )


def frame_s(stage: Stage, tolerance: float, rasterizer: BrickRasterizer) -> float:
    """Processor seconds of a frame, without what is done once."""
    at = replace(stage, scene=with_tolerance(stage.scene, tolerance))
    (frame,) = render_frames(at, [FRAME], rasterizer, clock=time.process_time)
    return sum(frame.seconds[name] for name in FRAME_STEPS)


if __name__ == "__main__":
    main()
