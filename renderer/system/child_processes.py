"""Start child processes that end when their parent ends, even if it is killed, or when it closes their pipe.

The parent keeps the writing end of a pipe and never writes; the child has the reading end. When the parent closes its
end, or dies, even by SIGKILL, the pipe breaks. A thread of the child waits for the broken pipe and then ends the child.
The thread needs Python's global lock, which some libraries keep for long, so Linux is asked to send the child SIGKILL
as well. (The option PR_SET_PDEATHSIG of Linux would not do: it sends a signal when the thread ends that started the
child, not when the process ends.)

This file is also the program of the children, `python child_processes.py ...`: it takes the pipe and runs a module.
`python -m` would look for modules in the current folder first; the child gets the parent's `sys.path` instead, without
the current folder, which may have changed.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import runpy
import signal
import subprocess
import sys
import tempfile
import threading
from collections.abc import Sequence
from pathlib import Path
from typing import IO, Any

# The folder that holds the packages `renderer` and `hsplat_cli`.
_ROOT = str(Path(__file__).resolve().parents[2])

# The name, in Python's `fcntl` on Linux, of the command that chooses the signal which a change of a file sends.
_SET_SIGNAL = "F_SETSIG"


class ChildProcesses(contextlib.AbstractContextManager["ChildProcesses"]):
    """An owner of child processes, which end at the end of the `with` block, or when this process ends."""

    def __init__(self) -> None:
        self._ends: list[int] = []
        _open_standard_descriptors()

    def __exit__(self, *_: object) -> None:
        """End all children, without waiting for them."""
        for end in self._ends:
            os.close(end)

    def start(
        self, module: str, arguments: Sequence[str], *, pass_fds: Sequence[int] = (), **options: Any
    ) -> subprocess.Popen[bytes]:
        """Start a child that runs a Python module as `python -m` does. It can import hsplat, and has no standard input.

        The child is in another session: Ctrl-C in the terminal reaches only this process, which then ends the child.

        pass_fds: the file descriptors that the child inherits, under the same numbers. options: the arguments `stdout`,
            `stderr` and `env` of `subprocess.Popen`. Raises OSError if the child cannot be started.
        """
        if not sys.executable:  # Python may be embedded in another program
            raise FileNotFoundError(errno.ENOENT, "sys.executable does not name a Python interpreter")
        child_end, parent_end = os.pipe()  # each child has its own pipe: a break signals one process
        folders = [*filter(None, sys.path)]  # "" stands for the current folder, and is left out
        folders += [_ROOT] * (_ROOT not in folders)
        command = [sys.executable, os.path.abspath(__file__), str(child_end), str(len(folders)), *folders]
        self._ends.append(parent_end)
        try:
            return subprocess.Popen(
                [*command, module, *arguments],
                stdin=subprocess.DEVNULL,
                **options,
                pass_fds=[child_end, *pass_fds],
                start_new_session=True,
            )
        finally:
            os.close(child_end)


def _open_standard_descriptors() -> None:
    """Open the null device in place of each standard stream (input, output, error) that is closed.

    Otherwise, a pipe would get the number of the closed stream, and a child's standard stream would replace the pipe.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)


def open_anonymous_file(*, on_disk: bool = False) -> IO[bytes]:
    """Open a file without a name, in memory where the system can, else on disk.

    on_disk: whether it is always in the folder of temporary files, where parts that are not written take no room.
    """
    if hasattr(os, "memfd_create") and not on_disk:
        return open(os.memfd_create("hsplat", os.MFD_CLOEXEC), "w+b")
    return tempfile.TemporaryFile(prefix="hsplat-")


def describe_exit(status: int) -> str:
    """Return how a process ended, such as `exit status 1` or `signal SIGKILL`.

    status: as in `subprocess.Popen.returncode`: the exit status, or minus the number of a signal.
    """
    if status >= 0:
        return f"exit status {status}"
    return f"signal {signal.Signals(-status).name if -status in set(signal.Signals) else -status}"


def exit_with_parent(descriptor: int) -> None:
    """Let this process end as soon as a pipe from its parent breaks. descriptor: the reading end of the pipe."""
    if hasattr(fcntl, _SET_SIGNAL):
        with contextlib.suppress(OSError):  # some systems that imitate Linux refuse this request
            fcntl.fcntl(descriptor, fcntl.F_SETOWN, os.getpid())
            fcntl.fcntl(descriptor, getattr(fcntl, _SET_SIGNAL), signal.SIGKILL)
            fcntl.fcntl(descriptor, fcntl.F_SETFL, fcntl.fcntl(descriptor, fcntl.F_GETFL) | os.O_ASYNC)
    # The thread is needed on Linux, too, because the pipe may have broken before the signal was asked for.
    threading.Thread(target=_end_when_broken, args=(descriptor,), daemon=True).start()


def _end_when_broken(descriptor: int) -> None:
    os.read(descriptor, 1)
    os._exit(1)


def _main() -> None:
    """Run a module, as the program of a child.

    The command line has the number of the pipe's descriptor, the number of folders, the folders for `sys.path`, the
    name of the module, and the arguments of the module.
    """
    exit_with_parent(int(sys.argv[1]))
    num_folders = int(sys.argv[2])
    sys.path[:] = sys.argv[3 : 3 + num_folders]
    sys.argv[:] = sys.argv[3 + num_folders :]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)


if __name__ == "__main__":
    _main()
