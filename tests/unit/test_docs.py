"""The scenes shown in the documentation are legal, and every key of the format is documented."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from concept_figures import FIGURES, PAGES as CONCEPTS, scene_of
from scene_page import SCENE_PAGE, scene_page

from renderer.accuracy import look_at_scene
from renderer.scene import FORMATS, load_scene, scene_to_dict

ROOT = Path(__file__).resolve().parents[2]


def _scene_in(document: str) -> str:
    return _blocks_in(document)[0]


def _blocks_in(document: str, language: str = "yaml") -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / document).read_text("utf-8"), re.DOTALL)


# Pages whose YAML blocks have lines that each may stand in a scene.
PAGES_OF_LINES = ("docs/precision.md", "docs/footprints.md")


@pytest.mark.parametrize("document", ["README.md", "docs/scene.md"])
def test_the_scene_in_the_text_is_legal(document: str, tmp_path: Path) -> None:
    text = _scene_in(document)
    for name in ("scan.nii.gz", "scan.nhdr"):
        (tmp_path / name).touch()
    (tmp_path / "scene.yaml").write_text(text, "utf-8")
    load_scene(tmp_path / "scene.yaml")


def test_the_table_of_formats_has_all_of_them() -> None:
    table = (ROOT / "docs/scene.md").read_text("utf-8").partition("### Formats")[2].partition("### Several files")[0]
    rows = [set(re.findall(r"[.\w]+", row)) for row in table.splitlines()]
    suffix, found = "", set()
    for row in rows:
        suffix = next((each for each in FORMATS if each in row), suffix)
        found |= {(suffix, word) for word in row}
    for suffix, each in FORMATS.items():
        names = {*each.pixel_formats, *each.codecs}
        for codec in each.codecs.values():
            names |= {*codec.pixel_formats, *codec.with_alpha}
        assert names <= {word for key, word in found if key == suffix}, suffix


def test_the_pages_of_concepts_show_all_figures_whose_scenes_are_legal() -> None:
    """And figures are small enough for a repository."""
    texts = "".join(page.read_text("utf-8") for page in CONCEPTS.glob("*.md"))
    assert sorted(re.findall(r"\]\((\w+)\.webp\)", texts)) == sorted(FIGURES)
    files = {file.stem: file.stat().st_size for file in CONCEPTS.glob("*.webp")}
    assert files.keys() == FIGURES.keys()
    assert max(files.values()) <= 80_000
    for figure in FIGURES.values():
        for panel in figure.panels:
            scene_of(panel)


def _with_line(scene: str, line: str) -> str:
    """Return the scene with the line in place of the one with the same key, or at its end where it has no such key."""
    key = line.partition(":")[0]
    text, replaced = re.subn(rf"(?m)^{key}:.*$", lambda _: line, scene)
    return text if replaced else f"{scene}{line}\n"


@pytest.mark.parametrize("page", PAGES_OF_LINES)
def test_every_line_of_an_example_may_stand_in_the_scene(page: str, tmp_path: Path) -> None:
    scene = _scene_in("README.md")
    (tmp_path / "scan.nii.gz").touch()
    lines = "".join(_blocks_in(page)).splitlines()
    assert lines
    for line in lines:
        text = _with_line(scene, line)
        assert line in text and text != scene, line
        (tmp_path / "scene.yaml").write_text(text, "utf-8")
        load_scene(tmp_path / "scene.yaml")


def test_the_scene_of_the_readme_shows_something(tmp_path: Path) -> None:
    (tmp_path / "scene.yaml").write_text(_scene_in("README.md"), "utf-8")
    scene = load_scene(tmp_path / "scene.yaml", overrides=["volume.procedural.shape=[64, 64, 32]"])
    assert look_at_scene(scene, [0], num_threads=1) == []


def test_the_readme_has_one_scene() -> None:
    assert len(_blocks_in("README.md")) == 1


@pytest.mark.parametrize("config", sorted((ROOT / "configs").rglob("*.yaml")), ids=lambda path: path.stem)
def test_every_key_of_an_example_is_in_the_list_of_keys(config: Path, tmp_path: Path) -> None:
    listed = set(re.findall(r"(\w+):", _scene_in("docs/scene.md")))
    (tmp_path / "volume").mkdir()
    text, volume = config.read_text("utf-8"), tmp_path / "volume"
    overrides = [f"volumes.{k}.file={volume}" for k in range(text.count("\n    file: "))]
    scene = load_scene(config, overrides=overrides, volume=volume if "\nvolume:\n  file:" in text else None)

    def keys(tree: object) -> set[str]:
        if isinstance(tree, dict):
            return {str(key) for key in tree if not str(key).isdigit()} | {k for v in tree.values() for k in keys(v)}
        return {key for item in tree for key in keys(item)} if isinstance(tree, list) else set()

    assert keys(scene_to_dict(scene)) - listed == set()


def test_the_page_of_scenes_has_the_keys_of_scenes() -> None:
    assert SCENE_PAGE.read_text("utf-8") == scene_page(), "write it by python tests/pages/scene_page.py"


PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])


def _anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub makes of the headings of a page."""
    headings = re.findall(r"(?m)^#+ (.*)$", page.read_text("utf-8"))
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_within_the_documentation_lead_somewhere(page: Path) -> None:
    links = re.findall(r"\]\(([^)#:]*)(?:#([^)]*))?\)", page.read_text("utf-8"))
    for target, anchor in links:
        path = page.parent / target if target else page
        assert path.exists(), target
        assert not anchor or anchor in _anchors(path), f"{target}#{anchor}"


def test_every_page_can_be_reached_from_the_readme() -> None:
    reached, todo = set(), [ROOT / "README.md"]
    while todo:
        page = todo.pop()
        if page in reached:
            continue
        reached.add(page)
        for target in re.findall(r"\]\(([^)#:]+\.md)(?:#[^)]*)?\)", page.read_text("utf-8")):
            todo.append((page.parent / target).resolve())
    assert set(PAGES) - reached - {ROOT / "CHANGELOG.md"} == set()


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_paths_in_the_documentation_exist(page: Path) -> None:
    paths = re.findall(r"(?<!In a new file )`((?:renderer|hsplat_cli|tests|configs)/[^`\s]*)`", page.read_text("utf-8"))
    assert [path for path in paths if not (ROOT / path).exists()] == []
