"""The page on golden films can be followed: its workflows, its project, its commands and its tests are legal."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from pathlib import Path
from typing import Any

import pytest
import yaml

from hsplat_cli.commands.compare import compare
from hsplat_cli.commands.golden import golden
from hsplat_cli.compare import find_project, parse_rules

ROOT = Path(__file__).resolve().parents[2]
TEXT = (ROOT / "docs/golden-frames.md").read_text("utf-8")
ACTION = yaml.safe_load((ROOT / ".github/actions/golden/action.yml").read_text("utf-8"))
# The blocks of YAML, by the name of the file in their first line.
BLOCKS = {Path(block.split()[1].rstrip(":")).name: block for block in re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)}
RECIPES = {name: yaml.safe_load(block) for name, block in BLOCKS.items()}
WORKFLOWS = ("golden-films.yml", "accept-goldens.yml")
# The steps of the job that installs a wheel, in place of the action.
BY_WHEEL = RECIPES["golden-wheel.yml"]["jobs"]["compare"]["steps"]
COMMANDS = [
    *re.findall(r"(?m)^ {4}(hsplat [^#\n]*)", TEXT),
    *(" ".join(each.split()) for each in re.findall(r"`(hsplat [^`]*--[^`]*)`", TEXT)),
    *RECIPES[".gitlab-ci.yml"]["golden films"]["script"],
]


def steps_of(workflow: str) -> list[dict[str, Any]]:
    (job,) = RECIPES[workflow]["jobs"].values()
    steps: list[dict[str, Any]] = job["steps"]
    return steps


def test_the_page_has_all_recipes() -> None:
    workflows = ["accept-goldens.yml", "golden-films.yml", "golden-wheel.yml"]
    assert sorted(RECIPES) == [".gitlab-ci.yml", *workflows, "golden.yaml"]


@pytest.mark.parametrize("workflow", WORKFLOWS)
def test_workflows_use_the_action_by_its_inputs(workflow: str) -> None:
    (step,) = [step for step in steps_of(workflow) if "hsplat" in step.get("uses", "")]
    path = step["uses"].removeprefix("OWNER/hsplat/").partition("@")[0]
    assert yaml.safe_load((ROOT / path / "action.yml").read_text("utf-8")) == ACTION
    assert step["with"].keys() <= ACTION["inputs"].keys()


def test_the_report_that_is_accepted_is_the_one_that_was_kept() -> None:
    """And what a person types reaches no script but through the environment."""
    steps = steps_of("accept-goldens.yml")
    (download,) = [step for step in steps if "download-artifact" in step.get("uses", "")]
    (accept,) = [step for step in steps if "hsplat" in step.get("uses", "")]
    assert download["with"]["name"] == ACTION["inputs"]["report"]["default"]
    assert download["with"]["path"] == accept["with"]["accept"]
    assert not any("${{" in step.get("run", "") for step in steps)
    given = " ".join(str(step.get("with", {})) + str(step.get("env", {})) for step in steps)
    (inputs,) = [value["workflow_dispatch"]["inputs"] for value in RECIPES["accept-goldens.yml"].values() if _is(value)]
    assert set(re.findall(r"inputs\.(\w+)", given)) == inputs.keys()


@pytest.mark.parametrize("code", [0, 1])
def test_a_commit_is_made_only_of_changes(folder: Path, code: int) -> None:
    """Else accepting twice would fail. code: of `git diff --quiet`, which is 1 where something is staged."""
    (script,) = [step["run"] for step in steps_of("accept-goldens.yml") if "run" in step]
    git = folder / "git"
    git.write_text(
        f"#!/bin/sh\necho $1 >> did\ncase $1 in diff) exit {code};; commit) exit {1 - code};; esac\n", "utf-8"
    )
    git.chmod(0o755)
    path = os.pathsep.join([str(folder), os.environ["PATH"]])
    subprocess.run(["bash", "-e", "-c", script], check=True, env={**os.environ, "RUN": "1", "PATH": path})
    did = Path("did").read_text("utf-8").split()
    assert did[2:] == ["add", "diff", *(["commit"] if code else []), "push"]


def _is(value: object) -> bool:
    return isinstance(value, dict) and "workflow_dispatch" in value  # YAML 1.1 reads the key `on` as true


def test_gitlab_gets_files_of_the_report() -> None:
    job = RECIPES[".gitlab-ci.yml"]["golden films"]
    (command,) = job["script"]
    folder = compare.make_context("compare", shlex.split(command)[2:]).params["report"]
    assert job["artifacts"]["paths"] == [str(folder)] and job["artifacts"]["when"] == "always"
    names = {"junit": "junit.xml", "codequality": "code-quality.json"}
    assert job["artifacts"]["reports"] == {key: str(folder / name) for key, name in names.items()}


def test_jobs_by_a_wheel_install_the_one_that_is_committed_and_keep_the_report() -> None:
    gitlab = RECIPES[".gitlab-ci.yml"]["golden films"]
    install, command = [step["run"] for step in BY_WHEEL if "run" in step]
    (upload,) = [step for step in BY_WHEEL if "upload-artifact" in step.get("uses", "")]
    assert [install] == gitlab["before_script"] and [command] == gitlab["script"]
    (committed,) = re.findall(r"(?m)^ {4}git add (.*)", TEXT)
    assert shlex.split(install) == ["pip", "install", committed, "flip-evaluator"]
    assert upload["if"] == "always()" and [upload["with"]["path"]] == gitlab["artifacts"]["paths"]


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_are_legal(command: str) -> None:
    program, name, *arguments = shlex.split(command)
    assert program == "hsplat"
    {"golden": golden, "compare": compare}[name].make_context(name, arguments)


def test_the_project_is_legal(folder: Path) -> None:
    Path("golden.yaml").write_text(BLOCKS["golden.yaml"], "utf-8")
    Path("scenes").mkdir()
    for name in ("engine", "brain"):
        Path(f"scenes/{name}.yaml").touch()
    brain, engine = find_project([]).scenes
    assert engine.folder.path == Path("goldens/scenes/engine")
    assert (str(engine.rules.limit), engine.rules.frames) == ("45 dB", "0:10")
    assert (str(brain.rules.limit), brain.rules.frames, brain.rules.pictures) == ("same bytes", "::10", "files")


def test_the_table_has_the_limits() -> None:
    limits = re.findall(r"(?m)^\| `([\w ]+)` \|", TEXT.partition("## Limits")[2].partition("\n## ")[0])
    assert [str(parse_rules(None, limit).limit) for limit in limits if limit != "limit"] == limits[1:]
    (sentence,) = re.findall(r"At 45 dB, the root mean square.*", TEXT)
    figures = re.findall(r"at (\d+) dB,?(?: the .*? is)? ([\d.]*\d)", sentence, re.IGNORECASE)
    assert len(figures) == 3
    for decibels, steps in figures:
        assert float(steps) == pytest.approx(255 * 10 ** (-float(decibels) / 20), rel=0.05)
