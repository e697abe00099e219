"""The scenes shown in the documentation are legal, and every key of the format is documented."""

from __future__ import annotations

import ast
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml

from hsplat_cli.commands.compare import compare
from renderer.scene import load_scene, scene_to_dict
from renderer.study import COMPARISON_METRICS, LEVELS

ROOT = Path(__file__).resolve().parents[2]


def _scene_in(document: str) -> str:
    return _blocks_in(document)[0]


def _blocks_in(document: str, language: str = "yaml") -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", (ROOT / document).read_text("utf-8"), re.DOTALL)


RECIPES = [block for block in _blocks_in("README.md") if block.startswith("# .")]  # they begin with the file's name


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
    for line in "".join(block for block in others if block not in RECIPES).splitlines():
        key = line.partition(":")[0]
        (tmp_path / "scene.yaml").write_text(re.sub(rf"(?m)^{key}:.*$", lambda _, new=line: new, scene), "utf-8")
        load_scene(tmp_path / "scene.yaml")


@pytest.mark.parametrize("recipe", RECIPES, ids=lambda recipe: recipe.split()[1])
def test_recipes_compare_in_the_container_in_which_goldens_are_made(recipe: str) -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    (job,) = [job for job in _mappings_in(yaml.safe_load(recipe)) if {"container", "image"} & set(job)]
    assert f"-w /work {job.get('container') or job.get('image')} sh -c" in text
    commands = re.findall(r"(?m)- (?:run: )?((?:apt-get|pip|hsplat) .*)$", recipe)
    for command in commands[:-1]:
        assert f"{command} &&" in " ".join(text.split())
    program, name, *arguments = shlex.split(commands[-1])
    given = compare.make_context(name, arguments).params
    assert (program, name) == ("hsplat", "compare") and given["level"] in LEVELS and given["html_file"]


def _mappings_in(tree: object) -> Iterator[dict[str, object]]:
    if isinstance(tree, dict):
        yield tree
    for item in tree.values() if isinstance(tree, dict) else tree if isinstance(tree, list) else ():
        yield from _mappings_in(item)


@pytest.mark.parametrize("page", ["README.md", "docs/benchmarks/goldens.md"])
def test_the_table_of_figures_has_the_limits_of_every_level(page: str) -> None:
    (table,) = re.findall(r"(?m)^\| figure \| what it is .*\n(?:\|.*\n)+", (ROOT / page).read_text("utf-8"))
    header, _, *lines = ([cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines())
    assert header[2:] == [f"`{level}`" for level in LEVELS]
    assert [line[0] for line in lines] == [f"`{name}`" for name in COMPARISON_METRICS]
    for (name, figure), (_, what, *limits) in zip(COMPARISON_METRICS.items(), lines, strict=True):
        assert what.startswith(figure.label) and ("levels" in what) == bool(figure.unit), name
        expected = [level.limits.get(name) for level in LEVELS.values()]
        assert [float(limit) if limit else None for limit in limits] == expected, name


def test_python_in_the_text_can_be_parsed() -> None:
    blocks = _blocks_in("README.md", "python")
    assert blocks
    for block in blocks:
        ast.parse(block)


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
