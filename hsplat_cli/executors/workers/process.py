"""Runs a worker as a child process: messages to and from it, whether it hangs, and how it ended."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from renderer.errors import ContextLostError, HsplatError, RenderError
from renderer.film import StreamTail
from renderer.system import ChildProcesses, describe_exit, join_lines

# Lines of a worker's standard error stream that a message shows.
_NUM_LAST_LINES = 5

# A process that has closed its connection is about to end; else it is killed. A killed process may never end, where the
# kernel waits for a device or a file system.
_EXIT_TIMEOUT_S, _KILL_TIMEOUT_S = 1.0, 5.0


# A worker that is idle at this number of checks in a row hangs. Checks count, not time: a sleep of the machine, or a
# stop of this process, is one check.
CHECK_INTERVAL_S = 5.0
MAX_IDLE_CHECKS = 12


class WorkerLostError(Exception):
    """A worker has died, hangs, or has lost its OpenGL context; it is closed.

    how: a few words. error: what the user gets to know. may_be_chance: not where its program ended by itself.
    """

    def __init__(self, how: str, error: HsplatError, *, may_be_chance: bool = True) -> None:
        super().__init__(how)
        self.how, self.error, self.may_be_chance = how, error, may_be_chance


class WorkerProcess:
    """A worker, from its start on. Raises RenderError where it cannot be started.

    renderer_name: of its rasteriser, once it is ready.
    """

    def __init__(
        self,
        child_processes: ChildProcesses,
        program: Sequence[str],
        stage_descriptor: int,
        environment: Mapping[str, str],
    ) -> None:
        self.renderer_name: str | None = None
        self._is_awaited, self._num_idle_checks = False, 0
        self._processor_time: int | None = None
        self._killed_at: float | None = None
        self._child_processes = child_processes
        self._socket, other = socket.socketpair()
        self._connection = Connection(os.dup(self._socket.fileno()))
        module, *arguments = program
        descriptors = [other.fileno(), stage_descriptor]
        with other:
            try:
                self._process = child_processes.start(
                    module,
                    [*arguments, *map(str, descriptors)],
                    pass_fds=descriptors,
                    env=environment,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                )
            except OSError as error:
                raise RenderError("a process that draws cannot be started", got=str(error)) from error
        assert self._process.stderr is not None
        self._stderr_tail = StreamTail(self._process.stderr)

    def wait_until_ready(self) -> str:
        """Return the name of its renderer, once it is ready; raises as `draw` does."""
        self.renderer_name = self.renderer_name or self._receive()
        return self.renderer_name

    def draw(self, number: int) -> Any:
        """Return the FrameResult of this frame; raises WorkerLostError, or what the worker failed with."""
        with suppress(OSError):  # it has died, as `_receive` finds, too
            self._connection.send(number)
        return self._receive()

    def _receive(self) -> Any:
        message = None
        self._is_awaited = True
        with suppress(EOFError, OSError):
            message = self._connection.recv()
        self._is_awaited = False
        if isinstance(message, ContextLostError):
            self.kill()
        elif isinstance(message, HsplatError):
            raise message
        elif message is not None:
            return message
        self.close()
        raise self._lost_error(message)

    def check_progress(self) -> None:
        """Kill it if at several checks in a row a message was due, and it has not used the processor between them.

        Without a /proc it is taken to have used it.
        """
        if self._killed_at is None:
            before, self._processor_time = self._processor_time, _processor_time(self._process.pid)
            is_idle = self._is_awaited and before is not None and before == self._processor_time
            self._num_idle_checks = self._num_idle_checks + 1 if is_idle else 0
            if self._num_idle_checks >= MAX_IDLE_CHECKS:
                self.kill()

    def kill(self) -> None:
        """End it at once, and what waits for its messages."""
        self._process.kill()
        with suppress(OSError):  # closed before
            self._socket.shutdown(socket.SHUT_RDWR)
        if self._killed_at is None:
            self._killed_at = time.monotonic()

    def close(self) -> None:
        """Wait for its end, and kill it if it does not end; give up on one that survives that."""
        with suppress(subprocess.TimeoutExpired):
            if self._killed_at is None:
                self._process.wait(_EXIT_TIMEOUT_S)
        if self._process.returncode is None:
            self.kill()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_KILL_TIMEOUT_S)
        self._child_processes.end_child(self._process)
        self._socket.close()
        self._connection.close()

    def _lost_error(self, lost_context: ContextLostError | None) -> WorkerLostError:
        """Return how it ended, after `close`, and what it printed last."""
        status, hint = self._process.returncode, None
        is_hung = self._num_idle_checks >= MAX_IDLE_CHECKS
        hang = f"no processor time for {CHECK_INTERVAL_S * MAX_IDLE_CHECKS:g} s"
        how = f"hung ({hang})" if is_hung else "lost OpenGL's context" if lost_context else "died"
        how += ", could not be ended" * (status is None)
        if lost_context:
            return WorkerLostError(how, lost_context)
        end = hang if is_hung else "it does not end, though it was killed" if status is None else describe_exit(status)
        if status == -signal.SIGKILL and not is_hung:
            hint = "where memory runs out the system sends this signal: fewer workers need less"
        error = RenderError(
            f"a process that draws has {'hung' if is_hung or status is None else 'died'}",
            got=join_lines([end, *self._stderr_tail.lines()[-_NUM_LAST_LINES:]]),
            hint=hint,
        )
        return WorkerLostError(how, error, may_be_chance=status is None or status < 0)


def _processor_time(process: int) -> int | None:
    """Return the processor time of all threads of a process, in ticks; None where the system does not tell."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()  # after the program's name, which may hold anything; proc_pid_stat(5)
    return int(fields[11]) + int(fields[12])
