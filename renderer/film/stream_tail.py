"""Keep the end of a child's output: read all the time, so that the child never blocks, in bounded memory."""

from __future__ import annotations

import os
import threading
from typing import IO

_NUM_BYTES = 2000
# A stream ends with its writer, unless the writer left it to another process.
_MAX_WAIT_S = 1.0


class StreamTail:
    """A buffer of the last bytes of a stream, which a background thread reads to its end, and closes."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream, self._tail = stream, b""
        self._thread = threading.Thread(target=self._drain, daemon=True)
        self._thread.start()

    def _drain(self) -> None:
        with self._stream:
            while block := os.read(self._stream.fileno(), 1 << 16):
                self._tail = (self._tail + block)[-_NUM_BYTES:]

    def lines(self) -> list[str]:
        """Return the last lines that are not empty. Call it after the writer has ended."""
        self._thread.join(_MAX_WAIT_S)
        lines = self._tail.decode("utf-8", "replace").splitlines()
        return [line.strip() for line in lines if line.strip()]
