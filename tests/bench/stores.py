"""How fast are films of a large store? `python tests/bench/stores.py` writes build/benchmarks/stores.md.

The store is a formula of 4 GiB in a folder of the system's temporary folder; `--size 1024` makes one with that many
voxels along its longer sides. Each figure is of a process of its own. Over HTTP, a server on this machine answers after
20 ms, and counts the requests.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import tensorstore
from measuring import PAGES, THREADS, machine_line, section, write_page

sys.path.append(str(Path(__file__).parents[1] / "support"))
from store_server import served_folder

from renderer.cache import caching_in
from renderer.draw import open_rasterizer
from renderer.frame import prepare_stage, render_frames
from renderer.readers import read_volume
from renderer.resolve import resolve_scene
from renderer.scene import parse_scene, with_tolerance
from renderer.volume import Array, UInt8

PAGE = PAGES / "stores.md"
# The voxels along x, y and z of a store of 4 GiB, as shares of the longest side.
SHAPE = (1.0, 1.0, 0.5)
LARGEST = 2048
NUM_LEVELS = 5
CHUNK = 64
# The planes of a level that are made at a time: as many as a chunk has.
PLANES = CHUNK
SIZE = [512, 512]
NUM_FRAMES = 24
# The accuracy that the level is chosen for, and the tolerance of drawing.
DECIBELS = 40
TOLERANCE = 0.1
# The seconds that the server waits before each answer.
LATENCY = 0.02
# Scalars of the shell around the object, of its inside, and of the noise beyond, and the largest noise.
SHELL, INSIDE, OUTSIDE, NOISE = 220, 120, 20, 8
# The part of the volume's half that the shell begins at, and its thickness.
SHELL_RADIUS, SHELL_THICKNESS = 0.8, 0.05
TRANSLUCENT = [[0, "black", 0], [30, "navy", 0.001], [120, "orange", 0.004], [255, "white", 0.02]]
OTHER_LOOK = [[0, "black", 0], [60, "green", 0.002], [160, "yellow", 0.01], [255, "white", 0.03]]
# The seconds between two looks at the memory of the processes.
MEMORY_EVERY = 0.05


class Case(NamedTuple):
    """A film. name: for the table. place: the path or the URL of the store. keys: of its volume. elevation: of the
    camera in degrees. points: the transfer function. cache: the cache folder, empty for none."""

    name: str
    place: str
    keys: dict[str, Any]
    elevation: float = 20
    points: Sequence[Sequence[Any]] = TRANSLUCENT
    cache: str = ""


class Figures(NamedTuple):
    """Figures of a film. The memory of the process and of the one that reads, in GiB.

    level: the number of the level. resolved, prepared: the seconds until the level is known, and until the film can be
    drawn. first, frames: the seconds of the first frame, and of all. anonymous, resident: the largest memory without
    and with pages of files.
    """

    level: int
    resolved: float
    prepared: float
    first: float
    frames: float
    anonymous: float
    resident: float

    @property
    def until_first(self) -> float:
        return self.resolved + self.prepared + self.first

    @property
    def whole(self) -> float:
        return self.resolved + self.prepared + self.frames


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--size", type=int, default=LARGEST, help="voxels along the longer sides")
    size = parser.parse_args().size
    lines = [machine_line(), ""]
    with tempfile.TemporaryDirectory() as name:
        for line in tables(Path(name), size):
            lines.append(line)
            print(line, flush=True)
            write_page(PAGE, lines)


def tables(folder: Path, size: int) -> Iterator[str]:
    """Make the store, and yield the lines of all tables."""
    shape = [round(size * share) for share in SHAPE]
    write_store(folder / "store", shape)
    text = f"A store of {' x '.join(map(str, shape))} voxels, uint8; {NUM_FRAMES} frames of 512 x 512, {DECIBELS} dB."
    columns = "film | level | level chosen | prepared | first frame | film | memory | with pages of files | requests"
    yield from section("Large stores", text, columns)
    with served_folder(folder) as served:
        served.delay = LATENCY
        found = {}
        for case in cases(folder, f"{served.url}/store"):
            served.asked.clear()
            found[case.name] = figures = alone(case)
            yield row(case, figures, served.asked)
        yield ""
        for name, place in (("local", str(folder / "store")), ("HTTP", f"{served.url}/store")):
            figures = found[f"auto, {name}"]
            seconds = reading(place, figures.level)
            first = f"the first frame after {figures.until_first:.1f} s"
            yield f"Reading level {figures.level}, {name}: {seconds:.1f} s; {first}."
    yield ""


def cases(folder: Path, url: str) -> Iterator[Case]:
    """Yield all films, in their order: those with a cache folder come after the film that fills it."""
    local = str(folder / "store")
    yield Case("level 0, local", local, {"level": 0})
    yield Case("level 0, HTTP", url, {"level": 0})
    yield Case("auto, local", local, {})
    yield Case("auto, HTTP", url, {})
    for name, place in (("local", local), ("HTTP", url)):
        cache = str(folder / f"cache of {name}")
        yield Case(f"auto, {name}, empty cache", place, {}, cache=cache)
        yield Case(f"auto, {name}, the same film", place, {}, cache=cache)
        yield Case(f"auto, {name}, another camera", place, {}, elevation=-30, cache=cache)
        yield Case(f"auto, {name}, another look", place, {}, points=OTHER_LOOK, cache=cache)


def row(case: Case, found: Figures, asked: Sequence[str]) -> str:
    """Return a line of the table. asked: the paths that the server was asked for."""
    chunks = Counter(path for path in asked if "/c/" in path)
    requests = f"{len(asked)}, a chunk {max(chunks.values(), default=0)} times at most" if asked else "-"
    seconds = " | ".join(f"{each:.1f} s" for each in (found.resolved, found.prepared, found.until_first, found.whole))
    memory = f"{found.anonymous:.2f} GiB | {found.resident:.2f} GiB"
    return f"| {case.name} | {found.level} | {seconds} | {memory} | {requests} |"


def alone(case: Case) -> Figures:
    """Measure a film in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(measured, case).result()


def measured(case: Case) -> Figures:
    """Draw a film, and measure it."""
    memory = Memory()
    with caching_in(Path(case.cache) if case.cache else None):
        scene = parse_scene(scene_of(case), base=Path("/"))
        begin = time.perf_counter()
        scene = with_tolerance(resolve_scene(scene, read_volume), TOLERANCE)
        resolved = time.perf_counter() - begin
        with (
            prepare_stage(scene, clock=time.perf_counter, num_threads=THREADS) as stage,
            open_rasterizer(scene) as rasterizer,
        ):
            prepared = time.perf_counter() - begin - resolved
            frames = render_frames(stage, range(NUM_FRAMES), rasterizer, clock=time.perf_counter)
            seconds = [sum(frame.seconds.values()) for frame in frames]
    anonymous, resident = memory.most()
    level = scene.at(0).layers[0].volume.level or 0
    return Figures(level, resolved, prepared, seconds[0], sum(seconds), anonymous, resident)


def reading(place: str, level: int) -> float:
    """Return the seconds to read a level in a process of its own."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
        return process.submit(read_level, place, level).result()


def read_level(place: str, level: int) -> float:
    scene = parse_scene(scene_of(Case("", place, {"level": level})), base=Path("/"))
    begin = time.perf_counter()
    read_volume(scene.at(0).layers[0].volume)
    return time.perf_counter() - begin


def scene_of(case: Case) -> dict[str, Any]:
    """Return the scene of a turntable as plain data."""
    points = [{"value": value, "color": color, "opacity": part} for value, color, part in case.points]
    return {
        "volume": {"file": case.place, **case.keys},
        "transfer_function": {"points": points},
        "camera": {"path": {"type": "turntable", "frames": NUM_FRAMES, "elevation": case.elevation}},
        "output": {"file": "/film.mp4", "size": SIZE},
        "error": {"psnr": DECIBELS},
    }


class Memory:
    """A meter of the largest memory of this process and its children together, by looking now and then."""

    def __init__(self) -> None:
        self._most = np.zeros(2)
        self._has_ended = threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)
        self._thread.start()

    def most(self) -> tuple[float, float]:
        """End the measurement. Return the largest memory in GiB, without and with pages of files."""
        self._has_ended.set()
        self._thread.join()
        anonymous, resident = (self._most / 2**20).tolist()
        return anonymous, resident

    def _watch(self) -> None:
        while not self._has_ended.wait(MEMORY_EVERY):
            each = [_memory_of(process) for process in (os.getpid(), *_children(os.getpid()))]
            self._most = np.maximum(self._most, np.sum(each, axis=0))


def _children(process: int) -> list[int]:
    found = list[int]()
    for task in Path(f"/proc/{process}/task").iterdir():
        with suppress(OSError):  # the thread has ended
            found += map(int, (task / "children").read_text().split())
    return found


def _memory_of(process: int) -> tuple[int, int]:
    """Return the memory of a process in KiB: without pages of files, and with them."""
    try:
        lines = Path(f"/proc/{process}/status").read_text().splitlines()
    except OSError:  # it has ended
        return 0, 0
    found = {name: int(value.split()[0]) for name, _, value in (line.partition(":") for line in lines) if "Rss" in name}
    anonymous = found.get("RssAnon", 0) + found.get("RssShmem", 0)
    return anonymous, anonymous + found.get("RssFile", 0)


def write_store(folder: Path, shape: Sequence[int]) -> None:
    """Write an image of OME-Zarr 0.5, whose levels are means of 2 x 2 x 2 voxels. shape: along x, y, z."""
    arrays = [new_array(folder / str(k), [side >> k for side in shape[::-1]]) for k in range(NUM_LEVELS)]
    for first in range(0, shape[2], PLANES):
        arrays[0][first : first + PLANES].write(planes(shape, first)).result()
    for source, target in pairwise(arrays):
        for first in range(0, target.shape[0], PLANES):
            last = min(first + PLANES, target.shape[0])
            target[first:last].write(halves(source[2 * first : 2 * last].read().result())).result()
    scales = [[{"type": "scale", "scale": [2.0**k] * 3}] for k in range(NUM_LEVELS)]
    datasets = [{"path": str(k), "coordinateTransformations": scale} for k, scale in enumerate(scales)]
    axes = [{"name": name, "type": "space"} for name in "zyx"]
    ome = {"version": "0.5", "multiscales": [{"axes": axes, "datasets": datasets}]}
    group = {"zarr_format": 3, "node_type": "group", "attributes": {"ome": ome}}
    (folder / "zarr.json").write_text(json.dumps(group), "utf-8")


def new_array(folder: Path, shape: Sequence[int]) -> Any:
    """Return a new array of Zarr 3, uint8, in chunks that are compressed by Zstandard."""
    grid = {"name": "regular", "configuration": {"chunk_shape": [CHUNK] * 3}}
    codecs = [{"name": "bytes"}, {"name": "zstd", "configuration": {"level": 1}}]
    metadata = {"shape": shape, "data_type": "uint8", "chunk_grid": grid, "codecs": codecs}
    spec = {"driver": "zarr3", "kvstore": {"driver": "file", "path": f"{folder}/"}, "metadata": metadata}
    return tensorstore.open(spec, create=True).result()


def planes(shape: Sequence[int], first: int) -> UInt8:
    """Return planes of the finest level, uint8 [z, y, x]: a ball in a shell, with waves and noise inside."""
    x, y, z = (np.linspace(-1, 1, num, dtype=np.float32) for num in shape)
    noise = np.random.default_rng(1).integers(0, NOISE, (shape[1], shape[0]), np.uint8)
    found = np.empty((min(PLANES, shape[2] - first), shape[1], shape[0]), np.uint8)
    waves = 40 * np.sin(25 * x) * np.sin(25 * y[:, None])
    for number, height in enumerate(z[first : first + PLANES]):
        square = x**2 + y[:, None] ** 2 + height**2
        inside, shell = square < SHELL_RADIUS**2, square < (SHELL_RADIUS + SHELL_THICKNESS) ** 2
        plane = np.where(inside, INSIDE + waves * np.sin(25 * height), np.where(shell, SHELL, OUTSIDE))
        found[number] = plane.astype(np.uint8) + np.roll(noise, 7 * (first + number), (0, 1))
    return found


def halves(values: Array) -> UInt8:
    """Return the means of 2 x 2 x 2 voxels, rounded down."""
    z, y, x = (side // 2 for side in values.shape)
    parts = values[: 2 * z, : 2 * y, : 2 * x].reshape(z, 2, y, 2, x, 2)
    return (parts.sum(axis=(1, 3, 5), dtype=np.uint16) // 8).astype(np.uint8)


if __name__ == "__main__":
    main()
