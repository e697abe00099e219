"""Hooks of mkdocs: pages that are made for the site alone, and links that leave docs/.

The README is the front page. `options.md` has the help of all commands, `notebook.md` is api.ipynb, and `files.md` has
the files outside docs/ that pages link to, such as scenes. docs/site/mkdocs.yml names this file.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files

from hsplat_cli.main import hsplat

ROOT = Path(__file__).resolve().parents[2]
# The path of a link within the repository, without its anchor.
_LINK = re.compile(r"(?<=\]\()([^)#:\s]+)(?=[)#])")
# Code between backticks, or a character with a meaning in Markdown.
_MARKS = re.compile(r"`[^`]*`|[\\*_{}\[\]<>#|~]")
_NOTEBOOK_PAGE = "notebook.md"
_FILES_PAGE = "files.md"
_FILES_HEAD = """\
# Example scenes and other files

These files of the repository are named on the other pages. Save a scene, and `hsplat render` makes its film.
"""
# The languages of files, by the ends of their names.
_LANGUAGES = {".yaml": "yaml", ".yml": "yaml"}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Put the pages of a folder in the place of its name in the navigation."""
    config.nav = [{title: _pages_at(place)} for entry in config.nav or [] for title, place in entry.items()]
    return config


def _pages_at(place: Any) -> Any:
    """Return the pages of a folder, the README first; a place that is no folder is returned as it is."""
    if not isinstance(place, str) or not place.endswith("/"):
        return place
    pages = sorted((ROOT / "docs" / place).glob("*.md"), key=lambda page: (page.name != "README.md", page.name))
    return [f"{place}{page.name}" for page in pages]


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the front page, and the pages of options, of the notebook and of files."""
    front = _LINK.sub(lambda link: os.path.relpath(link[1], "docs"), (ROOT / "README.md").read_text("utf-8"))
    texts = {file.src_uri: file.content_string for file in files.documentation_pages()} | {"index.md": front}
    outside = {
        target for page, text in texts.items() for link in _LINK.findall(text) if (target := _outside(page, link))
    }
    files.append(File.generated(config, "index.md", content=front))
    files.append(File.generated(config, "options.md", content=_options_page()))
    files.append(File.generated(config, _NOTEBOOK_PAGE, content=_notebook_page()))
    files.append(File.generated(config, _FILES_PAGE, content=_files_page(outside)))
    return files


class MarkdownFormatter(click.HelpFormatter):
    """Collects the help of a command as the lines of a page in Markdown."""

    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def write_usage(self, prog: str, args: str = "", prefix: str | None = None) -> None:
        """Write the heading of the command, and the line by which it is called."""
        self.lines += [f"## {prog}", "", f"    {prog} {args}", ""]

    def write_paragraph(self) -> None:
        """Write nothing: `write_text` begins paragraphs."""

    def write_text(self, text: str) -> None:
        """Write paragraphs, between which are empty lines."""
        self.lines += [_plain(text), ""]

    def write_dl(self, rows: Iterable[tuple[str, str]], col_max: int = 30, col_spacing: int = 2) -> None:
        """Write a table of options, each with its description. The last two arguments are for a terminal."""
        self.lines += ["| option | meaning |", "|---|---|"]
        self.lines += [f"| `{term}` | {_plain(' '.join(text.split()))} |" for term, text in rows]
        self.lines.append("")

    @contextmanager
    def section(self, name: str) -> Iterator[None]:
        """Write no heading before the lines that the block writes."""
        yield


def _plain(text: str) -> str:
    """Return a text in which no character has a meaning in Markdown, except for code between backticks."""
    return _MARKS.sub(lambda mark: mark[0] if mark[0][0] == "`" else f"&#{ord(mark[0])};", text)


def _options_page() -> str:
    """Return the page with the help of all commands."""
    page = MarkdownFormatter()
    page.lines += ["# Options of commands", "", "As `hsplat COMMAND --help` prints them.", ""]
    root = click.Context(hsplat, info_name="hsplat")
    for name in hsplat.list_commands(root):
        command = hsplat.get_command(root, name)
        assert command is not None, name
        command.format_help(click.Context(command, root, name), page)
    return "\n".join(page.lines)


def _notebook_page() -> str:
    """Return the page with the text and the code of the notebook."""
    cells = json.loads((ROOT / "docs" / "api.ipynb").read_text("utf-8"))["cells"]
    texts = [(cell["cell_type"], "".join(cell["source"])) for cell in cells]
    return "\n\n".join(f"```python\n{text}\n```" if kind == "code" else text for kind, text in texts)


def _outside(page: str, link: str) -> str | None:
    """Return the path in the repository of a link that leaves docs/; None for other links.

    Raises PluginError, which ends the build, if nothing is there.
    """
    path = os.path.normpath(f"docs/{os.path.dirname(page)}/{link}")
    if path.startswith("docs/"):
        return None
    if path.startswith("..") or not (ROOT / path).exists():
        raise PluginError(f"{page}: the link {link} leads nowhere")
    return path


def _files_page(paths: set[str]) -> str:
    """Return the page with the content of files, and of the files in folders."""
    found = {file for path in paths for file in ([ROOT / path] if (ROOT / path).is_file() else (ROOT / path).iterdir())}
    sections = [
        f"## {file.relative_to(ROOT)}\n\n````{_LANGUAGES.get(file.suffix, 'text')}\n{file.read_text('utf-8')}````\n"
        for file in sorted(found)
    ]
    return "\n".join([_FILES_HEAD, *sections])


def on_page_markdown(markdown: str, page: Any, config: MkDocsConfig, files: Files) -> str:
    """Let links that leave docs/ lead to the page of files, and those to the notebook to its page."""

    def link_on_site(link: re.Match[str]) -> str:
        if link[1].endswith("api.ipynb"):
            return link[1].replace("api.ipynb", _NOTEBOOK_PAGE)
        target = _outside(page.file.src_uri, link[1])
        if target is None:
            return link[1]
        place = os.path.relpath(_FILES_PAGE, os.path.dirname(page.file.src_uri))
        anchor = re.sub(r"[^\w-]", "", target.lower())
        return f"{place}#{anchor}" if (ROOT / target).is_file() else place

    return _LINK.sub(link_on_site, markdown)
