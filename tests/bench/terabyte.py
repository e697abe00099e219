"""How long does a film of a terabyte take on 1 to 256 workers? `python tests/bench/terabyte.py` writes its page.

The page is build/benchmarks/terabyte.md. A worker is a process on one core. Its rates are measured by films of a store,
a formula of 512 MiB in a folder of the system's temporary folder; `--size 256` makes one with that many voxels along
its longer sides, to try the script. Films of other sizes follow from a model, which is compared with films of the same
store on 1 and 2 workers, as a job array and on a cluster. Let nothing else run meanwhile.

The seconds of N frames on W workers, with V voxels, n bricks in a picture, and S bytes of the store for a voxel:

    read(k)    = max(k V S / disk, V / decode), for k workers that read from one disk at the same time
    frame      = fixed + n / draw, and n / make more if the bricks take more than the memory and are made again
    first      = frame, and n / make more if frame has none
    draw(W)    = first + (N / W, rounded up, less 1) frame
    jobs(W)    = start + read(W) + V / build + draw(W)
    cluster(W) = start + read(1) + V / build + (1 + log2 W) V / send + draw(W)

Each job of an array reads and builds on its own. On a cluster the client does so alone, and sends the voxels to a
worker, from which others get them: each time, the number of workers that have them doubles. The model knows no limit of
memory, which the page states beside it. Bricks grow with a power of the voxels, as they do from level 1 to level 0 of
the store. The model extrapolates by three powers of ten: the times tell hours from days.

The rates of reading and building are those by which films of levels 0 and 1 of the store differ, so that work that is
the same for each film does not count.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from measuring import PAGES, machine_line, section, write_page
from stores import SHAPE, TRANSLUCENT, write_store

sys.path.append(str(Path(__file__).parents[1] / "system"))
from clusters import running_cluster

PAGE = PAGES / "terabyte.md"
# Voxels along the longer sides of the store that rates are measured by. A voxel has a byte.
LARGEST = 1024
# The voxels of a terabyte.
TERABYTE = 10**12
# The levels of a terabyte whose films are predicted. Each has an eighth of the voxels of the level before.
LEVELS = (0, 2, 4)
SIZE = [512, 512]
# The first frames of a film that rates are measured by.
MEASURED_FRAMES = 4
# The frames of a film that the model is compared with.
COMPARED_FRAMES = 24
# The frames of a predicted film.
FRAMES = 120
OPAQUE = [[0, "black", 0], [150, "black", 0], [200, "white", 0.9], [255, "white", 1]]
# The looks and levels of the store that rates are measured by. The pictures of each have another number of bricks.
SUBJECTS = {"translucent": (TRANSLUCENT, 0), "translucent, level 1": (TRANSLUCENT, 1), "opaque": (OPAQUE, 0)}
# The film of level 0 that the model is compared with, and the same of level 1.
COMPARED, COARSER = "translucent", "translucent, level 1"
TOLERANCE = 0.1
WORKERS = (1, 2, 4, 16, 64, 256)
# The memory for bricks of a predicted worker, in bytes.
MEMORY = 2**33
# The bytes of a brick of scalars.
BYTES_OF_BRICK = 23e3
# The bytes for a voxel, beside bricks, that a process takes while it builds, at most.
BYTES_OF_BUILDING = 1 / 8
# The bytes that are sent to measure how fast voxels are sent.
SENT = 2**28
# A program that runs hsplat on one core. Its first argument is the number of the core.
ON_ONE_CORE = """
import os, runpy, sys
os.sched_setaffinity(0, {int(sys.argv.pop(1))})
runpy.run_module("hsplat_cli", run_name="__main__")
"""


class Rates(NamedTuple):
    """The rates of a worker, in a second where nothing else is said.

    stored: bytes of the store for a voxel. disk: bytes that are read from the store, if they are not in memory. decode:
    voxels that are read from the store in memory. build: voxels that are built into a pyramid, with the fingerprint and
    the search for faults in the first picture. send: bytes that are sent to a worker. start: the seconds of a film
    without voxels and frames. fixed: the seconds of a frame without bricks. draw: bricks that are drawn. make: bricks
    that are made.
    """

    stored: float
    disk: float
    decode: float
    build: float
    send: float
    start: float
    fixed: float
    draw: float
    make: float


class Film(NamedTuple):
    """A film: its voxels, the bricks of a picture, and its frames."""

    voxels: float
    bricks: float
    frames: int


class Parts(NamedTuple):
    """The seconds of the parts of a film."""

    start: float
    read: float
    build: float
    send: float
    draw: float

    @property
    def longest(self) -> str:
        """Return the part that takes longest."""
        return max(self._fields, key=lambda name: getattr(self, name))


class Measured(NamedTuple):
    """A film that was made: the seconds of the whole command, and the sidecar's."""

    wall: float
    sidecar: dict[str, Any]


def predicted(rates: Rates, film: Film, workers: int, *, is_cluster: bool) -> Parts:
    """Return the seconds of a film by the model."""
    readers = 1 if is_cluster else workers
    read = max(readers * film.voxels * rates.stored / rates.disk, film.voxels / rates.decode)
    made = film.bricks / rates.make
    is_made_again = film.bricks * BYTES_OF_BRICK > MEMORY
    frame = rates.fixed + film.bricks / rates.draw + made * is_made_again
    first = frame + made * (not is_made_again)
    return Parts(
        start=rates.start,
        read=read,
        build=film.voxels / rates.build,
        send=(1 + math.log2(workers)) * film.voxels / rates.send if is_cluster else 0,
        draw=first + (math.ceil(film.frames / workers) - 1) * frame,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--size", type=int, default=LARGEST, help="voxels along the longer sides")
    shape = [round(parser.parse_args().size * share) for share in SHAPE]
    lines = [machine_line(), ""]
    with tempfile.TemporaryDirectory() as name:
        for line in tables(Path(name), shape):
            lines.append(line)
            print(line, flush=True)
    write_page(PAGE, lines)


def tables(folder: Path, shape: Sequence[int]) -> Iterator[str]:
    """Make the store, and yield the lines of all tables."""
    (folder / "store").mkdir()
    write_store(folder / "store", shape)
    voxels = math.prod(shape)
    films = {name: made_alone(folder, name) for name in SUBJECTS}
    rates = rates_of(folder, films, voxels)
    bricks = {name: film.sidecar["frames"][0]["primitives"] for name, film in films.items()}
    yield from section("Rates of a worker", f"A store of {' x '.join(map(str, shape))} voxels.", "rate | measured")
    yield from (f"| {name} | {value:.3g} |" for name, value in rates._asdict().items())
    yield from (f"| bricks of a frame, {name} | {num} |" for name, num in bricks.items())
    yield ""
    yield from comparison(folder, rates, Film(voxels, bricks[COMPARED], COMPARED_FRAMES))
    power = math.log(bricks[COMPARED] / bricks[COARSER], 8)
    for name in (COMPARED, "opaque"):
        for level in LEVELS:
            coarse = TERABYTE / 8**level
            film = Film(coarse, bricks[name] * (coarse / voxels) ** power, FRAMES)
            yield from plan(rates, film, f"Level {level} of a terabyte, {name}")


def comparison(folder: Path, rates: Rates, film: Film) -> Iterator[str]:
    """Make a film in all ways, and yield the table that compares it with the model."""
    text = f"{film.frames} frames, {COMPARED}."
    yield from section("The model against films", text, "workers | of | predicted | measured")
    for workers in (1, 2):
        for is_cluster, make in ((False, by_jobs), (True, by_cluster)):
            expected = sum(predicted(rates, film, workers, is_cluster=is_cluster))
            yield f"| {workers} | {kind(is_cluster)} | {expected:.1f} s | {make(folder, workers):.1f} s |"
    yield ""


def plan(rates: Rates, film: Film, title: str) -> Iterator[str]:
    """Yield the table of a film on more and more workers."""
    memory = film.voxels * BYTES_OF_BUILDING + MEMORY
    text = (
        f"{film.frames} frames; {film.bricks:.3g} bricks a frame. A job takes {film.voxels / 1e9:.3g} GB of disk and "
        f"up to {memory / 1e9:.3g} GB of memory, a worker of a cluster {(film.voxels + memory) / 1e9:.3g} GB of memory."
    )
    columns = "workers | of | read and decode | build | send | draw | whole | the longest part"
    yield from section(title, text, columns)
    for is_cluster in (False, True):
        for workers in WORKERS:
            parts = predicted(rates, film, workers, is_cluster=is_cluster)
            each = " | ".join(map(duration, (parts.read, parts.build, parts.send, parts.draw, sum(parts))))
            yield f"| {workers} | {kind(is_cluster)} | {each} | {parts.longest} |"
    yield ""


def kind(is_cluster: bool) -> str:
    """Return a name of the workers."""
    return "a cluster" if is_cluster else "a job array"


def duration(seconds: float) -> str:
    """Return seconds in a unit that suits them."""
    for unit, length in (("d", 86400), ("h", 3600), ("min", 60)):
        if seconds >= 2 * length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.1f} s"


def rates_of(folder: Path, films: dict[str, Measured], voxels: int) -> Rates:
    """Return the rates of a worker, from films that a worker made alone."""
    whole, part = films[COMPARED], films[COARSER]
    more = voxels * 7 / 8  # the voxels that level 0 has more than level 1
    read, build = (seconds(whole) - seconds(part) for seconds in (reading, building))
    rest = part.wall - drawing_all(part) - (read + build) / 7
    fixed, per_brick = np.polynomial.polynomial.polyfit(*zip(*later_frames(films.values()), strict=True), 1).tolist()
    each = [(film.sidecar["frames"][0]["primitives"], extra(film.sidecar["frames"])) for film in films.values()]
    num_bytes, seconds = cold_reading(folder / "store" / "0")
    return Rates(
        stored=num_bytes / voxels,
        disk=num_bytes / seconds,
        decode=more / read,
        build=more / build,
        send=sending(),
        start=rest,
        fixed=max(fixed, 0),
        draw=1 / per_brick,
        make=sum(num for num, _ in each) / sum(taken for _, taken in each),
    )


def reading(film: Measured) -> float:
    """Return the seconds in which the voxels of a film are read."""
    return float(film.sidecar["seconds"]["read"])


def building(film: Measured) -> float:
    """Return the seconds of a film in which voxels are not read, and no frame is drawn."""
    return float(film.sidecar["seconds"]["total"]) - reading(film) - drawing_all(film)


def drawing_all(film: Measured) -> float:
    """Return the seconds in which the frames of a film are drawn."""
    return sum(map(drawing, film.sidecar["frames"]))


def drawing(frame: dict[str, Any]) -> float:
    """Return the seconds of a frame, from its record."""
    return float(sum(frame["seconds"].values()))


def later_frames(films: Iterable[Measured]) -> Iterator[tuple[float, float]]:
    """Yield the bricks and the seconds of each frame but the first of each film."""
    for film in films:
        for frame in film.sidecar["frames"][1:]:
            yield frame["primitives"], drawing(frame)


def extra(frames: Sequence[dict[str, Any]]) -> float:
    """Return the seconds that the first frame takes longer than the mean of later ones."""
    return drawing(frames[0]) - sum(map(drawing, frames[1:])) / (len(frames) - 1)


def cold_reading(folder: Path) -> tuple[int, float]:
    """Drop the files of a folder from memory. Return their bytes, and the seconds to read them from the disk."""
    files = [file for file in folder.rglob("*") if file.is_file()]
    os.sync()
    for file in files:
        with file.open("rb") as opened:
            os.posix_fadvise(opened.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)
    begin = time.perf_counter()
    num_bytes = sum(len(file.read_bytes()) for file in files)
    return num_bytes, time.perf_counter() - begin


def sending() -> float:
    """Return the bytes that are sent to a worker of a cluster in a second."""
    with running_cluster(1) as cluster, cluster.get_client() as client:
        voxels = np.random.default_rng(0).integers(0, 256, SENT, np.uint8)
        begin = time.perf_counter()
        client.scatter(voxels, hash=False)
        return SENT / (time.perf_counter() - begin)


def made_alone(folder: Path, name: str) -> Measured:
    """Make the first frames of a subject's film on one core."""
    scene = write_scene(folder, name)
    begin = time.perf_counter()
    finish([start(scene, 0, "--frames", f"0:{MEASURED_FRAMES}", "--force")])
    wall = time.perf_counter() - begin
    return Measured(wall, json.loads(scene.with_suffix(".mp4.json").read_text("utf-8")))


def by_jobs(folder: Path, workers: int) -> float:
    """Return the seconds of a film that jobs draw in parts, each on its own core."""
    scene = write_scene(folder, COMPARED)
    num = COMPARED_FRAMES // workers
    begin = time.perf_counter()
    frames = [f"{num * worker}:{num * (worker + 1)}" for worker in range(workers)]
    parts = ("--output", str(folder / f"{workers} parts" / "{frame:04}.png"))
    finish([start(scene, worker, "--frames", which, *parts) for worker, which in enumerate(frames)])
    return time.perf_counter() - begin


def by_cluster(folder: Path, workers: int) -> float:
    """Return the seconds of a film that workers of a cluster draw, each with one thread."""
    scene = write_scene(folder, COMPARED)
    variables = {"LP_NUM_THREADS": "1"}
    with running_cluster(workers, variables=variables) as cluster:
        begin = time.perf_counter()
        frames = ("--frames", f"0:{COMPARED_FRAMES}", "--force")
        finish([start(scene, 0, *frames, "--scheduler", cluster.scheduler_address)])
        return time.perf_counter() - begin


def write_scene(folder: Path, name: str) -> Path:
    """Write the scene of a subject."""
    look, level = SUBJECTS[name]
    scene = folder / f"{name.replace(', ', '_')}.yaml"
    tree = {
        "volume": {"file": "store", "level": level},
        "transfer_function": {
            "points": [{"value": value, "color": color, "opacity": part} for value, color, part in look]
        },
        "camera": {"path": {"type": "turntable", "frames": FRAMES, "elevation": 20}},
        "output": {"file": str(scene.with_suffix(".mp4")), "size": SIZE},
        "error": {"tolerance": TOLERANCE},
    }
    scene.write_text(json.dumps(tree), "utf-8")
    return scene


def start(scene: Path, core: int, *options: str) -> subprocess.Popen[bytes]:
    """Start to render a scene on one core."""
    command = [sys.executable, "-c", ON_ONE_CORE, str(core), "render", str(scene), "--quiet", *options]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def finish(processes: Iterable[subprocess.Popen[bytes]]) -> None:
    """Wait for processes, none of which fails."""
    statuses = [process.wait() for process in processes]
    assert not any(statuses), statuses


if __name__ == "__main__":
    main()
