"""The pages that say how to do a thing have one form, and each of their blocks is run, on small files."""

from __future__ import annotations

import re
import shlex
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from howto_page import FOLDER, SAMPLES, TABLE, blocks_of, howto_pages, words_of

from hsplat_cli import main
from renderer import render_frame

# The bytes that a picture may have.
MAX_PICTURE = 60_000
# The words that a page may have beside its blocks.
MAX_WORDS = 250
# The options that make the films of commands small.
SMALL = {
    "turntable": ["--frames=2", "--size=48"],
    "render": ["--frames=0:2", "--set=error.probes=8"],
    "verify": ["--precision=20"],
}
# Pages whose commands take more than three seconds.
SLOW = ("dark", "labels", "light", "microscopy")


def _runs(page: Path) -> Any:
    """Return the page as an argument of the test that runs its blocks."""
    return pytest.param(page, id=page.stem, marks=[pytest.mark.slow] if page.stem in SLOW else [])


@pytest.mark.parametrize("page", howto_pages(), ids=lambda page: page.stem)
def test_a_page_has_the_form_of_all(page: Path) -> None:
    """It has few words, begins with its goal in one sentence and a picture, and ends with three links."""
    assert words_of(page) <= MAX_WORDS
    heading, goal, picture, *_, links = page.read_text("utf-8").strip().split("\n\n")
    assert heading.startswith("# ")
    assert goal.count(".") == 1 and goal.endswith(".")
    assert re.fullmatch(rf"!\[.{{20,}}\]\({page.stem}\.webp\)", picture)
    assert (FOLDER / f"{page.stem}.webp").stat().st_size <= MAX_PICTURE
    assert len(re.findall(r"\]\(", links)) == 3


def test_the_navigation_has_all_pages() -> None:
    navigation = (FOLDER.parent / "site" / "mkdocs.yml").read_text("utf-8")
    assert [page.name for page in (*howto_pages(), SAMPLES) if f": howto/{page.name}\n" not in navigation] == []


@pytest.fixture(scope="module")
def samples(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """Write the files of the page of samples with a third of their voxels along each axis; return their folder."""
    folder = tmp_path_factory.mktemp("samples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in blocks_of(SAMPLES):
            exec(_smaller(block.text), {})
        yield folder


@pytest.mark.parametrize("page", [_runs(page) for page in howto_pages()])
def test_all_blocks_of_a_page_run(
    page: Path,
    samples: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    one_process: None,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """One after the other, on small files and films; a block of text is found in all that was printed before it."""
    shutil.copytree(samples, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    printed = ""
    for language, text in blocks_of(page):
        if language == "yaml":
            Path("scene.yaml").write_text(_smaller(text), "utf-8")
            assert render_frame("scene.yaml", -1).any()
        elif language == "csv":
            Path(TABLE).write_text(text, "utf-8")
        elif language == "bash":
            for line in text.splitlines():
                program, command, *arguments = shlex.split(line, comments=True)
                assert program == "hsplat"
                assert main.run([command, *arguments, *SMALL.get(command, [])]) == 0, line
            printed += " ".join(" ".join(capsys.readouterr()).split())
        else:
            assert language == "text"
            parts = " ".join(text.split()).split("...")
            assert re.search(".*".join(re.escape(part) for part in parts), printed), printed


def _smaller(text: str) -> str:
    """Return a block with a third of the voxels along each axis, in the same room, and with small frames."""
    text = re.sub(r"(?<=\()\d+, \d+, \d+(?=\))", _third, text)
    text = re.sub(r"(?<=shape: \[)(\d+, \d+, \d+)\]", lambda found: f"{_third(found)}], spacing: [3, 3, 3]", text)
    text = re.sub(r"dpi: (\d+)", lambda found: f"dpi: {int(found[1]) // 6}", text)
    return re.sub(r" size: \[\d+, \d+\]", " size: [240, 240]", text)


def _third(shape: re.Match[str]) -> str:
    """Return a shape with a third of the voxels along each axis."""
    return ", ".join(str(int(number) // 3) for number in shape[0].strip("]").split(", "))
