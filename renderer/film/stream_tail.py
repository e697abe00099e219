"""The end of what a child process says: read all the time, so that it is never blocked, and kept in bounded memory."""

from __future__ import annotations

import os
import threading
from typing import IO

_NUM_BYTES = 2000
# A stream ends with its writer, but where that has left it to a child of its own.
_LONGEST_END_S = 1.0


class StreamTail:
    """The last bytes of a stream, which it takes over: they are read in the background until the stream ends."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream, self._tail = stream, b""
        self._thread = threading.Thread(target=self._drain, daemon=True)
        self._thread.start()

    def _drain(self) -> None:
        with self._stream:
            while words := os.read(self._stream.fileno(), 1 << 16):
                self._tail = (self._tail + words)[-_NUM_BYTES:]

    def lines(self) -> list[str]:
        """The last lines, without those that are empty; to be asked for once the writer has ended."""
        self._thread.join(_LONGEST_END_S)
        lines = self._tail.decode("utf-8", "replace").splitlines()
        return [line.strip() for line in lines if line.strip()]
