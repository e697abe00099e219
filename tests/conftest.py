"""Shared by all layers: where the real volumes are, and an honest report when they are not there."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from this_process import read_here

from renderer.draw import BrickRasterizer, Rasterizer, SplatRasterizer
from renderer.scene import Scene

DATA_VARIABLE = "HSPLAT_TEST_DATA"
# Processes that tests start in the checkout import the hsplat under test, whose kernels are compiled.
os.environ["PYTHONSAFEPATH"] = "1"


def _data_dir() -> Path | None:
    folder = os.environ.get(DATA_VARIABLE)
    return Path(folder).resolve() if folder else None


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the tests that need real volumes when there are none."""
    if _data_dir() is not None:
        return
    left_out = [item for item in items if item.get_closest_marker("real_data")]
    if left_out:
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if not item.get_closest_marker("real_data")]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    if _data_dir() is None:  # how many that are is known only where tests run in this process
        terminalreporter.write_line(f"tests on real volumes are left out: {DATA_VARIABLE} is not set")


@pytest.fixture(scope="session")
def data_dir() -> Path:
    """The folder of real volumes; a wrong HSPLAT_TEST_DATA is a failure, not a skip."""
    folder = _data_dir()
    assert folder is not None, f"{DATA_VARIABLE} is not set"
    assert folder.is_dir(), f"{DATA_VARIABLE} names {folder}, which is not a folder"
    return folder


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the current folder, which is empty: messages hold names without a path."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture(scope="module")
def module_folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Return a folder that the tests of a module share; it is the current one where a test has no `folder`."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder := tmp_path_factory.mktemp("module"))
        yield folder


@pytest.fixture
def one_process(monkeypatch: pytest.MonkeyPatch) -> None:
    """Read files of all formats in this process, which is quicker for hundreds of them."""
    monkeypatch.setattr("renderer.readers.volume_reading.read_isolated", read_here)


@pytest.fixture
def fake_ffmpeg(tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Return a function that puts a shell script in the place of ffmpeg."""

    def install(script: str) -> None:
        program = tmp_path_factory.mktemp("bin") / "ffmpeg"
        program.write_text(f"#!/bin/sh\n{script}\n")
        program.chmod(0o755)
        monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(program))

    return install


@pytest.fixture
def heeds_interrupts() -> Iterator[None]:
    """Let signals interrupt this process and those that it starts.

    A shell starts background jobs, such as CI, with SIGINT ignored, and `nohup` with SIGHUP.
    """
    usual = {signal.SIGINT: signal.default_int_handler, signal.SIGHUP: signal.SIG_DFL, signal.SIGTERM: signal.SIG_DFL}
    before = {number: signal.signal(number, handler) for number, handler in usual.items()}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


@pytest.fixture(scope="session")
def rasterizer() -> Iterator[SplatRasterizer]:
    """The one GL context of the run. Where there is none this is an error, not a skip."""
    with SplatRasterizer() as gl:
        yield gl


@pytest.fixture(scope="session")
def brick_rasterizer() -> Iterator[BrickRasterizer]:
    """Draw bricks, of one test after the other."""
    with BrickRasterizer() as kernels:
        yield kernels


@pytest.fixture(scope="session")
def rasterizer_for(rasterizer: SplatRasterizer, brick_rasterizer: BrickRasterizer) -> Callable[[Scene], Rasterizer]:
    """Return the rasteriser of a scene's footprint."""
    return lambda scene: rasterizer if scene.needs_opengl else brick_rasterizer


@pytest.fixture(scope="session", autouse=True)
def _no_wait_for_disks() -> Iterator[None]:
    """Do not wait in this process until files are on the disk; processes that tests start do wait."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda descriptor: None)
        yield


@pytest.fixture(autouse=True)
def _loud_arithmetic() -> Iterator[None]:
    """Overflow, division by zero and invalid operations are errors in every test; underflow to 0 is right."""
    with np.errstate(over="raise", divide="raise", invalid="raise"):
        yield
