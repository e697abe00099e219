"""Makes films in a process of its own, one after the other. A film in which the process ends is lost alone.

The process is kept, because Python and its packages take longer to start than a small film takes to be made. After its
end, the next film gets a new process. Both sides of the connection are here: a request is a line of JSON with a film's
name and its volume, and the answer is a line with the film's entry of turntable.json.
"""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from dataclasses import replace
from pathlib import Path

from hsplat_cli.scenes import volume_place
from hsplat_cli.terminal import Reporter
from hsplat_cli.turntable import manifest
from hsplat_cli.turntable.film_request import FilmRequest
from hsplat_cli.turntable.manifest import FILM_ENTRY, FilmEntry
from hsplat_cli.turntable.one_film import make_film
from renderer.errors import HsplatError, RenderError
from renderer.record import field_types as types, record_to_json, round_seconds
from renderer.scene import path_or_url
from renderer.system import ChildProcesses, describe_exit

# Seconds that an interrupted process has to remove its unfinished work and end. After them it is killed: a library that
# is being loaded can lose an interrupt.
_TERMINATE_TIMEOUT_S = 10.0


class FilmProcess(AbstractContextManager["FilmProcess"]):
    """An owner of a process that makes films, which is started for the first film and ends with the `with` block.

    arguments: the command line of `hsplat turntable`, without the option `--connection`. folder: the folder of films.
    """

    def __init__(self, arguments: Sequence[str], folder: Path, reporter: Reporter) -> None:
        self._arguments, self._folder, self._reporter = arguments, folder, reporter
        self._owned = ExitStack()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: socket.socket

    def __exit__(self, *_: object) -> None:
        """End the process, which is not making a film."""
        self._owned.close()

    def make(self, request: FilmRequest, meanwhile: Callable[[], None]) -> FilmEntry:
        """Make a film, and return its entry of turntable.json. If the process ends, the entry is on this failure.

        meanwhile: called while the process makes the film.
        """
        start = time.perf_counter()
        if self._process is None or self._process.poll() is not None:
            self._owned.close()
            self._process, self._connection = self._owned.enter_context(_started(self._arguments))
        try:
            film = self._ask(request, meanwhile)
        except KeyboardInterrupt:  # the process has not received the signal
            self._process.terminate()
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(_TERMINATE_TIMEOUT_S)
            raise
        if film is not None:
            return film
        status = self._process.wait()
        error = RenderError(
            "the process that made this film ended early",
            where=str(volume_place(request.volume)),
            got=describe_exit(status),
            hint="where memory runs out the system sends this signal" if status == -signal.SIGKILL else None,
        )
        seconds = round_seconds(time.perf_counter() - start)
        failure = replace(request.failure(error), exit_code=status, seconds=seconds)
        manifest.try_to_update(self._folder, [failure], self._reporter)
        return failure

    def _ask(self, request: FilmRequest, meanwhile: Callable[[], None]) -> FilmEntry | None:
        """Return the entry of a film that the process has made; None if the process ended before its answer."""
        asked, answer = json.dumps([request.scene.stem, str(volume_place(request.volume))]), b""
        with suppress(OSError):  # the process is gone
            self._connection.sendall(f"{asked}\n".encode())
        meanwhile()
        with suppress(OSError), self._connection.makefile("rb") as lines:
            answer = lines.readline()
        if not answer.endswith(b"\n"):
            return None
        film = types.read_record(FILM_ENTRY, json.loads(answer))
        assert film is not None, answer
        return film


@contextmanager
def _started(arguments: Sequence[str]) -> Iterator[tuple[subprocess.Popen[bytes], socket.socket]]:
    """Yield a new process that makes films, and the connection to it. The process has ended after the block."""
    ours, theirs = socket.socketpair()
    with ours:
        with ChildProcesses() as children:
            with theirs:
                process = children.start(
                    "hsplat_cli",
                    ["turntable", f"--connection={theirs.fileno()}", *arguments],
                    pass_fds=[theirs.fileno()],
                    stdout=subprocess.DEVNULL,
                )
            yield process, ours
        process.wait()


def make_requested_films(
    connection: int, request_of: Callable[[str, Path | str], FilmRequest], reporter: Reporter
) -> None:
    """Make the films that a FilmProcess asks for, until it closes the connection. A film may fail.

    connection: the descriptor of the socket. request_of: a function that returns the request for a film of a name and
    a volume.
    """
    with socket.socket(fileno=connection) as batch, batch.makefile("rb") as lines:
        for line in lines:
            name, volume = json.loads(line)
            request = request_of(name, path_or_url(volume))
            try:
                film = make_film(request, reporter)
            except HsplatError as error:
                film = request.failure(error)
            batch.sendall(f"{json.dumps(record_to_json(film))}\n".encode())
