"""Show the states of a scene on a page that is open in a browser: by a file beside it, or by a server for one user."""

from __future__ import annotations

import contextlib
import hmac
import json
import secrets
import threading
from collections.abc import Callable, Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from hsplat_cli.preview.watch import State
from hsplat_cli.reports import render_page, webp_data_uri
from renderer.film import staged_files, write_staged

_LOOPBACK = "127.0.0.1"
# How often a connection without news hears that there are none, so that one that is closed is noticed.
_HEARTBEAT_S = 5.0


def file_states(page: Path, title: str) -> Callable[[State], None]:
    """Write a page, and return what shows a state on it: a script beside the page, which looks for it again and again.

    Browsers let a page from a file load a script from beside it, and nothing else.
    """
    script = page.with_name(f"{page.name}.js")
    with staged_files() as write:
        write(page, render_page("watch.html", title=title, script=script.name, is_served=False).encode())
        write(script, b"")
    return lambda state: write_staged(script, f"show({_json(state)});\n".encode(), is_durable=False)


@contextlib.contextmanager
def served_states(title: str) -> Iterator[tuple[str, Callable[[State], None]]]:
    """Serve a page to this machine, and yield its address and what shows a state on it.

    The address has a token, without which nothing is answered, and a port that is free.
    """
    page = render_page("watch.html", title=title, script="", is_served=True).encode()
    token, changed, states = secrets.token_urlsafe(24), threading.Condition(), [State(0)]

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            name = self.path.removeprefix("/").split("/")
            # A page of another origin can ask for a name of its own that leads to this address.
            is_own = self.headers.get("Host") == f"{_LOOPBACK}:{server.server_port}"
            if len(name) != 2 or not is_own or not hmac.compare_digest(name[0].encode(), token.encode()):
                self.send_error(404)
            elif name[1] == "":
                self._begin("text/html; charset=utf-8")
                self.wfile.write(page)
            elif name[1] == "events":
                self._begin("text/event-stream")
                with contextlib.suppress(OSError):  # the browser has gone
                    self._send_states()
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

        def _send_states(self) -> None:
            sent = None
            while True:
                with changed:
                    if states[0] is sent:
                        changed.wait(_HEARTBEAT_S)
                    state = states[0]
                text = ": no news" if state is sent else f"data: {_json(state)}"
                self.wfile.write(f"{text}\n\n".encode())
                self.wfile.flush()
                sent = state

        def log_message(self, *_: object) -> None:
            """Print nothing."""

    def show(state: State) -> None:
        with changed:
            states[0] = state
            changed.notify_all()

    with ThreadingHTTPServer((_LOOPBACK, 0), Handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, name="hsplat-server", daemon=True).start()
        try:
            yield f"http://{_LOOPBACK}:{server.server_port}/{token}/", show
        finally:
            server.shutdown()


def _json(state: State) -> str:
    """Return a state in one line of ASCII."""
    shot = state.shot
    seen = {} if shot is None else {"uri": webp_data_uri(shot.pixels), "alt": shot.seen, "caption": shot.caption}
    return json.dumps({"number": state.number, "error": state.error, **seen})
