"""Measure that what a scene does not ask for costs nothing.

`python tests/bench/required.py DATA` writes build/benchmarks/required.md. Each row does the same work without a demand
and with it, in turns: medians, where possible of CPU seconds of all threads, which a shared machine disturbs less.
"""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from pathlib import Path

import numpy as np
from measuring import PAGES, ROOT, THREADS, medians_in_turns, parser_of, section, write_page

from hsplat_cli.terminal import describe_machine
from renderer.draw import BrickRasterizer
from renderer.frame import Stage, prepare_stage, render_frames
from renderer.readers import read_volume
from renderer.scene import ControlPoint, Scene, TransferSpec, load_scene
from renderer.volume import Volume, make_volume

PAGE = PAGES / "required.md"
ENGINE = ROOT / "configs" / "engine.yaml"
REPEATS = 7

FIRST = f"Medians of {REPEATS} runs that take turns."
COLUMNS = "the scene | it costs | and with | it costs | factor"
SECOND = f"In memory are the pyramid, the light grid, and the texels of bricks after {REPEATS + 2} frames."
KEY_COLUMNS = "the scene | and with | building, ms | a frame, ms | in memory, MB | kernels"


# The camera must not move with what is visible.
COMMON = ("error.tolerance=0.1", "camera.distance=700")
LIT, NOT_LIT = "shading={}", "shading=null"
# By key, what changes a scene without it, and what changes one with it.
KEYS = {
    "`mode: maximum`": (NOT_LIT, "mode=maximum"),
    "`mode: mean`": (NOT_LIT, "mode=mean"),
    "`clip`, a corner box": (NOT_LIT, "clip=[{box: [[0, 0, 0], [128, 128, 128]]}]"),
    "`shading.light: camera`": (LIT, "shading={light: camera}"),
    "`shading.specular`": (LIT, "shading={specular: 0.4}"),
    "`shading.gradient_opacity`": (LIT, "shading={gradient_opacity: [[0, 0.2], [40, 1]]}"),
    "`shading.occlusion`": (LIT, "shading={occlusion: 0.5}"),
    "`shading.shadow`": (LIT, "shading={shadow: 0.5}"),
}

# Prints the names of the kernels that one frame of a scene calls.
LIST_KERNELS = """
import pathlib, sys, time
from renderer.draw import BrickRasterizer
from renderer.frame import prepare_stage, render_frames
from renderer.kernels import kernels
from renderer.scene import load_scene

scan, engine, *changes = sys.argv[1:]
scene = load_scene(pathlib.Path(engine), volume=pathlib.Path(scan), overrides=changes)
stage = prepare_stage(scene, clock=time.perf_counter, num_threads=1)
next(render_frames(stage, [0], BrickRasterizer(), clock=time.perf_counter))
print(*(name for name in vars(kernels()) if not name.startswith("_")))
"""


def main() -> None:
    arguments = parser_of(__doc__).parse_args()
    rows = list(section("Visible voxels, lighting, fine levels, commands", FIRST, COLUMNS))
    rows += [*little_visible(), *sections(arguments.data), *start(), ""]
    rows += [*section("Ways of seeing, light and clipping", SECOND, KEY_COLUMNS), *keys(arguments.data)]
    print(*rows, sep="\n")
    write_page(PAGE, ["Commit {commit}; {processor}, {cores} cores.".format(**describe_machine("kernels")), "", *rows])


def row(scene: str, costs: tuple[float, float], demand: str, unit: str) -> str:
    few, many = costs
    return f"| {scene} | {few:.3g} {unit} | {demand} | {many:.3g} {unit} | {many / few:.1f} |"


def little_visible() -> Iterator[str]:
    """Macrocells that show nothing are not classified, and not stored."""
    scene = load_scene(ROOT / "configs" / "demo.yaml")
    points = tuple(ControlPoint(value, (1.0, 0.5, 0.2), opacity) for value, opacity in ((125, 0.0), (250, 0.1)))
    scene = scene.with_layers(transfer_function=TransferSpec(points))
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
            megabytes = [stage.layers[0].pyramid.num_bytes / 1e6 for stage in stages]
            if megabytes[0]:
                yield row(f"{name}: pyramid", (megabytes[0], megabytes[1]), half.name, "MB")


def sections(data: Path) -> Iterator[str]:
    """Lighting and fine levels cost only the scenes that ask for them."""

    def load(*changes: str) -> Scene:
        return load_scene(ENGINE, overrides=["error.tolerance=0.1", *changes], volume=data / "engine.nhdr")

    plain = load()
    volume = read_volume(plain.layers[0].volume)
    for change, demand in (("shading={}", "lighting"), ("error.tolerance=0", "`tolerance: 0`")):
        other = load(change)
        draw = timed(*(drawer(builder(scene, volume)(), BrickRasterizer()) for scene in (plain, other)))
        yield row("engine at `tolerance: 0.1`: a frame", draw, demand, "ms")
        if other.layers[0].shading:
            build = timed(builder(plain, volume), builder(other, volume))
            yield row("engine: building", build, demand, "ms")


def keys(data: Path) -> Iterator[str]:
    """What a key computes and holds is paid by scenes that have it. After the rows come its own kernels."""
    scan, of_keys = data / "engine.nhdr", []
    for key, changes in KEYS.items():
        both = [(*COMMON, *changes[:num]) for num in (1, 2)]
        scenes = [load_scene(ENGINE, overrides=some, volume=scan) for some in both]
        volume = read_volume(scenes[0].layers[0].volume)
        build = timed(*(builder(scene, volume) for scene in scenes))
        films = [(builder(scene, volume)(), BrickRasterizer()) for scene in scenes]
        draw = timed(*(drawer(*film) for film in films))
        held = [megabytes_held(*film) for film in films]
        few, many = (kernels_of(scan, some) for some in both)
        own = ", ".join(f"`{name}`" for name in sorted(many - few))
        of_keys.append(f"- {key}: {own or 'none'}.")
        costs = [f"{without:.3g} → {with_key:.3g}" for without, with_key in (build, draw, held)]
        scene = "lit" if changes[0] == LIT else "not lit"
        yield f"| {scene} | {key} | {' | '.join(costs)} | {len(few)} → {len(many)} |"
    yield ""
    yield from of_keys


def kernels_of(volume: Path, changes: Sequence[str]) -> set[str]:
    """Return the names of the kernels that a frame of the engine calls."""
    command = [sys.executable, "-c", LIST_KERNELS, str(volume), str(ENGINE), *changes]
    return set(subprocess.run(command, check=True, cwd=ROOT, capture_output=True, text=True).stdout.split())


def megabytes_held(stage: Stage, rasterizer: BrickRasterizer) -> float:
    """Return what is in memory for later frames: the pyramid, the light grid, and the texels of bricks."""
    (layer,) = stage.layers
    grid = layer.light_grid
    num_bytes = layer.pyramid.num_bytes + grid.occlusion.nbytes + grid.shadow.nbytes + grid.corners.nbytes
    for atlas in chain.from_iterable((*cache.scalars, cache.means) for cache in rasterizer.caches.values()):
        num_bytes += 4 * atlas.brick_floats * int((atlas._slot_from_key >= 0).sum())
    return num_bytes / 1e6


def start() -> Iterator[str]:
    """Neither numpy nor OpenGL is loaded by commands that draw nothing."""

    def process(*words: str) -> Callable[[], object]:
        return lambda: subprocess.run([sys.executable, *words], check=True, cwd=ROOT, capture_output=True)

    loading = process("-c", "from renderer.draw import SplatRasterizer; from renderer.frame import render_frames")
    for words in (["--help"], ["check", "configs/demo.yaml", "--no-cost"]):
        costs = timed(process("-m", "hsplat_cli", *words), loading, clock=time.perf_counter)
        yield row(f"`hsplat {words[0]}`", costs, "numpy, kernels and OpenGL", "ms")


def builder(scene: Scene, volume: Volume) -> Callable[[], Stage]:
    return lambda: prepare_stage(scene, clock=time.perf_counter, num_threads=THREADS, volumes=[volume])


def drawer(stage: Stage, rasterizer: BrickRasterizer) -> Callable[[], object]:
    """Return what draws the next frame of a film; its first one is drawn."""
    frames = render_frames(stage, range(3 * REPEATS), rasterizer, clock=time.perf_counter)
    next(frames)
    return lambda: next(frames)


def timed(
    few: Callable[[], object], many: Callable[[], object], clock: Callable[[], float] = time.process_time
) -> tuple[float, float]:
    """Return the median milliseconds of both, run in turn, after one run of each that is not counted."""
    first, second = medians_in_turns((few, many), REPEATS, clock)
    return 1e3 * first, 1e3 * second


if __name__ == "__main__":
    main()
