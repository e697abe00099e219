"""Tests of the versions that an output records: of packages, and of sources that are not installed."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from renderer.system import commit, package_versions, sources_digest


def forget_versions() -> None:
    """Let this process read the versions of packages and sources again."""
    sys.modules[package_versions.__module__]._version.cache_clear()
    sources_digest.cache_clear()


@pytest.fixture(autouse=True)
def _as_in_a_new_process() -> Iterator[None]:
    forget_versions()
    yield
    forget_versions()


@pytest.fixture
def uninstalled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of sources that is neither installed nor in a repository."""

    def version(package: str) -> str:
        if package == "hsplat":
            raise metadata.PackageNotFoundError(package)
        return "1.2"

    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setattr("renderer.system.versions._ROOT", tmp_path)
    return tmp_path


@pytest.fixture
def repository(uninstalled: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the same folder with one commit, and a stand-in for git, which not every machine has.

    It prints the file that has the name of its command, if it is called without locks: others may be using the
    repository.
    """
    (uninstalled / ".git").mkdir()
    (uninstalled / "git").write_text('#!/bin/sh\n[ "$1" = --no-optional-locks ] && cat "$2"\n')
    (uninstalled / "git").chmod(0o755)
    (uninstalled / "describe").write_text("1a2b3c4\n")
    (uninstalled / "status").write_text("")
    monkeypatch.setenv("PATH", str(uninstalled), prepend=os.pathsep)
    return uninstalled


def test_versions_are_those_of_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    found = package_versions("scipy", "no-such-package")
    assert found["numpy"] == np.__version__
    assert "scipy" in found
    assert found["no-such-package"] == "not installed"
    forget_versions()
    monkeypatch.setattr(metadata, "version", lambda package: "1.2")
    assert package_versions()["hsplat"] == "1.2"


def test_the_digest_of_the_sources_changes_with_a_shader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("renderer.system.versions._ROOT", tmp_path)
    (tmp_path / "renderer" / "gl").mkdir(parents=True)
    digests = set()
    for text in ("one", "two"):
        (tmp_path / "renderer" / "gl" / "splat.glsl").write_text(text)
        forget_versions()
        digests.add(sources_digest())
    assert len(digests) == 2


def test_a_process_goes_on_with_the_sources_that_it_has_loaded(repository: Path) -> None:
    (repository / "renderer").mkdir()
    (repository / "renderer" / "source.py").write_text("")
    before = package_versions(), sources_digest()
    (repository / "renderer" / "source.py").write_text("a = 1")
    (repository / "status").write_text(" M source.py\n")
    assert (package_versions(), sources_digest()) == before


def test_sources_in_a_repository_have_their_commit(repository: Path) -> None:
    assert package_versions()["hsplat"] == "commit 1a2b3c4"
    forget_versions()
    (repository / "status").write_text(" M source.py\n")
    assert package_versions()["hsplat"] == "commit 1a2b3c4-dirty"


def test_sources_without_a_commit_or_without_git_are_unknown(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (repository / "describe").write_text("")
    assert commit() == "unknown"
    assert package_versions()["hsplat"] == "not installed"
    (repository / "describe").write_text("1a2b3c4\n")
    monkeypatch.setenv("PATH", str(repository / ".git"))
    assert commit() == "unknown"
    monkeypatch.undo()
    monkeypatch.setattr("renderer.system.versions._ROOT", repository / "describe")
    assert commit() == "unknown"  # no repository
