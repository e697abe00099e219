"""Speed of the pyramid, memory, and time to the first frame: `python tests/bench/run.py [engine.nhdr]`.

Every figure is printed with the goal it is held against, and nothing is timed before its result was verified. Times are
medians; where the machine is shared, CPU seconds say more than wall seconds, so that both are given.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from renderer.pyramid import Pyramid, build_pyramid
from renderer.scene import ControlPoint, ErrorSpec, PyramidSpec, TransferSpec
from renderer.system import commit
from renderer.transfer import TransferFunction, make_transfer_function
from renderer.volume import Volume, make_volume

ROOT = Path(__file__).resolve().parents[2]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("engine", nargs="?", type=Path, help="engine.nhdr, for the time to the first frame")
    parser.add_argument("--memory-child", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.memory_child:
        _memory_child(arguments.memory_child)
        return
    print(f"{platform.machine()}, {os.cpu_count()} cores; commit {commit()}")
    bench_pyramid()
    bench_memory()
    if arguments.engine:
        bench_first_frame(arguments.engine)


def bench_pyramid() -> None:
    """From the decoded array to the finished pyramid, on noise of which half is visible."""
    for dtype, goal in (("uint8", 500), ("uint16", 150), ("float32", 150)):
        volume, transfer = _noise(256, dtype)

        def build(volume: Volume = volume, transfer: TransferFunction = transfer) -> Pyramid:
            return build_pyramid(volume, transfer, spec=PyramidSpec(), error=ErrorSpec())

        start = time.perf_counter()
        pyramid = build()
        cold = time.perf_counter() - start
        _verify_root(pyramid, transfer)
        wall, cpu = _timed(build, 7)
        voxels = volume.values.size / 1e6
        print(
            f"pyramid {dtype}: {voxels / wall:.0f} Mvoxel/s (goal {goal}); {voxels / cpu:.0f} Mvoxel per CPU second; "
            f"first call {cold:.1f} s; {pyramid.num_bytes / volume.values.size:.2f} bytes a voxel"
        )


def bench_memory() -> None:
    """Peak of the whole program on 512^3 noise of 8 bits, half of it visible."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "noise.npy"
        np.save(path, np.random.default_rng(0).integers(0, 256, (512, 512, 512), dtype=np.uint8))
        child = [sys.executable, __file__, "--memory-child", str(path)]
        for _ in range(2):  # the first one may have compiled, which takes memory of its own
            peak = float(subprocess.run(child, check=True, capture_output=True, text=True).stdout.split()[-1])
    print(f"memory: peak {peak:.0f} MB for 512^3 uint8 (goal {3 * 512**3 / 1e6 + 300:.0f} MB)")


def _memory_child(path: Path) -> None:
    from hsplat_cli.main import run

    scene = path.with_suffix(".yaml")
    scene.write_text(
        f"""
version: 1
volume: {{file: {path}}}
transfer_function:
  points: [{{value: 127, color: white, opacity: 0}}, {{value: 255, color: white, opacity: 0.1}}]
camera: {{path: {{type: turntable, frames: 1, elevation: 20}}}}
error: {{tolerance: 2}}
output:
  file: {path.with_name("{frame}.png")}
"""
    )
    assert run(["render", str(scene), "--quiet"]) == 0
    # Not getrusage's maximum, which counts what the parent held when it started this process.
    status = Path("/proc/self/status").read_text()
    print(int(status.partition("VmHWM:")[2].split()[0]) * 1024 / 1e6)


def bench_first_frame(engine: Path) -> None:
    """From the command to the first PNG; the second run finds compiled kernels."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "hsplat_cli", "render", str(ROOT / "configs" / "engine.yaml"), "--volume"]
        command += [str(engine), "--frames", "0", "--quiet", "--output", f"{folder}/{{frame}}.png"]
        walls = []
        for _ in range(6):
            start = time.perf_counter()
            subprocess.run(command, check=True, cwd=ROOT)
            walls.append(time.perf_counter() - start)
            assert (Path(folder) / "0.png").stat().st_size > 0
    print(f"first frame: {statistics.median(walls[1:]):.2f} s from the command (goal 2)")


def _noise(side: int, dtype: str) -> tuple[Volume, TransferFunction]:
    """Uniform noise over the type's range ([0, 1) for floats), the upper half of it visible."""
    high = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1.0
    values = (np.random.default_rng(0).random((side, side, side), dtype=np.float32) * high).astype(dtype)
    points = [(0.0, 0.0), (0.4999, 0.0), (0.5, 0.01), (0.8, 0.3), (1.0, 0.6)]
    mapping = tuple(ControlPoint(float(at * high), (1.0, 0.5, at), opacity) for at, opacity in points)
    return make_volume(values, np.eye(4), "noise"), make_transfer_function(TransferSpec(mapping), 1.0)


def _verify_root(pyramid: Pyramid, transfer: TransferFunction) -> None:
    colors, extinctions = transfer.classify(pyramid.volume.values[::16])
    expected = np.append((colors * extinctions[..., None]).mean(axis=(0, 1, 2)), extinctions.mean())
    found = pyramid.levels[-1].means[0].astype(np.float64) * pyramid.mean_unit
    assert np.allclose(found, expected, rtol=0.01), (found, expected)


def _timed(function: Callable[[], object], times: int) -> tuple[float, float]:
    """Median wall and CPU seconds of some calls, after one that is not counted."""
    function()
    walls: list[float] = []
    cpus: list[float] = []
    for _ in range(times):
        wall, cpu = time.perf_counter(), time.process_time()
        function()
        walls.append(time.perf_counter() - wall)
        cpus.append(time.process_time() - cpu)
    return statistics.median(walls), statistics.median(cpus)


if __name__ == "__main__":
    main()
