"""Hooks of mkdocs: the reference and other pages that are made for the site alone, and links that leave docs/.

The README is the front page. mkdocs-click makes `options.md` of the commands, and mkdocstrings the end of `api.md` of
docstrings; the ends of `formats.md` and `sidecar.md` are made here, of declarations. `notebook.md` is api.ipynb, and
`files.md` has the files outside docs/ that pages link to, such as scenes. docs/site/mkdocs.yml names this file.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import command_page
from formats_page import field_tables
from mkdocs.config.defaults import MkDocsConfig
from mkdocs.exceptions import PluginError
from mkdocs.structure.files import File, Files
from sidecar_page import key_tables

ROOT = Path(__file__).resolve().parents[2]
# The path of a link within the repository, without its anchor.
_LINK = re.compile(r"(?<=\]\()([^)#:\s]+)(?=[)#])")
_NOTEBOOK_PAGE = "notebook.md"
_FILES_PAGE = "files.md"
_FILES_HEAD = """\
# Example scenes and other files

Other pages name these files of the repository. Save a scene, and `hsplat render` makes its film.
"""
# mkdocs-click replaces the block by the commands.
_OPTIONS_PAGE = f"""\
# Options of commands

`hsplat COMMAND --help` prints the same.

::: mkdocs-click
    :module: {command_page.__name__}
    :command: hsplat_on_page
    :prog_name: hsplat
    :depth: 1
    :style: table
    :list_subcommands: true
"""
# The names in the reference of the Python API below their headings: all that `renderer` offers, and the types that
# signatures name, with their modules.
_TYPES = "Types of parameters"
_API = {
    "Functions": ("render_frame", "render", "load_scene", "suggest_scene", "preview", "integrate"),
    "Volumes and scenes": ("Layer", "FilmScene", "Scene"),
    "Results": ("Film", "FrameImage", "ExactImage", "Page"),
    "Errors": ("HsplatError", "InputError", "SceneError", "OutputLockedError", "RenderError"),
    _TYPES: (
        "api_scenes.SceneLike",
        "api_scenes.CameraLike",
        "api_scenes.LightLike",
        "api_layers.VolumesLike",
        "api_layers.ImageLike",
        "api_layers.TransferLike",
    ),
}
# The options of names whose reference has other parts than that of the others. Users make no Scene by its class.
_API_OPTIONS: dict[str, dict[str, object]] = {
    "FilmScene": {"members": ["at", "num_frames"]},
    "Scene": {"merge_init_into_class": False},
}
# The paragraphs of stored pages that say what the site has.
_POINTER = re.compile(r"\n\[The site\]\(contributing/README\.md#this-site\)[^\n]*(?:\n[^\n]+)*\n")
# A cell of the page of options with a default that is words.
_DEFAULT_IN_WORDS = re.compile(r"<td><code>([^<]* [^<]*)</code></td>")
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
    files.append(File.generated(config, "options.md", content=_OPTIONS_PAGE))
    files.append(File.generated(config, _NOTEBOOK_PAGE, content=_notebook_page()))
    files.append(File.generated(config, _FILES_PAGE, content=_files_page(outside)))
    return files


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
        for file in sorted(found, key=lambda file: (file.relative_to(ROOT).parts[0] != "configs", file))
    ]
    return "\n".join([_FILES_HEAD, *sections])


def _api_reference() -> Iterator[str]:
    """Yield the blocks that mkdocstrings replaces by signatures and docstrings.

    Raises PluginError, which ends the build, if a public name of `renderer` is missing.
    """
    public = set(re.findall(r" as (\w+)", (ROOT / "renderer" / "__init__.pyi").read_text("utf-8")))
    described = {name for heading, names in _API.items() if heading != _TYPES for name in names}
    if public != described:
        raise PluginError(f"not the names of renderer/__init__.pyi: {sorted(public ^ described)}")
    for heading, names in _API.items():
        yield f"## {heading}\n"
        for name in names:
            yield f"::: renderer.{name}\n    options: {json.dumps(_API_OPTIONS.get(name, {}))}\n"


# The reference that ends a stored page, as functions that yield its lines.
_REFERENCES: dict[str, Callable[[], Iterable[str]]] = {
    "api.md": _api_reference,
    "formats.md": field_tables,
    "sidecar.md": key_tables,
}


def on_page_markdown(markdown: str, page: Any, config: MkDocsConfig, files: Files) -> str:
    """Add the reference, and let links that leave docs/ lead to the page of files, and to the notebook to its page."""
    markdown = _POINTER.sub("", markdown)
    if page.file.src_uri in _REFERENCES:
        markdown = "\n".join([markdown, "", *_REFERENCES[page.file.src_uri]()])

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


def on_page_content(html: str, page: Any, config: MkDocsConfig, files: Files) -> str:
    """Leave the cells of options without a default empty, and show defaults that are words as text.

    mkdocs-click writes `None` into the first ones, and shows all defaults as code.
    """
    if page.file.src_uri != "options.md":
        return html
    return _DEFAULT_IN_WORDS.sub(r"<td>\1</td>", html.replace("<td>None</td>", "<td></td>"))
