"""Measure how well budgets are kept, and what progressive films cost.

`python tests/bench/budgets.py DATA` writes build/benchmarks/budgets.md.

Films are made by whole commands and judged by what their sidecars say; the machine has to have nothing else to do.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from measuring import PAGES, ROOT, THREADS, machine_line, parser_of, section, span, write_page

from renderer.bricks import brick_cut_sizes
from renderer.frame import finest_level_at, make_primitive, prepare_stage
from renderer.scene import load_scene

PAGE = PAGES / "budgets.md"

NUMBERS = (30, 100, 300, 1_000)
SECONDS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
# A film on a budget of time takes about this long to be measured.
FILM_S, FEWEST_FRAMES, MOST_FRAMES = 12.0, 15, 120
SETTLED, WINDOW = 5, 15


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    lines = []
    for line in chain(splats(data), seconds(data), progressive(data)):
        print(line, flush=True)
        lines.append(line)
    write_page(PAGE, [machine_line(), "", *lines])


def splats(data: Path) -> Iterator[str]:
    """The finest cut of at most N bricks: how far below N, and how far above it the next one is."""
    text = "The finest cut of at most N bricks, found from the pyramid. Goal: 0.5 % under N, or the next coarser cut."
    yield from section(
        "`splats: N`", text, "volume | N | bricks | under N | next finer cut | found in | the cut itself"
    )
    for name in ("engine", "bonsai"):
        scene = load_scene(ROOT / "configs" / f"{name}.yaml", volume=data / f"{name}.nhdr")
        stage = prepare_stage(scene, clock=time.perf_counter, num_threads=THREADS)
        (bricks,) = (layer.bricks for layer in stage.layers)
        assert bricks is not None
        primitive = make_primitive(stage)
        finest, at_zero = finest_level_at(stage, 1.0), finest_level_at(stage, 0.0)
        sizes = brick_cut_sizes([bricks], finest_levels=[finest], finest_levels_at_zero=[at_zero])
        for number in NUMBERS:
            start = time.perf_counter()
            tolerance = primitive.tolerance_for_cells(number)
            middle = time.perf_counter()
            found = primitive.make_lod(tolerance, lambda _: None).num_cells
            end = time.perf_counter()
            assert found <= number
            next_finer = sizes.counts[np.searchsorted(sizes.counts, number, side="right")] if tolerance else "none"
            under = f"{1 - found / number:.2%}" if tolerance else "full resolution"
            yield (
                f"| {name} | {number} | {found} | {under} | {next_finer} "
                f"| {(middle - start) * 1e3:.1f} ms | {(end - middle) * 1e3:.1f} ms |"
            )
    yield ""


def seconds(data: Path) -> Iterator[str]:
    """Films on a budget of time, and as a measure of the clock films at one of their tolerances."""
    text = (
        "*In time*: frames after the first five that took S within 20 %, or less at full resolution. A frame's time "
        "is from its start until the encoder has it. Goal: 90 %. *Steady*: frames of the same film, at the tolerance "
        f"of its middle frame, that took the median of the {WINDOW} frames around them within 20 %. This is what the "
        "machine allows."
    )
    columns = "volume | S | frames | in time | steady | median | predicted | bricks | cuts in the film"
    yield from section("`seconds: S`", text, columns)
    for name in ("engine", "bonsai"):
        for budget in SECONDS:
            num = min(max(int(FILM_S / budget), FEWEST_FRAMES), MOST_FRAMES)
            path = f"camera.path.frames={num}"
            frames = _render(data, name, [path, "error.tolerance=null", f"error.seconds={budget}"])["frames"]
            taken = _taken(frames)
            later = list(zip(frames, taken, strict=True))[SETTLED:]
            in_time = [_is_near(t, budget) or (t < budget and frame["tolerance"] == 0) for frame, t in later]
            tolerance = frames[num // 2]["tolerance"]
            same = [path, f"error.tolerance={tolerance!r}"]
            steady = _steady(_taken(_render(data, name, same)["frames"])[SETTLED:])
            cells = [frame["cells"] for frame in frames]
            predicted = statistics.median(frame["predicted_seconds"] for frame in frames)
            yield (
                f"| {name} | {budget:g} s | {num} | {sum(in_time) / len(in_time):.0%} | {steady:.0%} "
                f"| {statistics.median(taken):.3g} s | {predicted:.3g} s | {span(cells)} | {len(set(cells))} |"
            )
    yield ""


def _taken(frames: Sequence[dict[str, Any]]) -> list[float]:
    """Seconds of each frame."""
    return [sum(frame["seconds"].values()) for frame in frames]


def _steady(taken: Sequence[float]) -> float:
    """The share that is near the median around it."""
    around = [statistics.median(taken[max(0, i - WINDOW // 2) : i + WINDOW // 2 + 1]) for i in range(len(taken))]
    return sum(map(_is_near, taken, around)) / len(taken)


def _is_near(taken: float, wanted: float) -> bool:
    return abs(taken / wanted - 1) <= 0.2


def progressive(data: Path) -> Iterator[str]:
    """Progressive films against the last pass alone, one after the other."""
    text = (
        "The whole command against `hsplat render` without it. Goal: at most 1.4 times its time, where passes are 8 "
        "times apart in predicted seconds."
    )
    columns = "film | passes, predicted / taken | first film after | in all | the last pass alone | factor"
    yield from section("`--progressive`", text, columns)
    for name, tolerance, num in (("engine", 0.1, 60), ("engine", 0.0, 20), ("bonsai", 0.1, 30), ("engine", 0.1, 1)):
        changes = [f"error.tolerance={tolerance}", f"camera.path.frames={num}"]
        alone = _render(data, name, changes)
        whole = _render(data, name, changes, "--progressive")
        passes = ", ".join(f"{each['predicted_seconds']:.1f} / {each['seconds']:.1f} s" for each in whole["passes"])
        total, single = whole["seconds"]["total"], alone["seconds"]["total"]
        first = whole["passes"][0]["after_seconds"] - whole["seconds"]["read"]
        what = f"{name}, tolerance {tolerance:g}, {num} frame{'s' * (num > 1)}"
        yield f"| {what} | {passes} | {first:.2f} s | {total:.1f} s | {single:.1f} s | {total / single:.2f} |"
    yield ""
    yield "*First film after* counts from the start of the command, without the time to read the volume."


def _render(data: Path, name: str, changes: Sequence[str], *options: str) -> dict[str, Any]:
    """The sidecar of a film."""
    with tempfile.TemporaryDirectory() as folder:
        film = Path(folder) / "film.mp4"
        scene, volume = ROOT / "configs" / f"{name}.yaml", data / f"{name}.nhdr"
        command = [sys.executable, "-m", "hsplat_cli", "render", str(scene), "--quiet", "--best-effort", *options]
        command += ["--volume", str(volume), "--output", str(film)]
        command += [word for change in ("output.background=black", *changes) for word in ("--set", change)]
        subprocess.run(command, check=True, cwd=ROOT, stdout=subprocess.DEVNULL)
        record: dict[str, Any] = json.loads((Path(folder) / "film.mp4.json").read_text())
        return record


if __name__ == "__main__":
    main()
