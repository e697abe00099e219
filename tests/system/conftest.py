"""What several tests of whole commands start from."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture
def scene_folder(request: pytest.FixtureRequest, folder: Path) -> Path:
    """Return the current folder, with the module's SCENE in scene.yaml."""
    (folder / "scene.yaml").write_text(request.module.SCENE, encoding="utf-8")
    return folder


@pytest.fixture
def heeds_interrupts() -> Iterator[None]:
    """Let SIGINT interrupt: a shell starts background jobs, such as CI, with the signal ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
