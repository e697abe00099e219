"""Keep the end of a child's output in bounded memory, reading all the time so that the child never blocks."""

from __future__ import annotations

import os
import threading
from typing import IO

# The number of bytes at the end of a stream that are kept.
_NUM_BYTES = 2000
# The seconds to wait for the end of a stream after its writer has ended. Another process may hold the stream open.
_MAX_WAIT_S = 1.0


class StreamTail:
    """A buffer of the last bytes of a stream; a background thread reads the stream to its end, and closes it."""

    def __init__(self, stream: IO[bytes]) -> None:
        self._stream, self._tail = stream, b""
        self._thread = threading.Thread(target=self._drain, daemon=True)
        self._thread.start()

    def _drain(self) -> None:
        with self._stream:
            while block := os.read(self._stream.fileno(), 1 << 16):
                self._tail = (self._tail + block)[-_NUM_BYTES:]

    def lines(self) -> list[str]:
        """Return the last lines of the stream that are not empty. Call it only after the writer has ended."""
        self._thread.join(_MAX_WAIT_S)
        lines = self._tail.decode("utf-8", "replace").splitlines()
        return [line.strip() for line in lines if line.strip()]
