"""Runs the steps of a composite action as a runner of GitHub does: `run:` steps by bash, as they are written.

Steps with `uses:` run a function of the test in their place. Expressions are those that the action has: a value of
`inputs` or of the outputs of a step, compared with a text, and `always()`.
"""

from __future__ import annotations

import os
import re
import subprocess
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

ACTION = Path(__file__).parents[2] / ".github/actions/golden/action.yml"

# A function in the place of an action that a step uses: from the step's `with` to its outputs.
Stub = Callable[[Mapping[str, str]], Mapping[str, str]]


@dataclass
class Job:
    """A job of GitHub that ran an action.

    code: the exit code of the first step that failed; 0 if all passed. ran: the names of the steps that ran. printed:
    the output of all steps. summary: the text on the page of the job.
    """

    code: int = 0
    ran: list[str] = field(default_factory=list)
    printed: str = ""
    summary: str = ""


def run_action(
    inputs: Mapping[str, str], workspace: Path, temporary: Path, stubs: Mapping[str, Stub], **variables: str
) -> Job:
    """Run the action of this repository in a workspace.

    temporary: the folder of the runner. stubs: by the action that a step uses, without its version. variables: further
    variables of the environment.
    """
    action = yaml.safe_load(ACTION.read_text("utf-8"))
    given = {name: str(each.get("default", "")) for name, each in action["inputs"].items()}
    assert inputs.keys() <= given.keys()
    values = {f"inputs.{name}": value for name, value in (given | {**inputs}).items()}
    temporary.mkdir(parents=True, exist_ok=True)
    job = Job()
    for step in action["runs"]["steps"]:
        if not _is_wanted(step.get("if", ""), values, failed=job.code != 0):
            continue
        job.ran.append(step["name"])
        if "uses" in step:
            outputs = stubs[step["uses"].partition("@")[0]](_filled(step.get("with", {}), values))
        else:
            assert step["shell"] == "bash" and "${{" not in step["run"], "values go through the environment"
            outputs = _run(step["run"], _filled(step.get("env", {}), values) | variables, workspace, temporary, job)
        values |= {f"steps.{step.get('id')}.outputs.{key}": value for key, value in outputs.items()}
    return job


def _run(script: str, variables: Mapping[str, str], workspace: Path, temporary: Path, job: Job) -> dict[str, str]:
    """Run a script in a workspace, add what it printed to the job, and return its outputs."""
    output, summary = temporary / "output", temporary / "summary"
    for file in (output, summary):
        file.write_text("", "utf-8")
    own = {
        "CI": "true",
        "GITHUB_ACTIONS": "true",
        "GITHUB_ACTION_PATH": str(ACTION.parent),
        "GITHUB_OUTPUT": str(output),
        "GITHUB_STEP_SUMMARY": str(summary),
        "RUNNER_TEMP": str(temporary),
    }
    done = subprocess.run(
        ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", script],
        cwd=workspace,
        env=os.environ | own | {**variables},
        check=False,
        capture_output=True,
        text=True,
    )
    job.code = job.code or done.returncode
    job.printed += done.stdout + done.stderr
    job.summary += summary.read_text("utf-8")
    return dict(line.split("=", 1) for line in output.read_text("utf-8").splitlines())


def _filled(texts: Mapping[str, Any], values: Mapping[str, str]) -> dict[str, str]:
    """Return texts with values in the place of their expressions; a missing output is empty."""

    def value(found: re.Match[str]) -> str:
        assert found[1].startswith("steps.") or found[1] in values, found[1]
        return values.get(found[1], "")

    return {key: re.sub(r"\$\{\{ ([\w.-]+) \}\}", value, str(text)) for key, text in texts.items()}


def _is_wanted(condition: str, values: Mapping[str, str], *, failed: bool) -> bool:
    """Return whether a step runs: after a failure, only one with `always()` does."""
    terms = [term.strip() for term in condition.split("&&")] if condition else []
    if failed and "always()" not in terms:
        return False
    for term in terms:
        if term != "always()":
            name, sign, text = term.split(" ")
            if (values.get(name, "") == text.strip("'")) != (sign == "=="):
                return False
    return True
