"""Measure that what a scene does not ask for costs nothing.

`python tests/bench/required.py DATA` writes docs/benchmarks/required.md.

Each row sets the same work side by side, without and with the demand, in one process: medians of several runs in turn,
CPU seconds of all threads, which a shared machine disturbs less than wall seconds.
"""

from __future__ import annotations

import argparse
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hsplat_cli.terminal import describe_machine
from renderer.draw import GLRasterizer
from renderer.frame import Stage, prepare_stage, render_frames, view_of
from renderer.pyramid import Pyramid, build_pyramid, cut_pyramid
from renderer.readers import read_volume
from renderer.scene import ControlPoint, ErrorSpec, PyramidSpec, Scene, TransferSpec, load_scene
from renderer.splats import make_splats
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.view.splat_projection import visible_order
from renderer.volume import Volume, make_volume

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "benchmarks" / "required.md"
REPEATS = 7
THREADS = os.cpu_count() or 1

HEAD = """# What a scene does not ask for

Footprint: splats (`footprint: gaussian`), which is not the default. Nothing here is known for the default footprint
`integrated`, which needs the whole pyramid. Measure again when the pyramid, the cut, splats or the start of a command
change.

`python tests/bench/required.py DATA` writes this page. Each row does the same work twice: as the scene needs it, and
as it is when the scene asks for more. Times are CPU milliseconds of all threads, medians of {repeats} runs that take
turns.

{machine}

| the scene | it costs | and with | it costs | factor |
| --- | --- | --- | --- | --- |
"""


@dataclass(frozen=True)
class Row:
    """A cost without and with a demand, in `unit`."""

    scene: str
    cost: float
    demand: str
    dear_cost: float
    unit: str

    def __str__(self) -> str:
        factor = f"{self.dear_cost / self.cost:.1f}" if self.cost > 0 else "-"
        costs = [f"{cost:.3g} {self.unit}" for cost in (self.cost, self.dear_cost)]
        return f"| {self.scene} | {costs[0]} | {self.demand} | {costs[1]} | {factor} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("data", type=Path, help="the folder with engine.nhdr and bonsai.nhdr")
    parser.add_argument("--page", type=Path, default=PAGE)
    arguments = parser.parse_args()
    with GLRasterizer() as rasterizer:
        machine = describe_machine(rasterizer.renderer_name)
        rows = [*one_tolerance(arguments.data), *little_visible(), *measures(), *levels(arguments.data, rasterizer)]
    rows += start()
    print(*rows, sep="\n")
    where = "Commit {commit}; {processor}, {cores} cores; {driver}.".format(**machine)
    arguments.page.write_text(HEAD.format(repeats=REPEATS, machine=where) + "\n".join(map(str, rows)) + "\n")


def one_tolerance(data: Path) -> list[Row]:
    """A film at one tolerance keeps no nodes below its leaves."""
    rows = []
    for name in ("engine", "bonsai"):
        scene, volume, transfer = _subject(data, name)

        def build(
            least: float, scene: Scene = scene, volume: Volume = volume, of: TransferFunction = transfer
        ) -> Pyramid:
            return build_pyramid(
                volume, of, spec=scene.pyramid, error=scene.error, num_threads=THREADS, min_tolerance=least
            )

        few, many = _timed(lambda build=build: build(0.1), lambda build=build: build(0.0))
        at = f"{name} at `tolerance: 0.1`"
        rows.append(
            Row(f"{at}: pyramid", build(0.1).num_bytes / 1e6, "every tolerance", build(0.0).num_bytes / 1e6, "MB")
        )
        rows.append(Row(f"{at}: building it", few, "every tolerance", many, "ms"))
    return rows


def little_visible() -> list[Row]:
    """Blocks that show nothing are not classified, and not stored."""
    rows = []
    for dtype in ("uint8", "float32"):
        noise = (np.random.default_rng(0).random((256, 256, 256), dtype=np.float32) * 250).astype(dtype)
        z, y, x = np.indices(noise.shape)
        ball = (x - 128) ** 2 + (y - 128) ** 2 + (z - 128) ** 2 < 34**2
        little = make_volume(np.where(ball, noise, noise / 4).astype(dtype), np.eye(4), "1 % visible")
        nothing = make_volume((noise / 4).astype(dtype), np.eye(4), "nothing visible")
        much = make_volume(noise, np.eye(4), "half visible")
        mapping = tuple(
            ControlPoint(at, (1.0, 0.5, 0.2), opacity) for at, opacity in ((0, 0.0), (125, 0.0), (250, 0.1))
        )
        transfer = make_transfer_function(TransferSpec(mapping), 1.0)

        def build(volume: Volume, of: TransferFunction = transfer) -> Pyramid:
            return build_pyramid(volume, of, spec=PyramidSpec(), error=ErrorSpec(), num_threads=THREADS)

        for volume, words in ((nothing, "nothing"), (little, "0.5 %")):
            few, many = _timed(lambda v=volume, build=build: build(v), lambda v=much, build=build: build(v))
            what = f"256^3 {dtype}, {words} visible"
            rows.append(Row(f"{what}: building", few, "50 % visible", many, "ms"))
            rows.append(
                Row(
                    f"{what}: pyramid", build(volume).num_bytes / 1e6, "50 % visible", build(much).num_bytes / 1e6, "MB"
                )
            )
    return rows


def measures() -> list[Row]:
    """Voxels are classified once, unless averages and errors are asked of different quantities."""
    noise = make_volume(np.random.default_rng(0).integers(0, 250, (256, 256, 256), np.uint8), np.eye(4), "noise")
    transfer = make_transfer_function(
        TransferSpec((ControlPoint(0, (1.0, 0.5, 0.2), 0.0), ControlPoint(250, (1, 1, 1), 0.1))), 1.0
    )

    def build(error: ErrorSpec, spec: PyramidSpec) -> Pyramid:
        return build_pyramid(noise, transfer, spec=spec, error=error, num_threads=THREADS)

    once, twice = _timed(
        lambda: build(ErrorSpec(), PyramidSpec()), lambda: build(ErrorSpec(measure="rms"), PyramidSpec())
    )
    return [Row("256^3 noise, `optical`: building", once, "`rms` of an average of extinctions", twice, "ms")]


def levels(data: Path, rasterizer: GLRasterizer) -> list[Row]:
    """Levels below the finest one of the cut cost nothing when it is made and drawn; nor does an overlay not drawn."""
    scene, volume, _ = _subject(data, "engine")
    rows = []

    def stage_of(finest_level: int, overlay: str) -> Stage:
        error = ErrorSpec(((0, 1e-6),), finest_level=finest_level)
        asked = replace(scene, error=error, overlay=overlay)  # type: ignore[arg-type]
        return prepare_stage(asked, clock=time.perf_counter, num_threads=THREADS, volume=volume)

    def cut_and_splats(stage: Stage) -> None:
        make_splats(cut_pyramid(stage.pyramid, 1e-6, finest_level=stage.scene.error.finest_level), scene.splat)

    def order_and_draw(stage: Stage) -> Callable[[], object]:
        cut = cut_pyramid(stage.pyramid, 1e-6, finest_level=stage.scene.error.finest_level)
        splats, view = make_splats(cut, scene.splat), view_of(stage, 0)
        return lambda: rasterizer.rasterize(splats, visible_order(splats, cut, view, "depth"), view)

    whole = stage_of(0, "none")
    for level in (1, 2, 3):
        part = stage_of(level, "none")
        few, many = _timed(lambda s=part: cut_and_splats(s), lambda: cut_and_splats(whole))
        rows.append(Row(f"engine, `finest_level: {level}`: cut and splats", few, "every voxel", many, "ms"))
        few, many = _timed(order_and_draw(part), order_and_draw(whole))
        rows.append(
            Row(f"engine, `finest_level: {level}`: a frame's order and drawing", few, "every voxel", many, "ms")
        )

    def frame(stage: Stage) -> Callable[[], object]:
        frames = render_frames(stage, range(3 * REPEATS), rasterizer, clock=time.perf_counter)
        next(frames)
        return lambda: next(frames)

    few, many = _timed(frame(stage_of(2, "none")), frame(stage_of(2, "octree")))
    rows.append(Row("engine, `finest_level: 2`: a frame", few, "`overlay: octree`", many, "ms"))
    return rows


def start() -> list[Row]:
    """Neither numpy nor OpenGL is loaded by commands that draw nothing."""

    def command(*words: str) -> Callable[[], object]:
        line = [sys.executable, "-m", "hsplat_cli", *words]
        return lambda: subprocess.run(line, check=True, cwd=ROOT, capture_output=True)

    loading = [sys.executable, "-c", "import renderer.frame.pipeline, renderer.draw.gl.raster"]
    rows = []
    for name, words in (("`hsplat --help`", ["--help"]), ("`hsplat check`", ["check", "configs/demo.yaml"])):
        few, many = _timed(
            command(*words), lambda: subprocess.run(loading, check=True, cwd=ROOT), clock=time.perf_counter
        )
        rows.append(Row(f"{name}, wall", few, "numpy, numba and OpenGL", many, "ms"))
    return rows


def _subject(data: Path, name: str) -> tuple[Scene, Volume, TransferFunction]:
    scene = load_scene(
        ROOT / "configs" / f"{name}.yaml", overrides=["splat={footprint: gaussian}"], volume=data / f"{name}.nhdr"
    )
    volume = read_volume(scene.volume)
    return scene, volume, make_transfer_function(scene.transfer_function, volume.finest_spacing)


def _timed(
    few: Callable[[], object], many: Callable[[], object], clock: Callable[[], float] = time.process_time
) -> tuple[float, float]:
    """Median milliseconds of both, run in turn, after one of each that is not counted."""
    times: tuple[list[float], list[float]] = ([], [])
    for repeat in range(REPEATS + 1):
        for work, found in zip((few, many), times, strict=True):
            start = clock()
            work()
            if repeat:
                found.append((clock() - start) * 1e3)
    return statistics.median(times[0]), statistics.median(times[1])


if __name__ == "__main__":
    main()
