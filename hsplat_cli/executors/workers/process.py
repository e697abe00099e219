"""Runs a worker as a child process: messages to and from it, whether it hangs, and how it ended."""

from __future__ import annotations

import signal
import subprocess
import threading
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from multiprocessing.connection import Pipe
from pathlib import Path
from queue import SimpleQueue
from typing import TypeAlias

from hsplat_cli.executors.frame_result import FrameResult
from hsplat_cli.executors.workers.child_processes import ChildProcesses, describe_exit
from renderer.errors import HsplatError, RenderError
from renderer.film import StreamTail

# Lines of a worker's standard error stream that a message shows.
_NUM_LAST_LINES = 5

# A process that has closed its connection is about to end; else it is killed. A killed process may never end, where the
# kernel waits for a device or a file system.
_EXIT_TIMEOUT_S, _KILL_TIMEOUT_S = 1.0, 5.0


# The name of its renderer when a worker is ready, a frame, an error as the last message; None is the end of all.
Message: TypeAlias = str | FrameResult | HsplatError | None
Messages: TypeAlias = "SimpleQueue[tuple[WorkerProcess, Message]]"


# A worker that is idle at this number of checks in a row hangs. Checks count, not time: a sleep of the machine, or a
# stop of this process, is one check.
CHECK_INTERVAL_S = 5.0
MAX_IDLE_CHECKS = 12


def hang_text() -> str:
    """Return the reason why a worker counts as hung."""
    return f"no processor time for {CHECK_INTERVAL_S * MAX_IDLE_CHECKS:g} s"


class WorkerProcess:
    """A worker, from its start on.

    messages: gets each message of the worker, with the worker; None when its connection has ended.
    renderer_name: of its rasteriser, once it is ready.
    """

    def __init__(
        self,
        child_processes: ChildProcesses,
        program: Sequence[str],
        stage_descriptor: int,
        environment: Mapping[str, str],
        messages: Messages,
    ) -> None:
        self.renderer_name: str | None = None
        self._num_idle_checks = 0
        self._processor_time: int | None = None
        self._killed_at: float | None = None
        self._child_processes, self._messages = child_processes, messages
        self._connection, other = Pipe()
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
                self._connection.close()
                raise RenderError("a process that draws cannot be started", got=str(error)) from error
        assert self._process.stderr is not None
        self._stderr_tail = StreamTail(self._process.stderr)
        self._receiver = threading.Thread(target=self._receive, daemon=True)
        self._receiver.start()

    @property
    def is_ready(self) -> bool:
        """Whether it can draw."""
        return self.renderer_name is not None

    def send(self, number: int) -> None:
        """Send the number of a frame to draw; that the worker has died shows when its messages end."""
        with suppress(OSError):
            self._connection.send(number)

    def _receive(self) -> None:
        try:
            while True:
                self._messages.put((self, self._connection.recv()))
        except (EOFError, OSError):  # it has ended
            pass
        finally:
            self._messages.put((self, None))

    def note_message(self) -> None:
        """Note that it has sent something, and does not hang."""
        self._num_idle_checks = 0

    def check_progress(self, *, has_work: bool) -> None:
        """Note whether it has used the processor since the last check; without a /proc it is taken to have."""
        before, self._processor_time = self._processor_time, _processor_time(self._process.pid)
        is_idle = has_work and before is not None and before == self._processor_time
        self._num_idle_checks = self._num_idle_checks + 1 if is_idle else 0

    @property
    def is_hung(self) -> bool:
        """Whether it has work and has, for check after check, neither used the processor nor sent anything."""
        return self._num_idle_checks >= MAX_IDLE_CHECKS

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
        self._receiver.join(_EXIT_TIMEOUT_S)
        if not self._receiver.is_alive():
            self._connection.close()

    def _ends_within(self, seconds: float) -> bool:
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(max(0.0, seconds))
        return not self.is_still_alive

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
        status, hint = self._process.returncode, None
        if self.is_hung:
            how = hang_text()
        elif status is None:
            how = "it does not end, though it was killed"
        else:
            how = describe_exit(status)
            if status == -signal.SIGKILL:
                hint = "where memory runs out the system sends this signal: fewer workers need less"
        return RenderError(
            f"a process that draws has {'hung' if self.is_hung or self.is_still_alive else 'died'}",
            got="\n    ".join([how, *self._stderr_tail.lines()[-_NUM_LAST_LINES:]]),
            hint=hint,
        )


def _processor_time(process: int) -> int | None:
    """Return the processor time of all threads of a process, in ticks; None where the system does not tell."""
    try:
        text = Path(f"/proc/{process}/stat").read_text(encoding="ascii", errors="replace")
    except OSError:
        return None
    fields = text.rpartition(")")[2].split()  # after the program's name, which may hold anything; proc_pid_stat(5)
    return int(fields[11]) + int(fields[12])
