"""Hooks of mkdocs: pages that are made for the site alone, and links that leave docs/.

The README is the front page. Files outside docs/ that pages link to, such as scenes, are on one page, `files.md`.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[2]
# The path of a link within the repository, without its anchor.
_LINK = re.compile(r"(?<=\]\()([^)#:\s]+)(?=[)#])")
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
    """Add the front page and the page of files."""
    front = _LINK.sub(lambda link: os.path.relpath(link[1], "docs"), (ROOT / "README.md").read_text("utf-8"))
    texts = {file.src_uri: file.content_string for file in files.documentation_pages()} | {"index.md": front}
    outside = {
        target for page, text in texts.items() for link in _LINK.findall(text) if (target := _outside(page, link))
    }
    files.append(File.generated(config, "index.md", content=front))
    files.append(File.generated(config, _FILES_PAGE, content=_files_page(outside)))
    return files


def _outside(page: str, link: str) -> str | None:
    """Return the path in the repository of a link that leaves docs/; None for other links."""
    path = os.path.normpath(f"docs/{os.path.dirname(page)}/{link}")
    return None if path.startswith("docs/") else path


def _files_page(paths: set[str]) -> str:
    """Return the page with the content of files, and of the files in folders."""
    found = {file for path in paths for file in ([ROOT / path] if (ROOT / path).is_file() else (ROOT / path).iterdir())}
    sections = [
        f"## {file.relative_to(ROOT)}\n\n````{_LANGUAGES.get(file.suffix, 'text')}\n{file.read_text('utf-8')}````\n"
        for file in sorted(found)
    ]
    return "\n".join([_FILES_HEAD, *sections])


def on_page_markdown(markdown: str, page: Any, config: MkDocsConfig, files: Files) -> str:
    """Let links that leave docs/ lead to the page of files."""

    def link_on_site(link: re.Match[str]) -> str:
        target = _outside(page.file.src_uri, link[1])
        if target is None:
            return link[1]
        place = os.path.relpath(_FILES_PAGE, os.path.dirname(page.file.src_uri))
        anchor = re.sub(r"[^\w-]", "", target.lower())
        return f"{place}#{anchor}" if (ROOT / target).is_file() else place

    return _LINK.sub(link_on_site, markdown)
