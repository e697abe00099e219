"""The site of the documentation: it is built without a warning, loads nothing from elsewhere, and can be followed.

The site is built by the packages of the extra `docs`: `pip install -e '.[dev,docs]'`.
"""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import renderer
from hsplat_cli import main
from renderer.record import FilmRecord

ROOT = Path(__file__).resolve().parents[2]
# The attributes by which a page loads something.
LOADED = {"link": "href", "script": "src", "img": "src", "iframe": "src", "source": "src"}
# Options that make films small.
SMALL = ["--frames", "6", "--size", "64"]

pytestmark = pytest.mark.slow


class Page(HTMLParser):
    """What a page loads, and its pictures without a description."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.loaded: list[str] = []
        self.undescribed: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        values = dict(attributes)
        self.loaded.append(values.get(LOADED.get(tag, "")) or "")
        if tag == "img" and not values.get("alt"):
            self.undescribed.append(values["src"] or "")


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Build the site, where every warning is an error, and return its pages by their paths."""
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--config-file", str(ROOT / "docs/site/mkdocs.yml")]
    result = subprocess.run([*command, "--site-dir", str(folder)], capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    return {str(page.relative_to(folder)): page.read_text("utf-8") for page in folder.rglob("*.html")}


def test_pages_load_nothing_from_elsewhere(site: dict[str, str]) -> None:
    """And every picture has a description."""
    for name, text in site.items():
        page = Page(text)
        assert page.loaded
        assert [each for each in page.loaded if "//" in each] == [], name
        assert page.undescribed == [], name


def test_pages_of_the_site_alone_are_whole(site: dict[str, str]) -> None:
    scenes = {re.sub(r"\W", "", f"configs{path.name}") for path in (ROOT / "configs").iterdir()}
    assert scenes <= set(re.findall(r'<h2 id="(\w+)"', site["files.html"]))
    assert site["notebook.html"].count('<div class="highlight">') > 5
    assert 'href="notebook.html"' in site["api.html"]
    assert 'href="files.html#configsfloweryaml"' in site["index.html"]
    assert 'href="../files.html"' in site["contributing/index.html"]


def test_the_reference_is_made_of_commands_docstrings_and_declarations(site: dict[str, str]) -> None:
    options, api, formats, sidecar = (site[f"{name}.html"] for name in ("options", "api", "formats", "sidecar"))
    assert all(f'id="hsplat-{name}"' in options for name in main.COMMANDS)
    assert "<td><code>--set</code></td>\n<td>KEY=VALUE</td>" in options
    assert "UNSET" not in options and "<td>None" not in options
    # Choices, and a default in words.
    assert "<td>mp4 &#124; webm &#124; " in options
    assert "<td>the first</td>" in options
    assert set(re.findall(r'<h3 id="renderer\.(\w+)"', api)) == set(renderer.__all__)
    assert 'href="#renderer.api_layers.ImageLike">ImageLike</a>' in api
    # The sentence of the stored page that leads here.
    assert not any("The site</a>" in page for page in (api, formats, sidecar))
    # Parameters of five functions, and an attribute: a section that is not understood would be a paragraph.
    assert api.count("<b><code>spacing</code></b>") == 5
    assert 'title="renderer.Layer.spacing"' in api
    assert set(re.findall(r'<h2 id="([-\w]+)"', formats)) > {"dicom", "nrrd"}
    assert all(f"<code>{field}</code>" in sidecar for field in FilmRecord.__dataclass_fields__)


def test_the_tutorial_can_be_followed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All blocks, one after the other; with a smaller scan and smaller films."""
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "docs/tutorial.md").read_text("utf-8")
    blocks = re.findall(r"```(python|bash)\n(.*?)```", text, re.DOTALL)
    for language, block in blocks:
        if language == "python":
            assert "(128, 128, 64)" in block
            exec(block.replace("(128, 128, 64)", "(32, 32, 16)"), {})
            continue
        for line in block.splitlines():
            _, command, *arguments = shlex.split(line)
            assert main.run([command, *arguments, *(SMALL if command in ("init", "turntable") else [])]) == 0, line
    assert {"films", "scene.html", "scene.yaml", "scan.mp4", "try.png"} <= {each.name for each in tmp_path.iterdir()}
