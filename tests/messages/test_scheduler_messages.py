"""Messages of `hsplat render` where a cluster cannot be used."""

from __future__ import annotations

import importlib.util
import socket
import threading
from pathlib import Path

import pytest
from transcripts import Case, cases

from hsplat_cli import main

END = """\
  expected: the address of a Dask scheduler such as tcp://node7:8786
  hint: `dask scheduler` starts one, and says its address
"""


@pytest.fixture(autouse=True)
def _in_folder(scene_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.executors.cluster.connection._CONNECT_TIMEOUT_S", 0.5)


@cases("scheduler.txt")
def test_messages(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    case.check(capsys)
    assert not Path("engine.mp4").exists()


def answer_as_a_web_server(server: socket.socket) -> None:
    with server.accept()[0] as guest:
        guest.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
        guest.recv(1)


@pytest.mark.parametrize(
    ("answer", "timeout_s", "text"),
    [
        (lambda _: None, 0.5, "nobody answers at this address"),
        (answer_as_a_web_server, 3.0, "the server at this address is not a Dask scheduler"),
    ],
)
def test_another_server(answer, timeout_s, text, capsys, monkeypatch) -> None:
    monkeypatch.setattr("hsplat_cli.executors.cluster.connection._CONNECT_TIMEOUT_S", timeout_s)
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=answer, args=(server,), daemon=True).start()
        address = f"127.0.0.1:{server.getsockname()[1]}"
        assert main.run(["render", "scene.yaml", "--quiet", "--scheduler", address]) == 2
    assert capsys.readouterr() == ("", f"--scheduler {address}: {text}\n{END}")


@pytest.mark.parametrize("command", [["render", "scene.yaml"], ["turntable", "scan.nrrd", "-o", "films"]])
def test_dask_is_not_installed(command: list[str], capsys, monkeypatch) -> None:
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None if name == "distributed" else find_spec(name))
    assert main.run([*command, "--scheduler", "node7:8786", "--quiet"]) == 2
    assert capsys.readouterr() == (
        "",
        "the package distributed is not installed\n  hint: pip install 'hsplat[cluster]'\n",
    )
