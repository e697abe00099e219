"""The scenes shown in the documentation are legal, and every key of the format is documented."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hsplat_cli.scene_file import load_scene
from renderer.scene_schema import scene_to_dict

ROOT = Path(__file__).resolve().parents[2]


def _scene_in(document: str) -> str:
    return _blocks_in(document)[0]


def _blocks_in(document: str) -> list[str]:
    return re.findall(r"```yaml\n(.*?)```", (ROOT / document).read_text("utf-8"), re.DOTALL)


@pytest.mark.parametrize("document", ["README.md", "docs/scene.md"])
def test_the_scene_in_the_text_is_legal(document: str, tmp_path: Path) -> None:
    text = _scene_in(document)
    for name in ("scan.nii.gz", "scan.nhdr"):
        (tmp_path / name).touch()
    (tmp_path / "scene.yaml").write_text(text, "utf-8")
    load_scene(tmp_path / "scene.yaml")


def test_every_line_of_the_other_examples_may_stand_in_the_scene(tmp_path: Path) -> None:
    scene, *others = _blocks_in("README.md")
    (tmp_path / "scan.nii.gz").touch()
    for line in "".join(others).splitlines():
        key = line.partition(":")[0]
        (tmp_path / "scene.yaml").write_text(re.sub(rf"(?m)^{key}:.*$", lambda _, new=line: new, scene), "utf-8")
        load_scene(tmp_path / "scene.yaml")


@pytest.mark.parametrize("config", sorted((ROOT / "configs").rglob("*.yaml")), ids=lambda path: path.stem)
def test_every_key_of_an_example_is_in_the_list_of_keys(config: Path, tmp_path: Path) -> None:
    listed = set(re.findall(r"(\w+):", _scene_in("docs/scene.md")))
    (tmp_path / "volume").mkdir()
    scene = load_scene(config, volume=tmp_path / "volume")

    def keys(tree: object) -> set[str]:
        if isinstance(tree, dict):
            return {str(key) for key in tree if not str(key).isdigit()} | {k for v in tree.values() for k in keys(v)}
        return {key for item in tree for key in keys(item)} if isinstance(tree, list) else set()

    assert keys(scene_to_dict(scene)) - listed == set()


@pytest.mark.parametrize(
    "page", sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md")]), ids=lambda path: path.name
)
def test_links_within_the_documentation_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text("utf-8"))
    assert [target for target in targets if not (page.parent / target).exists()] == []
