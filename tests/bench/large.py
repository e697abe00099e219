"""How long do large volumes and many small ones take? `python tests/bench/large.py` writes build/benchmarks/large.md.

The volumes are formulas in files of the system's temporary folder, of 2 GiB at most. Each figure is of a process of its
own, whose largest memory is in the table.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from measuring import PAGES, THREADS, machine_line, section, write_page

from renderer.draw import open_rasterizer
from renderer.frame import prepare_stage, render_frames
from renderer.scene import parse_scene

PAGE = PAGES / "large.md"
# Voxels along x, y and z.
LARGE = (1024, 1024, 2048)
CUBES = (128, 512)
COLUMNS = "side, voxels | look | prepared, s | first frame, s | later frames, s | memory, GiB"
SIZE = [512, 512]
FRAMES = (0, 1, 2, 3)
# Scalars of the shell around the object, of its inside, and of the noise beyond.
SHELL, INSIDE, OUTSIDE = 220, 120, 20
# The part of the volume's half that the shell begins at, and its thickness.
SHELL_RADIUS, SHELL_THICKNESS = 0.8, 0.05
LIGHT = {"light": "camera", "ambient": 0.3, "diffuse": 0.7}
TRANSLUCENT = [[0, "black", 0], [30, "navy", 0.001], [120, "orange", 0.004], [255, "white", 0.02]]
OPAQUE = [[0, "black", 0], [150, "black", 0], [200, "white", 0.9], [255, "white", 1]]
LOOKS: dict[str, dict[str, Any]] = {
    "translucent": {"transfer_function": TRANSLUCENT},
    "translucent, lit": {"transfer_function": TRANSLUCENT, "shading": LIGHT},
    "opaque shell, lit": {"transfer_function": OPAQUE, "shading": LIGHT},
}
# Films of a batch of small volumes: their number, the voxels along a side, and the options of the command.
NUM_SMALL, SMALL_SIDE = 40, 64
SMALL_OPTIONS = ("--frames", "24", "--size", "160", "--quiet")


class Figures(NamedTuple):
    """The seconds to prepare a scene, of its first frame and of later ones, and the largest memory in GiB."""

    prepared: float
    first: float
    later: float
    memory: float


def main() -> None:
    argparse.ArgumentParser(description=__doc__.partition("\n")[0]).parse_args()
    lines = [machine_line(), ""]
    with tempfile.TemporaryDirectory() as name:
        for line in tables(Path(name)):
            lines.append(line)
            print(line, flush=True)
            write_page(PAGE, lines)


def tables(folder: Path) -> Iterator[str]:
    """Make the volumes, and yield the lines of all tables."""
    yield from section("Large volumes", "", COLUMNS)
    for shape in (LARGE, *((side,) * 3 for side in CUBES)):
        file = write_volume(folder / "volume.raw", shape)
        for look in LOOKS:
            found = alone(scene_of(file, shape, look))
            cells = f"{found.prepared:.1f} | {found.first:.2f} | {found.later:.3f} | {found.memory:.1f}"
            yield f"| {', '.join(map(str, dict.fromkeys(shape) if shape != LARGE else shape))} | {look} | {cells} |"
        if shape == LARGE:
            described = [taken(command, file, shape) for command in ("info", "init")]
    yield ""
    yield f"`info` of the largest takes {described[0]:.1f} s, `init` {described[1]:.1f} s."
    yield ""
    yield f"{NUM_SMALL} turntables of {SMALL_SIDE}^3: {batch(folder):.2f} s each."


def write_volume(file: Path, shape: Sequence[int]) -> Path:
    """Write voxels, uint8: a ball in a shell, with waves and noise inside."""
    x, y, z = (np.linspace(-1, 1, num, dtype=np.float32) for num in shape)
    noise = np.random.default_rng(1).integers(0, 16, (shape[1], shape[0]), np.uint8)
    with file.open("wb") as voxels:
        for number, height in enumerate(z):
            radius = np.sqrt(x**2 + y[:, None] ** 2 + height**2)
            waves = INSIDE + 40 * np.sin(25 * x) * np.sin(25 * y[:, None]) * np.sin(25 * height)
            plane = np.where(radius < SHELL_RADIUS, waves, OUTSIDE)
            plane[(radius >= SHELL_RADIUS) & (radius < SHELL_RADIUS + SHELL_THICKNESS)] = SHELL
            voxels.write((plane.astype(np.uint8) + np.roll(noise, 7 * number, (0, 1))).tobytes())
    return file


def scene_of(file: Path, shape: Sequence[int], look: str) -> dict[str, Any]:
    """Return the scene of a turntable as plain data."""
    points = [
        {"value": value, "color": color, "opacity": part} for value, color, part in LOOKS[look]["transfer_function"]
    ]
    return {
        "volume": {"raw": {"file": str(file), "shape": list(shape), "dtype": "uint8", "spacing": [1, 1, 1]}},
        "camera": {"path": {"type": "turntable", "frames": 120, "elevation": 20}},
        "output": {"file": "film.mp4", "size": SIZE},
        "error": {"tolerance": 0.1},
        **LOOKS[look],
        "transfer_function": {"points": points},
    }


def alone(scene: dict[str, Any]) -> Figures:
    """Measure a scene in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(measured, scene).result()


def measured(tree: dict[str, Any]) -> Figures:
    """Prepare a scene and draw some frames."""
    scene = parse_scene(tree, base=Path("/"))
    begin = time.perf_counter()
    with (
        prepare_stage(scene, clock=time.perf_counter, num_threads=THREADS) as stage,
        open_rasterizer(scene) as rasterizer,
    ):
        prepared = time.perf_counter() - begin
        seconds = [
            sum(frame.seconds.values()) for frame in render_frames(stage, FRAMES, rasterizer, clock=time.perf_counter)
        ]
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    return Figures(prepared, seconds[0], statistics.median(seconds[1:]), memory)


def taken(command: str, file: Path, shape: Sequence[int]) -> float:
    """Return the seconds of a command that looks at a headerless file."""
    size = ("--shape", ",".join(map(str, shape)), "--dtype", "uint8")
    begin = time.perf_counter()
    run(command, str(file), *size)
    return time.perf_counter() - begin


def batch(folder: Path) -> float:
    """Return the seconds of each film of a batch of small volumes."""
    volumes = folder / "small"
    volumes.mkdir()
    for number in range(NUM_SMALL):
        np.save(volumes / f"{number:02}.npy", small_volume(number))
    begin = time.perf_counter()
    run("turntable", str(volumes), "-o", str(folder / "films"), *SMALL_OPTIONS)
    records = json.loads((folder / "films" / "turntable.json").read_text("utf-8"))
    assert len(records["films"]) == NUM_SMALL, len(records["films"])
    return (time.perf_counter() - begin) / NUM_SMALL


def run(*arguments: str) -> None:
    """Run a command of hsplat."""
    subprocess.run([sys.executable, "-m", "hsplat_cli", *arguments], check=True, capture_output=True)


def small_volume(number: int) -> Any:
    """Return a small volume, uint8 [n, n, n], that no other number has: balls in noise."""
    random = np.random.default_rng(number)
    z, y, x = np.indices((SMALL_SIDE,) * 3)
    volume = random.integers(0, 20, x.shape)
    for _ in range(5):
        (i, j, k), radius = random.uniform(12, SMALL_SIDE - 12, 3), random.uniform(4, 12)
        volume[(x - i) ** 2 + (y - j) ** 2 + (z - k) ** 2 < radius**2] += int(random.integers(40, 160))
    return np.minimum(volume, 255).astype(np.uint8)


if __name__ == "__main__":
    main()
