"""A worker with a fault, the `program` of a pool: `faulty_worker NAME FOLDER CONNECTION STAGE`.

In FOLDER the workers of one test record what has happened.
"""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from hsplat_cli.executors import FrameResult, draw_locally
from hsplat_cli.executors.workers import worker
from renderer.errors import InputError, RenderError
from renderer.frame import Stage

FRAME = 3  # where the fault happens
LONG_S = 2.0


def main(name: str, folder: Path, rest: Sequence[str]) -> None:
    """Run a worker with this fault."""
    if name in START_FAULTS:
        START_FAULTS[name](folder)

    def draw(stage: Stage, numbers: Sequence[int], rasterizer: Any, *rest: Any) -> Iterator[FrameResult]:
        if name in DRAW_FAULTS:
            DRAW_FAULTS[name](folder, numbers[0])
        if name in GL_FAULTS and GL_FAULTS[name](folder, numbers[0]):
            with rasterizer._context:
                ctypes.CDLL("libGL.so.1").glEnable(0xFFFF)
        return draw_locally(stage, numbers, rasterizer, *rest)

    worker.draw_locally = draw  # type: ignore[assignment]
    worker.main(rest)


def first(folder: Path, name: str) -> bool:
    """Return whether this is the first call with this name in the folder."""
    try:
        (folder / name).mkdir()
    except FileExistsError:
        return False
    return True


def talk_and_kill_once(folder: Path, number: int) -> None:
    """Print more than any pipe holds, and die once."""
    for _ in range(50):
        os.write(2, b"a driver's chatter\n" * 1000)
        os.write(1, b"a driver's chatter\n" * 1000)
    if number == FRAME and first(folder, "killed"):
        os.kill(os.getpid(), signal.SIGKILL)


def kill_often(folder: Path, number: int) -> None:
    """Die at the fourth frame of each worker."""
    if not any(first(folder, f"{os.getpid()} {k}") for k in range(3)):
        os.kill(os.getpid(), signal.SIGSEGV)


def kill_always(folder: Path, number: int) -> None:
    if number == FRAME:
        print("first words\n\n  the driver has given up", file=sys.stderr, flush=True)
        os.kill(os.getpid(), signal.SIGKILL)


def hang_up_once(folder: Path, number: int) -> None:
    """Close the connection and live on."""
    if number == FRAME and first(folder, "hung up"):
        os.closerange(3, 64)
        time.sleep(600)


def stop_once(folder: Path, number: int) -> None:
    if number == FRAME and first(folder, "stopped"):
        os.kill(os.getpid(), signal.SIGSTOP)


def take_long_once(folder: Path, number: int) -> None:
    """Take some seconds of processor time."""
    if number == FRAME and first(folder, "long"):
        end = time.process_time() + LONG_S
        while time.process_time() < end:
            pass


def input_error(folder: Path, number: int) -> None:
    if number == FRAME:
        raise InputError("a bad frame", where="scene.yaml", got="this", expected="that", hint="another")


def out_of_memory(folder: Path, number: int) -> None:
    if number == FRAME:
        raise MemoryError


def no_gl(folder: Path) -> None:
    def refuse(*, needs_opengl: bool) -> None:
        raise RenderError("no OpenGL 3.3 context could be made", got="nothing", expected="a driver", hint="install one")

    worker.open_rasterizer = refuse  # type: ignore[assignment]


def fail_to_start(folder: Path) -> None:
    raise ImportError("there is no such library")


def die_at_first_start(folder: Path) -> None:
    if first(folder, "died"):
        os.kill(os.getpid(), signal.SIGKILL)


def die_at_start(folder: Path) -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def stop_at_first_start(folder: Path) -> None:
    if first(folder, "stopped"):
        os.kill(os.getpid(), signal.SIGSTOP)


def stop_half_way_once(folder: Path) -> None:
    """Stop in the middle of a message."""
    whole_send = Connection.send

    def send(connection: Connection, message: object) -> None:
        if isinstance(message, FrameResult) and first(folder, "stopped"):
            os.write(connection.fileno(), b"\0\0\0\x10\x80")  # the first of 16 bytes
            os.kill(os.getpid(), signal.SIGSTOP)
        whole_send(connection, message)

    Connection.send = send  # type: ignore[method-assign]


START_FAULTS = {
    fault.__name__: fault
    for fault in (no_gl, fail_to_start, die_at_first_start, die_at_start, stop_at_first_start, stop_half_way_once)
}
DRAW_FAULTS = {
    fault.__name__: fault
    for fault in (
        talk_and_kill_once, kill_often, kill_always, hang_up_once, stop_once, take_long_once, input_error, out_of_memory
    )
}  # fmt: skip

# Whether OpenGL reports an error after a frame.
GL_FAULTS = {
    "gl_error_once": lambda folder, number: number == FRAME and first(folder, "lost"),
    "gl_error_always": lambda folder, number: number == FRAME,
}

if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]), sys.argv[3:])
