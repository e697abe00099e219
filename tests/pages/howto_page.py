"""Run the blocks of the pages in docs/howto, and draw their pictures: `python howto_page.py [NAME ...]`, or all.

A picture is the film of its page's last scene, as that scene stands on the page. Scenes read the files that the blocks
of docs/howto/samples.md write.
"""

from __future__ import annotations

import os
import re
import sys
import tempfile
import textwrap
from pathlib import Path
from typing import NamedTuple

from renderer import load_scene, render

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "howto"
SAMPLES = FOLDER / "samples.md"
# Where a scene looks for the table of names that its page shows.
TABLE = "names.csv"
# A block of code, perhaps in a list: its language, and its text.
_BLOCK = re.compile(r"^ *```(\w*)\n(.*?)^ *```", re.DOTALL | re.MULTILINE)


class Block(NamedTuple):
    """A block of code on a page."""

    language: str
    text: str


def howto_pages() -> list[Path]:
    """Return the pages that each say how to do a thing."""
    return sorted(page for page in FOLDER.glob("*.md") if page != SAMPLES)


def blocks_of(page: Path) -> list[Block]:
    """Return the blocks of a page in their order."""
    found = _BLOCK.findall(page.read_text("utf-8"))
    return [Block(language, textwrap.dedent(text)) for language, text in found]


def words_of(page: Path) -> int:
    """Count the words of a page beside its blocks."""
    return len(_BLOCK.sub("", page.read_text("utf-8")).split())


def write_samples() -> None:
    """Write the files of the page of samples into the current folder."""
    for block in blocks_of(SAMPLES):
        exec(block.text, {})


def main(names: list[str]) -> None:
    """Draw pictures, and print the bytes of each."""
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        write_samples()
        for page in howto_pages():
            if names and page.stem not in names:
                continue
            for language, text in blocks_of(page):
                if language in ("csv", "yaml"):
                    Path(TABLE if language == "csv" else "scene.yaml").write_text(text, "utf-8")
            film = render(load_scene("scene.yaml"), resume=False)
            picture = FOLDER / f"{page.stem}.webp"
            picture.write_bytes(Path(picture.name).read_bytes())
            print(picture, film.accuracy and round(film.accuracy.psnr, 1), picture.stat().st_size)


if __name__ == "__main__":
    main(sys.argv[1:])
