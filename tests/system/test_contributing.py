"""The worked examples of docs/contributing: each is put into a copy of the sources, in which its commands pass.

A sentence before a block says where the block goes: `In a new file`, `At the end of` or `In` a file. The last has
blocks of changes, whose lines begin with `+`, `-` or a space; a line `@@` stands between two places.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from commands import CODE

PAGES = CODE / "docs" / "contributing"
# The sentence before a block of code, and the block: how a file is changed, the file, the language and the text.
_STEP = re.compile(
    r"(?:(In a new file|At the end of|In)\s`([^`]+)`[^`]*:\n\n)?```(\w+)\n(.*?)^```$", re.DOTALL | re.MULTILINE
)
# What a copy needs to run tests and commands.
_COPIED = ("renderer", "hsplat_cli", "tests", "docs", "configs", "pyproject.toml")
# The reasons for commands that do not run here, by their beginnings.
_LEFT_OUT = {
    "HSPLAT_REWRITE=1 pytest tests/messages": "all messages take a minute, and change nothing else",
    "python -m renderer.kernels.build --checked": "compiles all kernels a second time",
}


def _examples() -> list[Path]:
    """Return the pages with worked examples."""
    return sorted(page for page in PAGES.glob("*.md") if page.name != "README.md")


def _run(command: str, folder: Path) -> None:
    """Run a line of a shell in a copy of the sources, with the Python of this process."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    run = subprocess.run(
        ["sh", "-c", command], cwd=folder, check=False, capture_output=True, text=True,
        env=os.environ | {"PATH": path, "PYTHONPATH": str(folder)},
    )  # fmt: skip
    assert run.returncode == 0, f"{command}\n{run.stdout}{run.stderr}"


def _changed(text: str, change: str) -> str:
    """Return the text of a file with a block of changes."""
    for place in re.split(r"^@@\n", change, flags=re.MULTILINE):
        lines = place.splitlines(keepends=True)
        assert all(line[0] in " +-" for line in lines)
        before, after = ("".join(line[1:] for line in lines if line[0] in kept) for kept in (" -", " +"))
        assert text.count(before) == 1, f"{text.count(before)} times:\n{before}"
        text = text.replace(before, after)
    return text


@pytest.mark.slow
@pytest.mark.parametrize("page", _examples(), ids=lambda page: page.stem)
def test_an_example_works_in_a_copy_of_the_sources(page: Path, tmp_path: Path) -> None:
    for name in _COPIED:
        copy = shutil.copytree if (CODE / name).is_dir() else shutil.copy
        copy(CODE / name, tmp_path / name)
    commands = list[str]()
    for how, name, language, block in _STEP.findall(page.read_text("utf-8")):
        if language == "bash":
            commands += block.splitlines()
            continue
        assert how, f"no file is named before:\n{block}"
        file = tmp_path / name
        assert file.exists() == (how != "In a new file"), name
        assert (language == "diff") == (how == "In"), name
        text = file.read_text("utf-8") if file.exists() else ""
        space = "" if not text else "\n\n" if file.suffix == ".py" else "\n"
        file.write_text(_changed(text, block) if how == "In" else f"{text}{space}{block}", "utf-8")
    assert commands
    for command in commands:
        if not any(command.startswith(each) for each in _LEFT_OUT):
            _run(command, tmp_path)
    _run("ruff check . && ruff format --check .", tmp_path)
