"""The recipe for conda-forge says of hsplat what pyproject.toml says."""

from __future__ import annotations

import re
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]


def test_the_recipe_has_the_version_and_the_requirements_of_the_project() -> None:
    project = (ROOT / "pyproject.toml").read_text("utf-8")
    recipe = yaml.safe_load((ROOT / ".ci/recipes/recipe.yaml").read_text("utf-8"))
    (version,) = re.findall(r'(?m)^version = "(.*)"$', project)
    (python,) = re.findall(r'(?m)^requires-python = "(.*)"$', project)
    (setuptools,) = re.findall(r'"(setuptools>=\d+)"', project)
    dependencies = re.findall(r'(?m)^  "([^"]+)",', project.partition("\ndependencies = [\n")[2].partition("\n]")[0])
    assert len(dependencies) > 5
    assert recipe["context"]["version"] == version
    assert _without_spaces(recipe["requirements"]["run"]) == [f"python{python}", *dependencies]
    assert setuptools in _without_spaces(recipe["requirements"]["host"])


def _without_spaces(requirements: list[str]) -> list[str]:
    return [each.replace(" ", "") for each in requirements]
