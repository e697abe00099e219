"""The folder and the cluster that several tests of whole commands begin with."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest
from golden_projects import made_project, project

__all__ = ["made_project", "project"]


@pytest.fixture
def scene_folder(request: pytest.FixtureRequest, folder: Path) -> Path:
    """Return the current folder, with the module's SCENE in scene.yaml."""
    (folder / "scene.yaml").write_text(request.module.SCENE, encoding="utf-8")
    return folder


@pytest.fixture(scope="session")
def scheduler() -> Iterator[str]:
    """Return the address of a scheduler with two workers, which no test kills."""
    from clusters import running_cluster

    with running_cluster(2) as cluster:
        yield cluster.scheduler_address
