"""Runs a worker as a child process: messages to and from it, whether it hangs, and how it ended."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hsplat_cli.executors.workers.child_processes import ChildProcesses
from hsplat_cli.executors.workers.messages import Message, receive_available, send
from renderer.errors import RenderError
from renderer.film import StreamTail

# Lines of a worker's standard error stream that a message shows.
_NUM_LAST_LINES = 5

# A process that has closed its socket is about to end; else it is killed. A killed process may never end, where the
# kernel waits for a device or a file system.
_EXIT_TIMEOUT_S, _KILL_TIMEOUT_S = 1.0, 5.0


@dataclass(frozen=True)
class HangPolicy:
    """A worker that is idle at `max_idle_checks` checks in a row, each `check_interval_s` seconds, hangs.

    Checks count, not time: a sleep of the machine, or a stop of this process, is one check.
    """

    check_interval_s: float = 5.0
    max_idle_checks: int = 12

    @property
    def hang_text(self) -> str:
        """Return the reason why a worker counts as hung."""
        return f"no processor time for {self.check_interval_s * self.max_idle_checks:g} s"


class WorkerProcess:
    """A worker, from its start on.

    renderer_name: of its OpenGL context, once it is ready.
    """

    def __init__(
        self,
        child_processes: ChildProcesses,
        program: Sequence[str],
        descriptor: int,
        environment: Mapping[str, str],
        hang_policy: HangPolicy,
    ) -> None:
        self.renderer_name: str | None = None
        self._hang_policy, self._num_idle_checks = hang_policy, 0
        self._processor_time: int | None = None
        self._killed_at: float | None = None
        self._socket, other = socket.socketpair()
        self._child_processes = child_processes
        module, *arguments = program
        with other:
            numbers = [str(other.fileno()), str(descriptor)]
            try:
                self._process = child_processes.start(
                    module,
                    [*arguments, *numbers],
                    pass_fds=[other.fileno(), descriptor],
                    env=environment,
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.PIPE,
                )
            except OSError as error:
                self._socket.close()
                raise RenderError("a process that draws cannot be started", got=str(error)) from error
        assert self._process.stderr is not None
        self._stderr_tail = StreamTail(self._process.stderr)
        self._incoming = receive_available(self._socket)

    def fileno(self) -> int:
        """Return the descriptor to wait for messages with."""
        return self._socket.fileno()

    @property
    def is_ready(self) -> bool:
        """Whether it can draw."""
        return self.renderer_name is not None

    def send(self, message: Message) -> None:
        """Send a message, which does not wait for a few of them; that it has died shows when its messages end."""
        with suppress(OSError):
            send(self._socket, message)

    def receive(self) -> Message | None:
        """Return the next message that it has sent; None for only part of one.

        Raises EOFError where it has ended.
        """
        self._num_idle_checks = 0
        try:
            return next(self._incoming)
        except OSError as error:  # it ended with a task unread
            raise EOFError from error

    def check_progress(self, *, has_work: bool) -> None:
        """Note whether it has used the processor since the last check; without a /proc it is taken to have."""
        before, self._processor_time = self._processor_time, _processor_time(self._process.pid)
        is_idle = has_work and before is not None and before == self._processor_time
        self._num_idle_checks = self._num_idle_checks + 1 if is_idle else 0

    @property
    def is_hung(self) -> bool:
        """Whether it has work and has, for check after check, neither used the processor nor sent anything."""
        return self._num_idle_checks >= self._hang_policy.max_idle_checks

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()
        if self._killed_at is None:
            self._killed_at = time.monotonic()

    def close(self) -> None:
        """Wait for its end, and kill it if it does not end; give up on one that survives that."""
        if self._killed_at is None and not self._ends_within(_EXIT_TIMEOUT_S):
            self.kill()
        if self._killed_at is not None:
            self._ends_within(self._killed_at + _KILL_TIMEOUT_S - time.monotonic())
        self._child_processes.end_child(self._process)
        self._socket.close()

    def _ends_within(self, seconds: float) -> bool:
        try:
            self._process.wait(max(0.0, seconds))
        except subprocess.TimeoutExpired:
            return False
        return True

    @property
    def is_still_alive(self) -> bool:
        """Whether it survived `close`."""
        return self._process.returncode is None

    @property
    def was_killed(self) -> bool:
        """Whether a signal ended it, or should have."""
        return self.is_still_alive or self._process.returncode < 0

    def exit_error(self) -> RenderError:
        """Return how it ended, after `close`, and what it printed last."""
        status = self._process.returncode
        if self.is_hung:
            how = self._hang_policy.hang_text
        elif status is None:
            how = "it does not end, though it was killed"
        else:
            how = f"signal {_signal_name(-status)}" if status < 0 else f"exit status {status}"
        is_for_memory = status == -signal.SIGKILL and not self.is_hung
        return RenderError(
            f"a process that draws has {'hung' if self.is_hung or self.is_still_alive else 'died'}",
            got="\n    ".join([how, *self._stderr_tail.lines()[-_NUM_LAST_LINES:]]),
            hint="where memory runs out the system sends this signal: fewer workers need less"
            if is_for_memory
            else None,
        )


def worker_environment(threads_per_worker: int) -> dict[str, str]:
    """Return our environment, with this number of threads for Mesa's software renderer unless the user has set it."""
    return {"LP_NUM_THREADS": str(threads_per_worker)} | os.environ


def _processor_time(process: int) -> int | None:
    """Return the processor time of all threads of a process, in ticks; None where the system does not tell."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()  # after the program's name, which may hold anything; proc_pid_stat(5)
    return int(fields[11]) + int(fields[12])


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # a real-time signal
        return str(number)
