"""Shows a scene that is being edited on a page in a browser, by a script beside the page or a server for one user."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from urllib.parse import quote

from hsplat_cli.preview.server import Channel, serve_page
from hsplat_cli.preview.watch import State
from hsplat_cli.reports import render_page, webp_data_uri
from renderer.errors import InputError
from renderer.film import WrittenFiles, locked_files, staged_files, translate_os_errors, write_staged
from renderer.scene import require_file

# The first line of the script beside a page, which shows that hsplat has written the script.
_SCRIPT_MARK = b"// by hsplat\n"


@contextlib.contextmanager
def file_states(page: Path, title: str, inputs: Iterable[Path]) -> Iterator[Callable[[State], None]]:
    """Write a page, and a script beside it; yield a function that writes a state of the scene into the script.

    The page loads the script again and again: browsers let a page from a file load a script beside it, and nothing
    else. Both files are locked until the end of the context. Raises InputError if one of them is an input, or if a
    script that is not by hsplat has the name.
    """
    script = page.with_name(f"{page.name}.js")
    WrittenFiles([page, script]).require_harmless(inputs)
    _require_own_script(script)

    def show(state: State) -> None:
        write_staged(script, _SCRIPT_MARK + f"show({_json(state)});\n".encode(), is_durable=False)

    with locked_files([page, script]):
        with staged_files() as write:
            # Quoted, because a name with a colon would be the address of another server.
            address = quote(os.fsencode(script.name))
            write(page, render_page("watch.html", title=title, script=address, is_served=False).encode())
            write(script, _SCRIPT_MARK)
        yield show


def _require_own_script(script: Path) -> None:
    require_file(script, "the name of a script")
    with translate_os_errors(script):
        content = script.read_bytes() if script.exists() else b""
    if content and not content.startswith(_SCRIPT_MARK):
        raise InputError(
            "another script has this name", where=str(script), hint="move it, or give the page another --output"
        )


@contextlib.contextmanager
def served_states(title: str) -> Iterator[tuple[str, Callable[[State], None]]]:
    """Serve a page to this machine; yield its address, and a function that sends a state of the scene to the page."""
    page = render_page("watch.html", title=title, script="", is_served=True).encode()
    channel = Channel(_json(State(0)))
    with serve_page(page, channel) as address:
        yield address, lambda state: channel.send(_json(state))


def _json(state: State) -> str:
    """Return a state of the scene as JSON, in one line of ASCII, with its picture as a data URI."""
    shot = state.shot
    seen = {} if shot is None else {"uri": webp_data_uri(shot.pixels), "alt": shot.seen, "caption": shot.caption}
    return json.dumps({"number": state.number, "error": state.error, **seen})
