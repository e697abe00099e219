"""Serves one page, and texts that update it, to one user of this machine.

Every user of the machine can connect to the port. Therefore the address has a secret token, and connections that make
no request are closed.
"""

from __future__ import annotations

import contextlib
import hmac
import secrets
import socket
import sys
import threading
import time
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

# A request, in the types of socketserver: a connection, or a packet with its connection.
_Request = socket.socket | tuple[bytes, socket.socket]
# The address of a client, in the types of socketserver.
_Address = tuple[str, int] | str

_LOOPBACK = "127.0.0.1"
# Largest number of connections at a time: each open tab has one, and a browser opens some in advance.
MAX_CONNECTIONS = 32
# Seconds that a client has to complete a request, and again to take the answer.
IDLE_S = 10.0
# Seconds without a new text after which a connection gets a line without text: writing the line detects a closed
# connection.
_HEARTBEAT_S = 5.0


class Channel:
    """Holds the latest text for the page, and hands each new text to every thread that waits for one."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._number = 0
        self._changed = threading.Condition()

    def send(self, text: str) -> None:
        """Replace the text, and wake all waiting threads."""
        with self._changed:
            self._text = text
            self._number += 1
            self._changed.notify_all()

    def texts(self) -> Iterator[str | None]:
        """Yield the latest message to the page and each later one, without end; None after _HEARTBEAT_S without one."""
        sent = -1
        while True:
            with self._changed:
                if self._number == sent:
                    self._changed.wait(_HEARTBEAT_S)
                is_new = self._number != sent
                sent, text = self._number, self._text
            yield text if is_new else None


@contextlib.contextmanager
def serve_page(page: bytes, news: Channel) -> Iterator[str]:
    """Serve a page at a free port of this machine, and yield its address; the texts of `news` are sent as events."""
    with _Server(page, news) as server:
        threading.Thread(target=server.serve_forever, name="hsplat-server", daemon=True).start()
        try:
            yield f"http://{_LOOPBACK}:{server.server_port}/{server.token}/"
        finally:
            server.shutdown()


class _Server(ThreadingHTTPServer):
    """Serves a limited number of connections, each with a limited time for its request."""

    daemon_threads = True

    def __init__(self, page: bytes, news: Channel) -> None:
        super().__init__((_LOOPBACK, 0), _Handler)
        self.page = page
        self.news = news
        self.token = secrets.token_urlsafe(24)
        self._places = threading.BoundedSemaphore(MAX_CONNECTIONS)
        # Time, by `time.monotonic`, at which a connection is closed that has made no whole request by then.
        self.deadlines: dict[socket.socket, float] = {}

    def process_request(self, request: _Request, client_address: _Address) -> None:
        """Answer the request in a thread, or close its connection if there are too many connections."""
        assert isinstance(request, socket.socket), "a TCP server has no datagrams"
        if not self._places.acquire(blocking=False):
            self.shutdown_request(request)
            return
        self.deadlines[request] = time.monotonic() + IDLE_S
        try:
            super().process_request(request, client_address)
        except BaseException:  # the thread has not started
            self._leave(request)
            raise

    def process_request_thread(self, request: _Request, client_address: _Address) -> None:
        """Answer the request, in the connection's own thread."""
        assert isinstance(request, socket.socket), "a TCP server has no datagrams"
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._leave(request)

    def _leave(self, request: socket.socket) -> None:
        self.deadlines.pop(request, None)
        self._places.release()

    def service_actions(self) -> None:
        """Close connections whose requests take too long, even if bytes still arrive."""
        now = time.monotonic()
        for request in [request for request, deadline in self.deadlines.copy().items() if now > deadline]:
            with contextlib.suppress(OSError):  # the connection may be closed already
                request.shutdown(socket.SHUT_RDWR)

    def handle_error(self, request: _Request, client_address: _Address) -> None:
        """Print nothing about a client that has left or takes too long."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    server: _Server
    timeout = IDLE_S

    def do_GET(self) -> None:
        self.server.deadlines.pop(self.connection, None)
        name = self.path.removeprefix("/").split("/")
        # A page of another origin can reach this server by a host name that leads to this address: require ours.
        is_own = self.headers.get("Host") == f"{_LOOPBACK}:{self.server.server_port}"
        if len(name) != 2 or not is_own or not hmac.compare_digest(name[0].encode(), self.server.token.encode()):
            self.send_error(404)
        elif name[1] == "":
            self._begin("text/html; charset=utf-8")
            self.wfile.write(self.server.page)
        elif name[1] == "events":
            self._begin("text/event-stream")
            for text in self.server.news.texts():
                self.wfile.write(f"{': no news' if text is None else f'data: {text}'}\n\n".encode())
        else:
            self.send_error(404)

    def _begin(self, kind: str) -> None:
        self.send_response(200)
        for header, value in {
            "Content-Type": kind,
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
        }.items():
            self.send_header(header, value)
        self.end_headers()

    def log_message(self, *_: object) -> None:
        """Print nothing."""
