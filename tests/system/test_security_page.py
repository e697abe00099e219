"""The cluster of docs/security.md draws a film, and takes nothing from clients without its certificate."""

from __future__ import annotations

import asyncio
import os
import re
import shlex
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from distributed.comm import connect
from processes import wait_until
from small_scene import small_scene

import renderer

ROOT = Path(__file__).resolve().parents[2]
MAKE_CERTIFICATE, VARIABLES, PROGRAMS = re.findall(
    r"```bash\n(.*?)```", (ROOT / "docs/security.md").read_text("utf-8"), re.DOTALL
)
PYTHON = f"exec {shlex.quote(sys.executable)}"
COMMANDS = f"""\
python3() {{ {PYTHON} "$@"; }}
dask() {{ {PYTHON} -m dask "$@"; }}
hsplat() {{ {PYTHON} -m hsplat_cli "$@"; }}
"""
LONGEST_S = 60.0


@pytest.fixture
def port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        number: int = server.getsockname()[1]
        return number


def shell(text: str, folder: Path) -> subprocess.Popen[str]:
    """Start the commands of a user, with Python and hsplat as here."""
    environment = {name: value for name, value in os.environ.items() if not name.startswith("DASK_")}
    environment |= {"HOME": str(folder), "PYTHONPATH": str(Path(renderer.__file__).parents[1])}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT, "text": True, "start_new_session": True}
    return subprocess.Popen(["bash", "-c", COMMANDS + text], cwd=folder, env=environment, **pipes)  # type: ignore[call-overload,no-any-return]


@contextmanager
def running(text: str, folder: Path) -> Iterator[None]:
    """Run commands in the background, and kill them and all that they have started."""
    with shell(text, folder) as process:
        try:
            yield
        finally:
            os.killpg(process.pid, signal.SIGKILL)


def is_open(port: int) -> bool:
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


@pytest.mark.slow
def test_the_example(tmp_path: Path, port: int) -> None:
    (tmp_path / "scene.yaml").write_text(small_scene(), "utf-8")
    with shell(MAKE_CERTIFICATE, tmp_path) as process:
        assert process.communicate() == ("", None)
    assert (tmp_path / "cluster.pem").stat().st_mode & 0o777 == 0o600
    here = PROGRAMS.replace("node7", "127.0.0.1").replace("8786", str(port))
    scheduler, worker, render = (f"{VARIABLES}\n{line}" for line in here.splitlines())
    with ExitStack() as stack:
        stack.enter_context(running(scheduler, tmp_path))
        assert wait_until(lambda: is_open(port), LONGEST_S)
        stack.enter_context(running(worker, tmp_path))
        with pytest.raises(OSError):  # noqa: PT011  its text is Dask's
            asyncio.run(connect(f"tcp://127.0.0.1:{port}", timeout=1))
        with shell(render, tmp_path) as process:
            printed, _ = process.communicate(timeout=LONGEST_S)
        assert process.returncode == 0, printed
        assert (tmp_path / "film.mp4").is_file()
        with shell(here.splitlines()[-1] + " --force", tmp_path) as process:
            printed, _ = process.communicate(timeout=LONGEST_S)
    assert process.returncode == 2
    assert "TLS needs certificates" in printed
