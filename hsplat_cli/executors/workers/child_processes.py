"""Children that end when their parent does, however it ends, and when it wants them to.

The parent keeps the one end of a pipe for writing, into which nothing is ever written; the child holds the other. When
the parent closes its end, or is gone, SIGKILL included, the pipe breaks. A thread of the child waits for that and ends
it. It comes to its turn when no other thread has Python's lock, which some calls of libraries keep for long:
therefore Linux is asked to send the child SIGKILL as well. (That a parent's death sends a signal, PR_SET_PDEATHSIG,
Linux has too, but for the death of the thread that started the child, and not for a pipe that is closed.)

This file is also the program that children are started with, `python lifeline.py ...`: it takes hold of the pipe and
becomes the module that is wanted. It is not run by `-m`, which would look for modules in the current folder first, with
whatever is there in the place of ours: the child gets the parent's `sys.path`.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import runpy
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from types import TracebackType
from typing import IO

# Linux's number for "send this signal and not SIGIO", which `fcntl` knows by name only there.
_SET_SIGNAL = "F_SETSIG"


class ChildProcesses:
    """Starts children that end with this process, and at the end of the block at the latest."""

    def __init__(self) -> None:
        self._ends: dict[subprocess.Popen[bytes], int] = {}

    def __enter__(self) -> ChildProcesses:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.end_all()

    def start(
        self,
        module: str,
        arguments: Sequence[str] = (),
        *,
        pass_fds: Sequence[int] = (),
        env: Mapping[str, str] | None = None,
        stdout: int | IO[bytes] | None = None,
        stderr: int | IO[bytes] | None = None,
    ) -> subprocess.Popen[bytes]:
        """A child that runs a Python module as `python -m` does, with our modules and nothing on its standard input.

        It is in a session of its own: Ctrl-C in the terminal is for us, and we end it. pass_fds: file descriptors that
        it inherits, under the same numbers; there are no others. Raises OSError where it cannot be started.
        """
        child_end, parent_end = os.pipe()  # one for each: who gets a signal is a property of a pipe's end
        command = [sys.executable, os.path.abspath(__file__), str(child_end), str(len(sys.path)), *sys.path]
        try:
            child = subprocess.Popen(
                [*command, module, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=stdout,
                stderr=stderr,
                env=None if env is None else dict(env),
                pass_fds=[child_end, *pass_fds],
                start_new_session=True,
            )
        except BaseException:
            os.close(parent_end)
            raise
        finally:
            os.close(child_end)
        self._ends[child] = parent_end
        return child

    def end_child(self, child: subprocess.Popen[bytes]) -> None:
        """End a child if it has not ended; it is not waited for. For a second time this does nothing."""
        end = self._ends.pop(child, None)
        if end is not None:
            os.close(end)

    def end_all(self) -> None:
        """End all children that there still are; they are not waited for."""
        for child in list(self._ends):
            self.end_child(child)


def exit_with_parent(descriptor: int) -> None:
    """End this process as soon as the pipe breaks, of which this is the end for reading."""
    if hasattr(fcntl, _SET_SIGNAL):
        with contextlib.suppress(OSError):  # a kernel that passes for Linux
            fcntl.fcntl(descriptor, fcntl.F_SETOWN, os.getpid())
            fcntl.fcntl(descriptor, getattr(fcntl, _SET_SIGNAL), signal.SIGKILL)
            fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_ASYNC)
    # On Linux, too: for a pipe that broke before.
    threading.Thread(target=_end_when_broken, args=(descriptor,), daemon=True).start()


def _end_when_broken(descriptor: int) -> None:
    os.read(descriptor, 1)
    os._exit(1)


def _main() -> None:
    """Arguments: the pipe, how many folders the parent looks for modules in, these, the module and its arguments."""
    exit_with_parent(int(sys.argv[1]))
    num_folders = int(sys.argv[2])
    sys.path[:] = sys.argv[3 : 3 + num_folders]
    sys.argv[:] = sys.argv[3 + num_folders :]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _main()
