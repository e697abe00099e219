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
    (setuptools,) = re.findall(r'"(setuptools>=\d+)"', project)
    dependencies = re.findall(r'(?m)^  "([^"]+)",', project.partition("\ndependencies = [\n")[2].partition("\n]")[0])
    assert len(dependencies) > 5
    assert recipe["context"]["version"] == version
    # conda-forge builds for the versions of Python that it supports, and has moderngl for every machine.
    own = [each.partition(";")[0] for each in dependencies]
    assert _without_spaces(recipe["requirements"]["run"]) == ["python", *own]
    assert setuptools in _without_spaces(recipe["requirements"]["host"])


def _without_spaces(requirements: list[str]) -> list[str]:
    return [each.replace(" ", "") for each in requirements]
