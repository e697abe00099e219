"""A worker as the pool sees it: a child process, the messages to and from it, and how it ended."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import threading
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import IO, Generic, TypeVar

from hsplat_cli.workers.lifeline import Lifeline
from hsplat_cli.workers.messages import Message, receive, send
from renderer.errors import RenderError

Task = TypeVar("Task")

# Of a worker's standard error stream, what a message can show.
_NUM_LAST_BYTES, _NUM_LAST_LINES = 2000, 5

# A process that has closed its socket is about to end; one that does not is ended.
_LONGEST_END_S = 1.0


class WorkerProcess(Generic[Task]):
    """One child, from its start on.

    renderer_name: of its GL context, once it is ready. tasks: those that it has and that are not done, the first of
    which it is at.
    """

    def __init__(
        self, lifeline: Lifeline, program: Sequence[str], descriptor: int, environment: Mapping[str, str]
    ) -> None:
        self.renderer_name: str | None = None
        self.tasks: deque[Task] = deque()
        self._socket, other = socket.socketpair()
        module, *arguments = program
        with other:
            numbers = [str(other.fileno()), str(descriptor)]
            try:
                self._process = lifeline.start(
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
        self._words = _Tail(self._process.stderr)

    def fileno(self) -> int:
        """To wait for messages with."""
        return self._socket.fileno()

    @property
    def is_ready(self) -> bool:
        """Whether it can be given tasks."""
        return self.renderer_name is not None

    def send(self, message: Message) -> None:
        """A few of them never have to wait. That it has died is seen when its messages end, and not here."""
        with suppress(OSError):
            send(self._socket, message)

    def receive(self) -> Message:
        """Its next message. Raises EOFError when there is none, for it has ended."""
        try:
            return receive(self._socket)
        except OSError as error:  # it ended with a task unread
            raise EOFError from error

    def kill(self) -> None:
        """End it at once."""
        self._process.kill()

    def close(self) -> None:
        """Wait for its end, which has come or is near."""
        try:
            self._process.wait(_LONGEST_END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._socket.close()

    @property
    def was_killed(self) -> bool:
        """Whether it ended by a signal."""
        return self._process.returncode < 0

    def last_words(self) -> RenderError:
        """How it ended, after `close`, and what it said last."""
        status = self._process.returncode
        how = f"signal {_signal_name(-status)}" if status < 0 else f"exit status {status}"
        is_for_memory = status == -signal.SIGKILL
        return RenderError(
            "a process that draws has died",
            got="\n    ".join([how, *self._words.lines()]),
            hint="where memory runs out the system sends this signal: fewer workers need less"
            if is_for_memory
            else None,
        )


def worker_environment(threads_each: int) -> dict[str, str]:
    """Ours, with so many threads for Mesa's software renderer unless the user has said how many."""
    return {"LP_NUM_THREADS": str(threads_each)} | os.environ


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:  # a real-time signal
        return str(number)


class _Tail:
    """The end of a stream, which is read all the time so that the writer is never blocked."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream, self._tail = stream, b""
        self._thread = threading.Thread(target=self._drain, daemon=True)
        self._thread.start()

    def _drain(self) -> None:
        with self._stream:
            while words := os.read(self._stream.fileno(), 1 << 16):
                self._tail = (self._tail + words)[-_NUM_LAST_BYTES:]

    def lines(self) -> list[str]:
        """The last ones, once the writer has ended."""
        self._thread.join(_LONGEST_END_S)
        words = self._tail.decode("utf-8", "replace")
        return [line.strip() for line in words.splitlines() if line.strip()][-_NUM_LAST_LINES:]
