"""Tests of the versions that an output records: of packages, and of sources that are not installed."""

from __future__ import annotations

import os
import subprocess
from importlib import metadata
from pathlib import Path

import numpy as np
import pytest

from renderer import versions


@pytest.fixture
def uninstalled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a folder of sources that is neither installed nor in a repository."""

    def version(package: str) -> str:
        if package == "hsplat":
            raise metadata.PackageNotFoundError(package)
        return "1.2"

    monkeypatch.setattr(metadata, "version", version)
    monkeypatch.setattr(versions, "_ROOT", tmp_path)
    return tmp_path


@pytest.fixture
def repository(uninstalled: Path) -> Path:
    """Return the same folder with one commit."""
    git(uninstalled, "init")
    (uninstalled / "source.py").write_text("one = 1\n")
    git(uninstalled, "add", ".")
    git(uninstalled, "commit", "-m", "Begin")
    return uninstalled


def git(folder: Path, *arguments: str) -> None:
    who = ["-c", "user.name=somebody", "-c", "user.email=somebody@example.org", "-c", "commit.gpgsign=false"]
    subprocess.run(["git", *who, *arguments], check=True, cwd=folder, capture_output=True)


def test_versions_are_those_of_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    found = versions.package_versions("scipy", "no-such-package")
    assert found["numpy"] == np.__version__
    assert "scipy" in found
    assert found["no-such-package"] == "not installed"
    monkeypatch.setattr(metadata, "version", lambda package: "1.2")
    assert versions.package_versions()["hsplat"] == "1.2"


def test_the_digest_of_the_sources_changes_with_a_shader(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(versions, "_ROOT", tmp_path)
    (tmp_path / "renderer" / "gl").mkdir(parents=True)
    digests = set()
    for text in ("one", "two"):
        (tmp_path / "renderer" / "gl" / "splat.glsl").write_text(text)
        digests.add(versions.sources_digest())
    assert len(digests) == 2


def test_sources_in_a_repository_have_their_commit(repository: Path) -> None:
    first = versions.package_versions()["hsplat"]
    assert first == f"commit {versions.commit()}"
    (repository / "source.py").write_text("one = 2\n")
    assert versions.package_versions()["hsplat"] == f"{first}-dirty"
    git(repository, "commit", "-a", "-m", "Go on")
    assert versions.package_versions()["hsplat"] not in (first, f"{first}-dirty")


def test_asking_for_the_commit_writes_nothing(repository: Path) -> None:
    """Somebody may be using the repository."""
    before = (repository / ".git" / "index").read_bytes()
    os.utime(repository / "source.py", (0, 0))  # the index would be brought up to date
    assert not versions.commit().endswith("-dirty")
    assert (repository / ".git" / "index").read_bytes() == before


def test_sources_without_a_commit_or_without_git_are_unknown(
    uninstalled: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert versions.commit() == "unknown"
    assert versions.package_versions()["hsplat"] == "not installed"
    git(uninstalled, "init")
    assert versions.commit() == "unknown"
    monkeypatch.setenv("PATH", str(uninstalled))
    assert versions.commit() == "unknown"
    assert versions.package_versions()["hsplat"] == "not installed"
