"""Measure what several processes gain, what a film costs beside its splats, and whether memory stays flat.

docs/benchmarks/batches.md has the results.

    PYTHONPATH=. python tests/bench/batches.py DATA [--only workers|loop|memory] [--page FILE] [--repeats 3]

Whole commands, timed from outside, one after the other in turns, on a machine that should have nothing else to do.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
import uuid
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from renderer.system import commit, num_cores

ROOT = Path(__file__).resolve().parents[2]
MARK = "HSPLAT_BENCH_MARK"
MIB = 2**20

# Scene, volume in DATA or none, what is changed.
SCENES: dict[str, tuple[str, str | None, tuple[str, ...]]] = {
    "engine, tolerance 0.1": ("engine", "engine.nhdr", ("error.tolerance=0.1",)),
    "engine, tolerance 0.3": ("engine", "engine.nhdr", ("error.tolerance=0.3",)),
    "bonsai": ("bonsai", "bonsai.nhdr", ("camera.path.frames=120", "output.background=black")),
    "demo": ("demo", None, ()),
}
PAGE_HEAD = """\
# Films on all cores

Footprint: that of the scenes named in each row. Measure again when `--workers`, the default footprint or the drawing of
frames change.

Times are of whole commands, from their start to the last file; the commands take turns. `2 x 1` is two processes of one
thread each (`--workers 2`), `1 x 2` is one process of two threads (`LP_NUM_THREADS=2`), the default on two cores.

A single process with two threads keeps both cores busy where footprints cover many pixels, and little is left to
gain. It does not where vertices, sorting, PNG and the encoder are most of the work, because these have one thread in
a process. "Possible" is the gain if all the work of `1 x 1`, with start and encoder, were divided by the cores
without loss.
"""
SMALL = """\
volume: {procedural: {name: engine_block, shape: [32, 32, 16], seed: 1}}
transfer_function:
  points: [{value: 0, color: black, opacity: 0}, {value: 255, color: white, opacity: 0.5}]
camera: {path: {type: turntable, frames: 5000}}
output: {file: film.mp4, size: [64, 64]}
"""


def run(arguments: Sequence[str], folder: Path, threads: str | None = None) -> tuple[float, dict[str, Any]]:
    """Seconds of `hsplat render ...` into film.mp4, and its sidecar."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)} | ({} if threads is None else {"LP_NUM_THREADS": threads})
    command = [sys.executable, "-m", "hsplat_cli", "render", *arguments, "--output", "film.mp4", "--force", "--quiet"]
    start = time.perf_counter()
    subprocess.run(command, check=True, cwd=folder, env=environment)
    return time.perf_counter() - start, json.loads((folder / "film.mp4.json").read_text(encoding="utf-8"))


def scene_arguments(name: str, data: Path) -> list[str]:
    """What comes after `hsplat render`."""
    scene, volume, changes = SCENES[name]
    found = [str(ROOT / "configs" / f"{scene}.yaml"), *(word for change in changes for word in ("--set", change))]
    return found + (["--volume", str(data / volume)] if volume else [])


def workers(data: Path, folder: Path, repeats: int) -> Iterator[str]:
    """Seconds of a film by the number of processes and threads."""
    cores = num_cores()
    settings: dict[str, tuple[tuple[str, ...], str | None]] = {
        **{f"1 x {threads}": (("--workers", "1"), str(threads)) for threads in range(1, cores + 1)},
        f"{cores} x 1": (("--workers", str(cores)), None),
        f"{cores} x 2": (("--workers", str(cores)), "2"),
        f"{cores + 1} x 1": (("--workers", str(cores + 1)), None),
    }
    yield f"| 120 frames, demo 48 | {' | '.join(settings)} | {cores} x 1 against the best single | possible |"
    yield "|---" * (len(settings) + 3) + "|"
    for name in SCENES:
        seconds: dict[str, list[float]] = {setting: [] for setting in settings}
        for _ in range(repeats):
            for setting, (options, threads) in settings.items():
                seconds[setting].append(run([*scene_arguments(name, data), *options], folder, threads)[0])
        medians = {setting: statistics.median(each) for setting, each in seconds.items()}
        best = min(median for setting, median in medians.items() if setting.startswith("1 x"))
        times = " | ".join(f"{median:.1f} s" for median in medians.values())
        gain, possible = best / medians[f"{cores} x 1"], best / (medians["1 x 1"] / cores)
        yield f"| {name} | {times} | **{gain:.2f} x** | {possible:.2f} x |"


def loop(data: Path, folder: Path, repeats: int) -> Iterator[str]:
    """What a film takes beside drawing its splats."""
    yield "| engine, tolerance 0.1, 120 frames | total | drawing / cores | 1.25 x that + 3 s |"
    yield "|---|---|---|---|"
    for number in range(repeats):
        seconds, sidecar = run([*scene_arguments("engine, tolerance 0.1", data)], folder)
        drawing = sum(frame["seconds"]["draw"] for frame in sidecar["frames"]) / num_cores()
        yield f"| run {number + 1} | {seconds:.1f} s | {drawing:.1f} s | {1.25 * drawing + 3:.1f} s |"


def memory(folder: Path) -> Iterator[str]:
    """Memory of all processes of a film together, shared pages counted once."""
    yield "| 5000 frames | frame 100 | 1000 | 2500 | 5000 | 100 to 5000 |"
    yield "|---|---|---|---|---|---|"
    (folder / "scene.yaml").write_text(SMALL, encoding="utf-8")
    for name, options in {"1 process": ("--workers", "1"), "2 processes": ("--workers", "2")}.items():
        at = memory_at((100, 1000, 2500, 4990), folder, options)
        values = " | ".join(f"{at[frame] / MIB:.1f} MiB" for frame in at)
        yield f"| {name} | {values} | {100 * (at[4990] / at[100] - 1):+.1f} % |"


def memory_at(frames: Sequence[int], folder: Path, options: Sequence[str]) -> Mapping[int, float]:
    """Bytes, when so many frames are kept."""
    mark, found = uuid.uuid4().hex, dict[int, float]()
    environment = {**os.environ, "PYTHONPATH": str(ROOT), MARK: mark}
    command = [sys.executable, "-m", "hsplat_cli", "render", "scene.yaml", "--force", "--quiet", *options]
    with subprocess.Popen(command, cwd=folder, env=environment) as process:
        kept = folder / "film.mp4.unfinished"
        for frame in frames:
            while process.poll() is None and not (kept / f"{frame:06}.png").exists():
                time.sleep(0.005)
            found[frame] = sum(own_bytes(mark))
        assert process.wait() == 0
    return found


def own_bytes(mark: str) -> Iterator[int]:
    """Of each process with the mark, its memory, and its part of what it shares; not the pages of libraries."""
    for folder in Path("/proc").iterdir():
        try:
            if folder.name.isdigit() and f"{MARK}={mark}".encode() in (folder / "environ").read_bytes():
                text = (folder / "smaps_rollup").read_text()
                for kind in ("Anonymous", "Pss_Shmem"):
                    yield int(text.partition(f"\n{kind}:")[2].split()[0]) * 1024
        except OSError:
            continue


def main() -> None:
    """Print the tables, and write the page if one is asked for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", choices=["workers", "loop", "memory"])
    parser.add_argument("--page", type=Path)
    parser.add_argument("--repeats", type=int, default=3)
    arguments = parser.parse_args()
    lines: list[str] = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        tables = {
            "workers": lambda: workers(arguments.data.resolve(), folder, arguments.repeats),
            "loop": lambda: loop(arguments.data.resolve(), folder, arguments.repeats),
            "memory": lambda: memory(folder),
        }
        for title, table in tables.items():
            if arguments.only in (None, title):
                lines += ["", f"## {title.capitalize()}", ""]
                for line in table():
                    lines.append(line)
                    print(line, flush=True)
    if arguments.page:
        text = f"{PAGE_HEAD}\n`tests/bench/batches.py` wrote this page at {commit()}, on {num_cores()} cores.\n"
        arguments.page.write_text(text + "\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
