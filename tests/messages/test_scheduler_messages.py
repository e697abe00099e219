"""What a user reads about a cluster that cannot be had."""

from __future__ import annotations

import importlib.util
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from hsplat_cli import main
from hsplat_cli.executors.cluster import connection

EXPECTED = "the address of a Dask scheduler such as tcp://node7:8786, or local for processes on this machine"
HINT = "`dask scheduler` starts one, and says its address"


def refused(capsys: pytest.CaptureFixture[str], scheduler: str, *options: str) -> str:
    """What is said, before anything is drawn."""
    small = ["camera.path.frames=9", "output.size=[32, 32]", "volume.procedural.shape=[8, 8, 8]"]
    words = [word for change in small for word in ("--set", change)]
    assert main.run(["render", "scene.yaml", "--quiet", *words, "--scheduler", scheduler, *options]) == 2
    assert not Path("engine.mp4").exists()
    return capsys.readouterr().err


@pytest.fixture(autouse=True)
def _in_folder(scene_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "_CONNECT_TIMEOUT_S", 0.5)


@pytest.mark.parametrize("address", ["node7", "http://node7:8786", "tcp://node7:99999", "node7:", "a b:1", "Local"])
def test_no_address(address: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert refused(capsys, address) == f"--scheduler: not an address\n  got: '{address}'\n  expected: {EXPECTED}\n"


@pytest.fixture
def port() -> Iterator[int]:
    """At which somebody listens, and says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        yield server.getsockname()[1]


def test_nobody_answers(port: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Whether nobody is there or somebody is silent."""
    for address in ("tcp://127.0.0.1:1", f"127.0.0.1:{port}"):
        assert refused(capsys, address) == (
            f"--scheduler {address}: nobody answers at this address\n  expected: {EXPECTED}\n  hint: {HINT}\n"
        )


def test_another_server_answers(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(connection, "_CONNECT_TIMEOUT_S", 3.0)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def answer() -> None:
            with server.accept()[0] as guest:
                guest.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
                guest.recv(1)

        threading.Thread(target=answer, daemon=True).start()
        address = f"127.0.0.1:{server.getsockname()[1]}"
        assert refused(capsys, address) == (
            f"--scheduler {address}: the server at this address is not a Dask scheduler\n"
            f"  expected: {EXPECTED}\n  hint: {HINT}\n"
        )


def test_dask_is_not_installed(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert refused(capsys, "local") == (
        "the package distributed is not installed\n  hint: pip install 'hsplat[cluster]'\n"
    )


def test_what_does_not_go_together(capsys: pytest.CaptureFixture[str]) -> None:
    seconds = ("--set", "error.tolerance=null", "--set", "error.seconds=1")
    one_by_one = "are timed and drawn one after the other, by one process\n"
    on_budget = f"frames on a budget of time, error.seconds, {one_by_one}"
    assert refused(capsys, "local", *seconds) == f"--scheduler: {on_budget}"
    assert refused(capsys, "local", "--progressive") == f"--scheduler: frames of --progressive {one_by_one}"
    for options, text in ((seconds, on_budget), (["--progressive"], f"frames of --progressive {one_by_one}")):
        assert main.run(["render", "scene.yaml", "--workers", "2", *options]) == 2
        assert capsys.readouterr().err == f"--workers: {text}"
    assert refused(capsys, "node7:8786", "--workers", "2") == "--workers: the workers are those of the scheduler\n"
