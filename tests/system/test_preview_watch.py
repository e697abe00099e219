"""A scene that is edited while its page is open: what the page gets, and who may have it."""

from __future__ import annotations

import contextlib
import json
import select
import signal
import socket
import struct
import subprocess
import threading
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

import numpy as np
import pytest
from commands import HSPLAT, environment, other_process
from processes import wait_until
from small_scene import contents, small_scene

from hsplat_cli import main
from hsplat_cli.preview import State, file_states, served_states, watch
from hsplat_cli.scenes import SceneRequest

# The server answers so many connections at once.
MAX_CONNECTIONS = 32

SCENE = Path("scene.yaml")


def test_edits_are_shown(folder: Path) -> None:
    """Pictures become finer; a mistake is shown beside the last good picture; a file that vanishes is waited for."""
    right = small_scene(error="tolerance: 0.1")
    edits = [right.replace("0.7", "0.2"), right.replace("opacity", "opacty"), right, None, right.replace("255", "200")]
    states: list[list[State]] = [[]]

    def keeps_on() -> bool:
        if states[-1] and not edits:
            return False
        if states[-1]:
            states.append([])
            if (text := edits.pop(0)) is None:
                SCENE.unlink()
            else:
                SCENE.write_text(text, "utf-8")
        return True

    def show(state: State) -> None:
        states[-1].append(state)

    SCENE.write_text(right, "utf-8")
    watch(SceneRequest(SCENE), show, keeps_on)
    numbers = [state.number for each in states for state in each]
    assert numbers == [*range(1, len(numbers) + 1)]
    first, fainter, wrong, again, gone, last = states
    assert [state.shot.caption.split(",")[0] for state in first if state.shot] == [
        f"frame 0 at tolerance {tolerance}" for tolerance in (1, 0.3, 0.1)
    ]
    drawn = [each[-1].shot for each in (first, fainter, again)]
    assert all(drawn) and np.array_equal(drawn[0].pixels, drawn[2].pixels)
    assert not np.array_equal(drawn[0].pixels, drawn[1].pixels)
    assert len(wrong) == 1 and "scene.yaml:4:" in wrong[0].error and "did you mean opacity?" in wrong[0].error
    assert wrong[0].shot is fainter[-1].shot
    assert not again[-1].error
    assert "no such file" in gone[0].error and not last[-1].error


def test_a_large_volume_shows_some_voxels_first(folder: Path) -> None:
    """Only where its layer is made again, and then all."""
    large = small_scene(shape="136, 9, 9", error="tolerance: 0.1")
    edits, shown = [large.replace("elevation: 20", "elevation: 40"), large.replace("0.7", "0.2")], [list[bool]()]

    def keeps_on() -> bool:
        if shown[-1] and edits:
            SCENE.write_text(edits.pop(0), "utf-8")
            shown.append([])
        return bool(edits) or not shown[-1]

    def show(state: State) -> None:
        assert state.shot is not None
        shown[-1].append("some of the voxels" in state.shot.caption)

    SCENE.write_text(large, "utf-8")
    watch(SceneRequest(SCENE), show, keeps_on)
    assert shown == [[False] * 3, [False] * 3, [True, False, False]]


def test_only_who_has_the_address_is_served() -> None:
    with served_states("<b>scene") as (address, show):
        show(State(7, error="wrong"))
        with urllib.request.urlopen(address) as page:
            assert b"&lt;b&gt;scene" in page.read()
        with urllib.request.urlopen(f"{address}events") as events:
            assert events.readline() == b'data: {"number": 7, "error": "wrong"}\n'
        server = address.rsplit("/", 2)[0]
        other = {"Host": "example.org"}
        for wrong in (f"{server}/", f"{server}/x/", f"{address}x", urllib.request.Request(address, headers=other)):
            with pytest.raises(urllib.error.HTTPError, match="404"):
                urllib.request.urlopen(wrong)


def connected(address: str, request: bytes) -> socket.socket:
    """Return a connection to a server that has got these bytes."""
    connection = socket.create_connection(("127.0.0.1", urllib.parse.urlsplit(address).port or 0), timeout=60)
    connection.sendall(request)
    return connection


@pytest.mark.slow
def test_connections_that_hold_their_places_are_closed(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether they send nothing, or a byte now and then; further ones are closed at once meanwhile."""
    monkeypatch.setattr("hsplat_cli.preview.server.IDLE_S", 0.5)
    with served_states("scene") as (address, _), contextlib.ExitStack() as stack:
        held = [stack.enter_context(connected(address, b"GET")) for _ in range(MAX_CONNECTIONS)]
        with connected(address, b"") as refused:
            assert refused.recv(1) == b""
        with contextlib.suppress(ConnectionError):  # it is closed while it sends
            for _ in range(300):
                if select.select([held[0]], [], [], 0.1)[0]:
                    break
                held[0].sendall(b" ")
        assert select.select([held[0]], [], [], 0)[0]
        for connection in held[1:]:
            assert connection.recv(1) == b""
        with urllib.request.urlopen(address) as page:
            assert page.status == 200


@pytest.mark.slow
def test_a_client_that_leaves_is_no_news(capfd: pytest.CaptureFixture[str]) -> None:
    large = State(1, error="x" * 10_000_000)
    with served_states("scene") as (address, show):
        show(large)
        path = urllib.parse.urlsplit(address).path
        for name in ("", "events", "events"):
            request = f"GET {path}{name} HTTP/1.0\r\nHost: {urllib.parse.urlsplit(address).netloc}\r\n\r\n".encode()
            connection = connected(address, request)
            assert connection.recv(4) == b"HTTP"
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            connection.close()  # with a reset
        show(State(2))
    wait_until(lambda: not [each for each in threading.enumerate() if "process_request" in each.name], 60)
    assert capfd.readouterr() == ("", "")


@pytest.mark.usefixtures("heeds_interrupts")
@pytest.mark.parametrize(
    ("option", "number", "status"),
    [
        ("--serve", signal.SIGTERM, 143),
        pytest.param("--serve", signal.SIGINT, 0, marks=pytest.mark.slow),
        pytest.param("--watch", signal.SIGHUP, 129, marks=pytest.mark.slow),
        ("--watch", signal.SIGINT, 0),
    ],
)
def test_signals_end_it(folder: Path, option: str, number: int, status: int) -> None:
    SCENE.write_text(small_scene(), "utf-8")
    command = [*HSPLAT, "preview", "scene.yaml", option]
    with subprocess.Popen(command, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdout is not None and process.stdout.readline().startswith(b"page: ")
        process.send_signal(number)
        _, told = process.communicate()
    assert process.returncode == status
    assert told == (b"hsplat: interrupted\n" if status else b"")


@pytest.mark.parametrize("name", ["https:x.example#.yaml", "//x.example/a?b.yaml", "a'b\"c</script>.yaml", "%41.yaml"])
def test_a_name_is_no_address(folder: Path, name: str) -> None:
    """A browser reads the address of the script, as WHATWG's URL standard says, beside the page."""
    page = Path(name.replace("/", "_") + ".html")
    with file_states(page, name, []):
        text = page.read_text("utf-8")
    address = json.loads(text.partition("script.src = ")[2].partition(" + ")[0])
    found = urllib.parse.urlsplit(urllib.parse.urljoin("file:///folder/page.html", address))
    assert (found.scheme, found.netloc, found.query, found.fragment) == ("file", "", "", "")
    assert urllib.parse.unquote(found.path) == f"/folder/{page}.js"


def test_what_a_page_in_files_may_not_replace(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An input, a page or a script of somebody else, and a page that another process shows."""
    np.save("scan.npy", np.arange(216, dtype=np.uint8).reshape(6, 6, 6))
    SCENE.write_text(small_scene(volume="file: scene.html.js"), "utf-8")
    Path("scan.npy").rename("scene.html.js")
    refused = {"scene.html.js": "would overwrite an input"}
    for file, what in {**refused, "page.html": "another page", "other.html.js": "another script"}.items():
        if file not in refused:
            Path(file).write_text("mine", "utf-8")
        before = contents()
        assert main.run(["preview", "scene.yaml", "--watch", "-o", file.removesuffix(".js")]) == 2
        assert what in capsys.readouterr().err and contents() == before
    imports = "from hsplat_cli.preview import file_states"
    with other_process(imports, "file_states(Path('shown.html'), 'x', [])"):
        before = contents()
        for options in ([], ["--watch"]):
            assert main.run(["preview", "scene.yaml", "-o", "shown.html", *options]) == 2
            assert "shown.html: another job is writing this output" in capsys.readouterr().err
        assert contents() == before
    with file_states(Path("shown.html"), "x", []):
        pass
    assert not list(Path().glob(".*"))


def test_a_page_from_a_file_has_its_states_beside_it(folder: Path) -> None:
    with file_states(Path("page.html"), "</script>", []) as show:
        show(State(1, error="</script>"))
    assert Path("page.html").read_text("utf-8").count("</script>") == 1
    assert Path("page.html.js").read_text("utf-8") == '// by hsplat\nshow({"number": 1, "error": "</script>"});\n'
