"""Write notes on pictures that look like frames and are not compared."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path

from hsplat_cli.compare.figure_format import printable
from hsplat_cli.compare.picture_file import is_picture
from hsplat_cli.terminal import first_few

_OTHER_SUFFIXES = (".jpg", ".jpeg", ".webp", ".tif", ".tiff", ".bmp")
_MAX_NAMED = 3


def ignored_in_folder_notes(folder: Path, entries: Collection[Path]) -> Iterator[str]:
    """Return notes on pictures in other formats and on subfolders with PNG files."""
    visible = sorted(path for path in entries if not path.name.startswith("."))
    others = [path.name for path in visible if path.suffix.lower() in _OTHER_SUFFIXES]
    if others:
        yield f"not compared, because they are not PNG files: {_some(others)} in {printable(str(folder))}"
    below = [path.name for path in visible if _has_pictures(path)]
    if below:
        yield f"not compared, because subfolders are ignored: PNG files in {_some(below)} in {printable(str(folder))}"


def _has_pictures(path: Path) -> bool:
    try:
        return path.is_dir() and any(is_picture(below.name) for below in path.iterdir())
    except OSError:
        return False


def ignored_by_template_notes(
    template: Path, pattern: re.Pattern[str], matched: Collection[Path], entries: Collection[Path]
) -> Iterator[str]:
    """Return a note on files that a template ignores only because of the number of digits.

    pattern: matches names with any number of digits. matched: the files of the template.
    """
    others = sorted(path.name for path in entries if pattern.fullmatch(path.name) and path not in matched)
    if others:
        yield f"not compared, because {printable(template.name)} has another number of digits: {_some(others)}"


def _some(names: list[str]) -> str:
    return first_few(list(map(printable, names)), _MAX_NAMED)
