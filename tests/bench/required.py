"""Measure that what a scene does not ask for costs nothing.

`python tests/bench/required.py DATA` writes docs/benchmarks/required.md. Each row does the same work without a demand
and with it, in turns: medians, where possible of CPU seconds of all threads, which a shared machine disturbs less.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from measuring import PAGES, ROOT, THREADS, medians_in_turns, parser_of

from hsplat_cli.terminal import describe_machine
from renderer.draw import CPURasterizer
from renderer.frame import Stage, prepare_stage, render_frames
from renderer.readers import read_volume
from renderer.scene import ControlPoint, Scene, TransferSpec, load_scene
from renderer.volume import Volume, make_volume

PAGE = PAGES / "required.md"
REPEATS = 7

HEAD = """# What a scene does not ask for

Footprint: `integrated`, the default, drawn by compiled loops. Measure again when the pyramid, the cut, bricks or the
start of a command change.

`python tests/bench/required.py DATA` writes this page. Each row does the same work twice: for a scene that does not ask
for something, and for one that does. Times are CPU milliseconds of all threads, of commands wall milliseconds, medians
of {repeats} runs that take turns.

Commit {commit}; {processor}, {cores} cores.

| the scene | it costs | and with | it costs | factor |
| --- | --- | --- | --- | --- |
"""


def main() -> None:
    arguments = parser_of(__doc__).parse_args()
    rows = [*little_visible(), *sections(arguments.data), *start()]
    print(*rows, sep="\n")
    head = HEAD.format(repeats=REPEATS, **describe_machine("compiled loops"))
    PAGE.write_text(head + "\n".join(rows) + "\n", encoding="utf-8")


def row(scene: str, costs: tuple[float, float], demand: str, unit: str) -> str:
    few, many = costs
    return f"| {scene} | {few:.3g} {unit} | {demand} | {many:.3g} {unit} | {many / few:.1f} |"


def little_visible() -> Iterator[str]:
    """Macrocells that show nothing are not classified, and not stored."""
    scene = load_scene(ROOT / "configs" / "demo.yaml")
    points = tuple(ControlPoint(value, (1.0, 0.5, 0.2), opacity) for value, opacity in ((125, 0.0), (250, 0.1)))
    scene = replace(scene, transfer_function=TransferSpec(points))
    for dtype in ("uint8", "float32"):
        noise = (np.random.default_rng(0).random((256, 256, 256), dtype=np.float32) * 250).astype(dtype)
        z, y, x = np.ogrid[-128:128, -128:128, -128:128]
        ball = x * x + y * y + z * z < 34**2
        half = make_volume(noise, np.eye(4), "half visible")
        little = make_volume(np.where(ball, noise, noise / 4).astype(dtype), np.eye(4), "0.5 % visible")
        nothing = make_volume((noise / 4).astype(dtype), np.eye(4), "nothing visible")
        for volume in (nothing, little):
            name = f"256^3 {dtype}, {volume.name}"
            yield row(f"{name}: building", timed(builder(scene, volume), builder(scene, half)), half.name, "ms")
            stages = builder(scene, volume)(), builder(scene, half)()
            megabytes = [stage.pyramid.num_bytes / 1e6 for stage in stages]
            if megabytes[0]:
                yield row(f"{name}: pyramid", (megabytes[0], megabytes[1]), half.name, "MB")


def sections(data: Path) -> Iterator[str]:
    """Lighting and fine levels cost only the scenes that ask for them."""
    path = ROOT / "configs" / "engine.yaml"

    def load(*changes: str) -> Scene:
        return load_scene(path, overrides=["error.tolerance=0.1", *changes], volume=data / "engine.nhdr")

    plain = load()
    volume = read_volume(plain.volume)
    for change, demand in (
        ("shading={}", "lighting"),
        ("error.tolerance=0", "`tolerance: 0`"),
    ):
        other = load(change)
        draw = timed(drawer(builder(plain, volume)()), drawer(builder(other, volume)()))
        yield row("engine at `tolerance: 0.1`: a frame", draw, demand, "ms")
        if other.shading:
            build = timed(builder(plain, volume), builder(other, volume))
            yield row("engine: building", build, demand, "ms")


def start() -> Iterator[str]:
    """Neither numpy nor OpenGL is loaded by commands that draw nothing."""

    def process(*words: str) -> Callable[[], object]:
        return lambda: subprocess.run([sys.executable, *words], check=True, cwd=ROOT, capture_output=True)

    loading = process("-c", "import renderer.frame.pipeline, renderer.draw.gl.raster")
    for words in (["--help"], ["check", "configs/demo.yaml"]):
        costs = timed(process("-m", "hsplat_cli", *words), loading, clock=time.perf_counter)
        yield row(f"`hsplat {words[0]}`", costs, "numpy, numba and OpenGL", "ms")


def builder(scene: Scene, volume: Volume) -> Callable[[], Stage]:
    return lambda: prepare_stage(scene, clock=time.perf_counter, num_threads=THREADS, volume=volume)


def drawer(stage: Stage) -> Callable[[], object]:
    """Return what draws the next frame of a film; its first one is drawn."""
    frames = render_frames(stage, range(3 * REPEATS), CPURasterizer(), clock=time.perf_counter)
    next(frames)
    return lambda: next(frames)


def timed(
    few: Callable[[], object], many: Callable[[], object], clock: Callable[[], float] = time.process_time
) -> tuple[float, float]:
    """Return the median milliseconds of both, run in turn, after one run of each that is not counted."""

    def taken(work: Callable[[], object]) -> float:
        begin = clock()
        work()
        return (clock() - begin) * 1e3

    first, second = medians_in_turns([partial(taken, few), partial(taken, many)], REPEATS)
    return first, second


if __name__ == "__main__":
    main()
