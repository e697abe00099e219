"""Kernels that may take long stop when the process is asked to end, in whatever thread they run."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import environment
from small_scene import engine_block, small_tree

import renderer
from renderer.kernels import SOURCES, Kernel, read_headers
from renderer.scene import parse_scene
from renderer.system import signals_as_interrupts, stop_flag

# The status of a kernel that was stopped.
STOPPED = 3

LONG_KERNELS = read_headers(SOURCES).long_kernels
# Far longer than a child of these tests takes to end.
MOST_SECONDS = 300


def mixed(**sections: Any) -> dict[str, Any]:
    """Return a scene of two volumes that overlap, each on a grid of its own."""
    tree = small_tree(frames=1, **sections)
    first = tree.pop("volume") | {"transfer_function": tree.pop("transfer_function")}
    moved = first | {"transform": [[1, 0, 0, 3.5], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}
    return tree | {"volumes": [first, moved]}


MIXED = mixed()
ALONE = small_tree(frames=1, shading={"light": [-1, 0, 0], "shadow": 0.5, "occlusion": 0.5})
MAXIMUM = small_tree(frames=1, mode="maximum")
SCATTERING = small_tree(frames=1, light={"key": {"direction": [1, -1, 1]}})
# The kernels of the light that matter scatters.
OF_SCATTERED_LIGHT = {
    "average_matter", "gather_light", "measure_round", "mix_rounds", "prepare_cells", "scatter_light", "shine_key",
    "sweep_light", "trace_paths",
}  # fmt: skip


def masked(folder: Path) -> dict[str, Any]:
    """Write a file of labels, and return a scene with a mask of one of them."""
    values = np.zeros((12, 24, 24), np.uint8)
    values[3:9, 4:20, 4:20] = 1
    np.save(folder / "labels.npy", values)
    return small_tree(frames=1) | {"mask": {"file": str(folder / "labels.npy"), "show": [1]}}


@pytest.fixture
def called(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[str]]:
    """Return a list: a signal comes when the kernel is called whose name is in it, and all that follow it are added."""
    names: list[str] = []
    run = Kernel._run

    def run_and_stop(kernel: Kernel, block: bytes, kept: list[Any]) -> int:
        if stop_flag.value:
            names.append(kernel._name)
        elif kernel._name == names[0]:
            stop_flag.value = signal.SIGTERM
        return run(kernel, block, kept)

    monkeypatch.setattr(Kernel, "_run", run_and_stop)
    yield names
    stop_flag.value = 0


@pytest.mark.parametrize("threads", ["1", "2"])
@pytest.mark.parametrize("name", sorted(LONG_KERNELS))
def test_each_long_kernel_stops(
    name: str, threads: str, called: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("LP_NUM_THREADS", threads)
    called.append(name)
    tree = {
        "draw_mixture": MIXED,
        "draw_extremes": MAXIMUM,
        "search_rays": MAXIMUM,
        "measure_chords": MAXIMUM,
        "mask_rays": masked(tmp_path),
    }.get(name, SCATTERING if name in OF_SCATTERED_LIGHT else ALONE)
    scene = parse_scene(tree, base=tmp_path)
    is_exact = name in ("integrate_rays", "mask_rays", "search_rays", "trace_paths")
    with pytest.raises(KeyboardInterrupt) as stopped:
        (renderer.integrate if is_exact else renderer.render_frame)(scene)
    assert stopped.value.args == (signal.SIGTERM,)
    assert {*called} <= LONG_KERNELS  # nothing was made of what is unfinished


class KernelUntilStopped(Kernel):
    """A kernel that runs until the flag stops it, or for a minute."""

    def __init__(self) -> None:
        self.status = 0

    def _run(self, block: bytes, kept: list[Any]) -> int:
        for _ in range(60_000):
            if stop_flag.value:
                self.status = STOPPED
                break
            time.sleep(0.001)
        return self.status


@pytest.mark.usefixtures("heeds_interrupts")
def test_a_kernel_that_another_thread_just_takes_is_stopped_and_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    kernel = KernelUntilStopped()
    submit = ThreadPoolExecutor.submit

    def submit_and_signal(*arguments: Any) -> Any:
        running = submit(*arguments)
        signal.raise_signal(signal.SIGTERM)
        return running

    monkeypatch.setattr(ThreadPoolExecutor, "submit", submit_and_signal)
    with signals_as_interrupts(), pytest.raises(KeyboardInterrupt):
        kernel._run_beside(b"", [])
    assert kernel.status == STOPPED


# Tells when a kernel begins, and with which status it ends.
CHILD = """
import os
import sys
import renderer
from renderer.kernels import Kernel
from hsplat_cli import main

run = Kernel._run

def run_and_tell(kernel, block, kept):
    if kernel._name != "draw_mixture":
        return run(kernel, block, kept)
    os.write(1, b"begun\\n")
    status = run(kernel, block, kept)
    os.write(1, b"%d\\n" % status)
    return status

Kernel._run = run_and_tell
"""
COMMAND = 'main.main(["render", "scene.yaml", "--quiet"])'
# Kernels draw it for a quarter of a minute on one core: its rays take thousands of samples, and none ends early.
LONG = mixed(
    volume=engine_block(64, 64, 64),
    transfer_function={"colormap": "gray", "range": [0, 255], "opacity": [[0, 0.01], [255, 0.01]]},
    error={"tolerance": 0},
    output={"file": "out.png", "size": [2048, 2048]},
)


@pytest.mark.usefixtures("heeds_interrupts", "folder")
@pytest.mark.parametrize(("number", "threads"), [(signal.SIGTERM, 1), (signal.SIGINT, 2)])
def test_a_signal_ends_a_process_inside_a_kernel(number: signal.Signals, threads: int) -> None:
    """With one thread, the main thread itself calls the kernel; with two, it waits for those that do."""
    assert stop_inside_a_kernel(COMMAND, number, threads) == (128 + number, ["hsplat: interrupted"])


@pytest.mark.usefixtures("heeds_interrupts", "folder")
def test_ctrl_c_ends_a_program_inside_a_kernel() -> None:
    status, said = stop_inside_a_kernel('renderer.render_frame("scene.yaml")', signal.SIGINT, 1)
    assert (status, said[-1]) == (-signal.SIGINT, "KeyboardInterrupt: 2")


def stop_inside_a_kernel(program: str, number: signal.Signals, threads: int) -> tuple[int, list[str]]:
    """Send a signal to a program that is inside a kernel; return its exit status and what it said.

    The kernel stops, and does not go on to its end.
    """
    Path("scene.yaml").write_text(json.dumps(LONG))
    command, variables = [sys.executable, "-c", CHILD + program], environment(LP_NUM_THREADS=str(threads))
    with subprocess.Popen(command, env=variables, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "begun\n"
        process.send_signal(number)
        told, said = process.communicate(timeout=MOST_SECONDS)
    *earlier, last = told.replace("begun", "").split()  # some may have ended before the signal
    assert last == str(STOPPED)
    assert {*earlier} <= {"0", last}
    return process.returncode, said.splitlines()
