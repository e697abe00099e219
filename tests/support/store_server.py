"""Serve a folder over HTTP on this machine, with faults in it; its folders are buckets of S3 and of Google, too.

A request of S3 for a key of a bucket is one for a file. The server of moto answers for all of AWS, and
needs 47 packages.
"""

from __future__ import annotations

import functools
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from io import BytesIO
from pathlib import Path
from typing import IO

# The path of a request of Google for an object, with the bucket and the key.
_GOOGLE = re.compile("/storage/v1/b/([^/]*)/o/([^/]*)")
# The part of a file that a request asks for: from a byte on, to a byte, or the last bytes.
_PART = re.compile("bytes=([0-9]*)-([0-9]*)")
# The fault of a server that takes a request and never answers.
STALL = 0


class ServedFolder:
    """A folder that a server serves.

    url: its URL. asked: the paths that were asked for, in order. parts: the same, each with the part of the file that
        was asked for, empty for all of it. faults: the status codes of the next answers for paths that end so; None
        for a broken connection, and STALL for no answer at all. has_ended: whether the server has ended, so that no
        answer is held back any longer. delay: the seconds before each answer. key: the access key of S3 by which
        requests have to be signed, empty for none.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self.asked: list[str] = []
        self.parts: list[tuple[str, str]] = []
        self.faults: dict[str, list[int | None]] = {}
        self.has_ended = threading.Event()
        self.delay = 0.0
        self.key = ""


class _Handler(SimpleHTTPRequestHandler):
    # Connections are used for several requests, as those of other servers.
    protocol_version = "HTTP/1.1"
    # A body does not wait until the client has acknowledged the headers, which would take 40 ms.
    disable_nagle_algorithm = True

    def __init__(self, *arguments: object, served: ServedFolder, **options: object) -> None:
        self._served = served
        super().__init__(*arguments, **options)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        self._served.asked.append(self.path)
        self._served.parts.append((self.path, self.headers.get("range", "")))
        time.sleep(self._served.delay)
        if self._served.key and f"Credential={self._served.key}/" not in self.headers.get("authorization", ""):
            self.send_error(403)
            return
        for end, codes in self._served.faults.items():
            if self.path.endswith(end) and codes:
                code = codes.pop(0)
                if code == STALL:
                    self._served.has_ended.wait()
                elif code is not None:
                    self.send_error(code)
                self.close_connection = True
                return
        super().do_GET()

    def send_head(self) -> IO[bytes] | BytesIO | None:
        """Send the head of an answer, and return its body: a file, or the part of one that was asked for."""
        part = _PART.fullmatch(self.headers.get("range", ""))
        file = Path(self.translate_path(self.path))
        if part is None or not file.is_file():
            return super().send_head()
        size = file.stat().st_size
        first = int(part[1]) if part[1] else max(0, size - int(part[2]))
        content = file.read_bytes()[first : int(part[2]) + 1 if part[1] and part[2] else size]
        self.send_response(206)
        self.send_header("Content-Range", f"bytes {first}-{first + len(content) - 1}/{size}")
        self.send_header("Content-Length", str(len(content)))
        self.end_headers()
        return BytesIO(content)

    def translate_path(self, path: str) -> str:
        """Return the file of a path; Google has all of a key, with its slashes, in one part of a path."""
        found = _GOOGLE.fullmatch(path.partition("?")[0])
        return super().translate_path(path if found is None else f"/{found[1]}/{found[2].replace('%2F', '/')}")

    def end_headers(self) -> None:
        """Add the headers of objects in a bucket."""
        self.send_header("ETag", '"1"')
        self.send_header("x-goog-generation", "1")
        super().end_headers()

    def log_message(self, *_: object) -> None:
        """Print nothing."""


class _Server(ThreadingHTTPServer):
    # Connections of clients that are open at the end are not waited for.
    daemon_threads = True
    block_on_close = False
    # The number of connections that may wait to be accepted.
    request_queue_size = 128

    def handle_error(self, *_: object) -> None:
        """Print nothing about connections that clients have closed."""


@contextmanager
def served_folder(folder: Path) -> Iterator[ServedFolder]:
    """Serve a folder at a free port until the end of the `with` block."""
    served = ServedFolder("")
    handler = functools.partial(_Handler, served=served, directory=str(folder))
    with _Server(("127.0.0.1", 0), handler) as server:
        served.url = f"http://127.0.0.1:{server.server_address[1]}"
        thread = threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True)
        thread.start()
        try:
            yield served
        finally:
            served.has_ended.set()
            server.shutdown()
            thread.join()
