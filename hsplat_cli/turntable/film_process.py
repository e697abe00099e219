"""Makes films in processes of their own, each one film after the other. A film in which its process ends is lost alone.

The processes are kept, because Python and its packages take longer to start than a small film takes to be made. After
the end of a process, the next film gets a new one. Both sides of the connection are here: a request is a line of JSON
with a film's name and its volume, and the answer is a line with the film's entry of turntable.json.
"""

from __future__ import annotations

import json
import os
import signal
import socket
import subprocess
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from select import select
from typing import IO

from hsplat_cli.scenes import volume_place
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import manifest
from hsplat_cli.turntable.film_request import FilmRequest
from hsplat_cli.turntable.manifest import FILM_ENTRY, FilmEntry
from hsplat_cli.turntable.one_film import make_film
from renderer.errors import HsplatError, RenderError
from renderer.record import field_types as types, record_to_json, round_seconds
from renderer.scene import path_or_url
from renderer.system import ChildProcesses, describe_exit, num_cores, open_anonymous_file

# Seconds that interrupted processes have to remove their unfinished work and end. After them they are killed: a library
# that is being loaded can lose an interrupt.
_TERMINATE_TIMEOUT_S = 10.0
# The environment variable that limits the threads of numpy's linear algebra, and its value unless the environment has
# one. These threads wait for work by spinning, which took 6 % of the processors' time for films of 64^3 voxels.
_LINEAR_ALGEBRA = {"OPENBLAS_NUM_THREADS": "1"}


class FilmProcesses(AbstractContextManager["FilmProcesses"]):
    """An owner of processes that make films side by side, each one film after the other.

    A process is started for its first film. All processes end with the `with` block.
    """

    def __init__(self, arguments: Sequence[str], folder: Path, num: int, reporter: Reporter) -> None:
        """Make an owner of processes.

        arguments: the command line of `hsplat turntable`, without the option `--connection`. folder: the folder of
        films. num: the number of processes. If there are several, the text that a process prints on the standard error
        stream is kept until its film is asked for.
        """
        self._folder, self._reporter = folder, reporter
        self._waiting: deque[FilmRequest] = deque()
        # The scenes whose films were begun, in this order.
        self._begun: list[Path] = []
        # The entries of the films that are made, by scene.
        self._made: dict[Path, FilmEntry] = {}
        # The texts of processes that are not yet printed, by scene.
        self._said: dict[Path, bytes] = {}
        self._owned = ExitStack()
        logs = [self._owned.enter_context(open_anonymous_file()) if num > 1 else None for _ in range(num)]
        self._processes = [self._owned.enter_context(_FilmProcess(arguments, num, log)) for log in logs]

    def __exit__(self, _: object, error: object, __: object) -> None:
        """End the processes. After an interrupt, which they have not received, they first remove unfinished work."""
        with self._owned:
            if isinstance(error, KeyboardInterrupt):
                working = [process for process in self._processes if process.request is not None]
                for process in working:
                    process.terminate()
                end = time.monotonic() + _TERMINATE_TIMEOUT_S
                for process in working:
                    process.wait_until(end)
                    assert process.request is not None
                    self._said[process.request.scene] = process.said()
                for scene in self._begun:
                    self._reporter.relay(self._said.pop(scene, b""))

    def add(self, requests: Iterable[FilmRequest]) -> None:
        """Add requests. Their films are begun in this order, each as soon as there is a process for it."""
        self._waiting.extend(requests)

    def make(self, request: FilmRequest, meanwhile: Callable[[], None]) -> FilmEntry:
        """Wait until the film of an added request is made, and return its entry of turntable.json.

        If the process ends, the entry is on this failure. Print the text of the process, if it was kept.

        meanwhile: called while the processes make films.
        """
        self._begin()
        while request.scene not in self._made:
            meanwhile()
            for process in select([each for each in self._processes if each.request is not None], [], [])[0]:
                self._finish(process)
            self._begin()
        self._reporter.relay(self._said.pop(request.scene))
        return self._made[request.scene]

    def entry(self, request: FilmRequest) -> FilmEntry:
        """Return the entry of a film, which may be made, interrupted, or not begun."""
        has_begun = request.scene in self._begun
        return self._made.get(request.scene) or request.entry(
            manifest.INTERRUPTED if has_begun else manifest.NOT_STARTED
        )

    def _begin(self) -> None:
        """Give waiting requests to the processes that make no film."""
        for process in self._processes:
            if process.request is None and self._waiting:
                self._begun.append(self._waiting[0].scene)
                process.begin(self._waiting.popleft())

    def _finish(self, process: _FilmProcess) -> None:
        """Take the answer of a process, or note that it has ended."""
        request = process.request
        assert request is not None
        film, has_ended = process.finish()
        if has_ended:
            manifest.try_to_update(self._folder, [film], self._reporter)
        self._made[request.scene], self._said[request.scene] = film, process.said()


class _FilmProcess(AbstractContextManager["_FilmProcess"]):
    """An owner of one process that makes films. It is started for the first film and ends with the `with` block.

    request: the request for the film that the process makes; None if it makes none.
    """

    def __init__(self, arguments: Sequence[str], num: int, log: IO[bytes] | None) -> None:
        """Make an owner of a process.

        num: the number of processes that make films at once. log: the file that the process writes to as to a standard
        error stream; None for the standard error stream of this process.
        """
        self.request: FilmRequest | None = None
        self._arguments, self._num, self._log = arguments, num, log
        self._num_read = 0
        self._start_s = 0.0
        self._owned = ExitStack()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: socket.socket

    def __exit__(self, *_: object) -> None:
        self._owned.close()

    def fileno(self) -> int:
        """Return the descriptor that can be read when the film is made, or the process has ended."""
        return self._connection.fileno()

    def begin(self, request: FilmRequest) -> None:
        """Let the process make a film; start it if it is not running."""
        self._start_s = time.perf_counter()
        if self._process is None or self._process.poll() is not None:
            self._owned.close()
            started = _started(self._arguments, self._num, self._log)
            self._process, self._connection = self._owned.enter_context(started)
        self.request = request
        asked = json.dumps([request.scene.stem, str(volume_place(request.volume))])
        with suppress(OSError):  # the process is gone
            self._connection.sendall(f"{asked}\n".encode())

    def finish(self) -> tuple[FilmEntry, bool]:
        """Wait for the film. Return its entry of turntable.json, and whether the process ended before its answer."""
        assert self.request is not None and self._process is not None
        request, self.request, answer = self.request, None, b""
        with suppress(OSError), self._connection.makefile("rb") as lines:
            answer = lines.readline()
        if answer.endswith(b"\n"):
            film = types.read_record(FILM_ENTRY, json.loads(answer))
            assert film is not None, answer
            return film, False
        status = self._process.wait()
        error = RenderError(
            "the process that made this film ended early",
            where=str(volume_place(request.volume)),
            got=describe_exit(status),
            hint="where memory runs out the system sends this signal" if status == -signal.SIGKILL else None,
        )
        seconds = round_seconds(time.perf_counter() - self._start_s)
        return replace(request.failure(error), exit_code=status, seconds=seconds), True

    def said(self) -> bytes:
        """Return the text that the process has written to its log since the last call."""
        if self._log is None:
            return b""
        descriptor = self._log.fileno()
        # Read without moving the position in the file, which the process shares.
        text = os.pread(descriptor, os.fstat(descriptor).st_size - self._num_read, self._num_read)
        self._num_read += len(text)
        return text

    def terminate(self) -> None:
        """Ask the process, which makes a film, to end."""
        assert self._process is not None
        self._process.terminate()

    def wait_until(self, end: float) -> None:
        """Wait until a process that was asked to end has ended, or until a time by `monotonic`."""
        assert self._process is not None
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(max(0, end - time.monotonic()))


@contextmanager
def _started(
    arguments: Sequence[str], num: int, log: IO[bytes] | None
) -> Iterator[tuple[subprocess.Popen[bytes], socket.socket]]:
    """Yield a new process that makes films, and the connection to it. The process has ended after the block.

    Its threads are its share of those that this process may use. num, log: as for _FilmProcess.
    """
    ours, theirs = socket.socketpair()
    with ours:
        with ChildProcesses() as children:
            with theirs:
                process = children.start(
                    "hsplat_cli",
                    ["turntable", "--connection", str(theirs.fileno()), str(num), *arguments],
                    pass_fds=[theirs.fileno()],
                    stdout=subprocess.DEVNULL,
                    stderr=log,
                    env=_LINEAR_ALGEBRA | os.environ | {"LP_NUM_THREADS": str(max(1, num_cores() // num))},
                )
            yield process, ours
        process.wait()


def make_requested_films(
    connection: int, num_processes: int, request_of: Callable[[str, Path | str], FilmRequest], reporter: Reporter
) -> None:
    """Make the films that FilmProcesses asks for, until it closes the connection. A film may fail.

    connection: the descriptor of the socket. num_processes: the number of processes that make films at once, which
    share the processors and the memory for bricks. request_of: a function that returns the request for a film of a name
    and a volume.
    """
    with socket.socket(fileno=connection) as batch, batch.makefile("rb") as lines:
        for line in lines:
            name, volume = json.loads(line)
            request = replace(request_of(name, path_or_url(volume)), num_processes=num_processes)
            try:
                film = make_film(request, reporter)
            except HsplatError as error:
                film = request.failure(error)
            batch.sendall(f"{json.dumps(record_to_json(film))}\n".encode())
