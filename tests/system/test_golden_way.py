"""From a change to accepted goldens: a repository of three scenes, and the jobs of CI as the action runs them."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from xml.etree import ElementTree

import pytest
from commands import CODE
from github_runner import Job, run_action
from small_scene import small_scene

from hsplat_cli import main

SCENE = small_scene(shape="16, 16, 8", frames=4, error="tolerance: 0.1, probes: 16")
WHITE, RED = "#ffffff", "#ff0000"
INSTALLS = ["Describe this version of hsplat", "Restore its wheels", "Install hsplat", "Keep its wheels"]
# A Python whose virtual environments have a `pip` that writes its arguments, and the hsplat under test.
PYTHON = """\
#!/bin/bash
if [[ "$1 $2" != "-m venv" ]]; then exec {python} "$@"; fi
mkdir -p "$3/bin"
printf '#!/bin/bash\\necho "pip $*"\\n' > "$3/bin/pip"
printf '#!/bin/bash\\nexec {python} -m hsplat_cli "$@"\\n' > "$3/bin/hsplat"
chmod +x "$3/bin/pip" "$3/bin/hsplat"
"""


class Repository:
    """A repository, and the service that runs its jobs. has_git: whether there is git; without it, it is a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder, self._folder_of_jobs = folder / "repository", folder / "jobs"
        self._has_git = shutil.which("git") is not None
        self._caches = dict[str, Path]()
        self._num_jobs = 0
        self._python = folder / "python3"
        self._python.write_text(PYTHON.format(python=sys.executable), "utf-8")
        self._python.chmod(0o755)
        self.folder.mkdir()
        self.git("init", "--quiet")

    def git(self, *arguments: str) -> str:
        """Run git in the repository, and return what it prints; nothing without git."""
        if not self._has_git:
            return ""
        own = {"GIT_CONFIG_GLOBAL": os.devnull, "GIT_CONFIG_NOSYSTEM": "1"}
        names = ("-c", "user.name=A. Developer", "-c", "user.email=developer@example.org")
        command = ["git", *names, *arguments]
        done = subprocess.run(
            command, cwd=self.folder, env=os.environ | own, check=True, capture_output=True, text=True
        )
        return done.stdout

    def commit(self, message: str) -> None:
        self.git("add", "--all")
        self.git("commit", "--quiet", "--message", message)

    def edit(self, name: str, old: str, new: str) -> None:
        path = self.folder / "scenes" / f"{name}.yaml"
        text = path.read_text("utf-8")
        assert text.count(old) == 1
        path.write_text(text.replace(old, new), "utf-8")

    def goldens(self) -> dict[str, bytes]:
        """Return the content of all files of goldens."""
        root = self.folder / "scenes/goldens"
        return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}

    def run_job(self, event: str, artifact: Path, *, in_place: bool = False, **inputs: str) -> Job:
        """Run a job with the action.

        event: the event that starts it. artifact: the ZIP archive that it may upload. in_place: whether it works in the
        repository itself, as a job that pushes its changes; else in a copy.
        """
        self._num_jobs += 1
        runner = self._folder_of_jobs / str(self._num_jobs)
        workspace = self.folder
        if not in_place:
            workspace = runner / "workspace"
            workspace.parent.mkdir(parents=True)
            if self._has_git:
                self.git("clone", "--quiet", str(self.folder), str(workspace))
            else:
                shutil.copytree(self.folder, workspace)
        wheels = runner / "home/.cache/hsplat-wheels"

        def restore(given: Mapping[str, str]) -> dict[str, str]:
            assert given["path"] == "~/.cache/hsplat-wheels"
            if given["key"] in self._caches:
                shutil.copytree(self._caches[given["key"]], wheels)
            return {"cache-hit": "true" if given["key"] in self._caches else ""}

        def save(given: Mapping[str, str]) -> dict[str, str]:
            wheels.mkdir(parents=True, exist_ok=True)
            self._caches[given["key"]] = wheels
            return {}

        def upload(given: Mapping[str, str]) -> dict[str, str]:
            assert given["name"] == "golden-report"
            if Path(given["path"]).exists():
                shutil.make_archive(str(artifact.with_suffix("")), "zip", given["path"])
            return {}

        stubs = {"actions/cache/restore": restore, "actions/cache/save": save, "actions/upload-artifact": upload}
        return run_action(
            {"python": str(self._python), **inputs},
            workspace,
            runner / "temp",
            stubs,
            HOME=str(runner / "home"),
            PYTHONPATH=str(CODE),
            GITHUB_EVENT_NAME=event,
        )


@pytest.fixture
def repository(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Repository:
    """Return a repository of three scenes with goldens, which is the current folder."""
    found = Repository(tmp_path)
    monkeypatch.chdir(found.folder)
    Path("scenes").mkdir()
    for name in ("bone", "engine", "skin"):
        Path("scenes", f"{name}.yaml").write_text(SCENE.replace("film.mp4", f"{name}.mp4"), "utf-8")
    assert main.run(["golden", "scenes", "--quiet"]) == 0
    found.commit("Add scenes and their goldens")
    return found


@pytest.mark.slow
def test_from_a_change_to_accepted_goldens(repository: Repository, tmp_path: Path) -> None:
    before, artifact = repository.goldens(), tmp_path / "artifact.zip"
    job = repository.run_job("push", artifact, scenes="scenes")
    assert (job.code, job.ran) == (0, [*INSTALLS, "Compare", "Keep the report"]), job.printed
    assert "pip wheel --wheel-dir" in job.printed and "pip install --no-index --find-links" in job.printed
    assert "### 3 films: 3 pass" in job.summary and "::error" not in job.printed

    repository.edit("engine", WHITE, RED)
    repository.edit("skin", "elevation: 20", "elevation: 21")
    repository.commit("Change one film on purpose, and one by mistake")
    job = repository.run_job("pull_request", artifact, scenes="scenes")
    assert job.code == 1 and job.ran == [*INSTALLS[:3], "Compare", "Keep the report"]
    assert "pip wheel" not in job.printed
    errors = [line.partition("::4 of 4")[0] for line in job.printed.splitlines() if line.startswith("::error")]
    assert sorted(errors) == [
        "::error file=scenes/engine.yaml,line=6,title=golden film engine",
        "::error file=scenes/skin.yaml,line=8,title=golden film skin",
    ]
    assert "### 3 films: 2 fail, 1 pass" in job.summary
    assert "- camera.path.elevation was 20, is 21" in job.summary
    report = tmp_path / "report"
    shutil.unpack_archive(artifact, report)
    assert {"index.html", "report.json", "junit.xml", "code-quality.json", "summary.md"} <= set(os.listdir(report))
    assert (report / "summary.md").read_text("utf-8") == job.summary
    assert ElementTree.parse(report / "junit.xml").getroot().get("failures") == "8"
    places = {each["location"]["path"] for each in json.loads((report / "code-quality.json").read_text("utf-8"))}
    assert places == {"scenes/engine.yaml", "scenes/skin.yaml"}

    inputs = {"scenes": "scenes", "accept": str(artifact), "only": "--only engine"}
    job = repository.run_job("pull_request", artifact, in_place=True, **inputs)
    assert job.code == 2 and "goldens do not change in a job that a change of the code starts" in job.printed
    assert repository.goldens() == before
    job = repository.run_job("workflow_dispatch", artifact, in_place=True, **inputs)
    assert (job.code, job.ran) == (0, [*INSTALLS[:3], "Accept"]), job.printed
    after = repository.goldens()
    assert {name for name in after if after[name] != before[name]} == {
        "engine/golden.json", *(f"engine/frame-000{number}.png" for number in range(4))
    }  # fmt: skip
    for number in range(4):
        assert after[f"engine/frame-000{number}.png"] == (report / f"films/1/new/frame-000{number}.png").read_bytes()
    repository.commit("Accept the new colour of the engine")

    job = repository.run_job("push", artifact, scenes="scenes")
    assert job.code == 1 and "### 3 films: 1 fail, 2 pass" in job.summary
    assert [line.count("engine") for line in job.printed.splitlines() if line.startswith("::error")] == [0]
    repository.edit("skin", "elevation: 21", "elevation: 20")
    repository.commit("Undo the mistake")
    job = repository.run_job("push", artifact, scenes="scenes")
    assert job.code == 0 and "### 3 films: 3 pass" in job.summary


@pytest.mark.slow
def test_words_of_inputs_are_words_of_a_shell_and_no_code(repository: Repository, tmp_path: Path) -> None:
    Path("scenes/bone.yaml").rename("scenes/a bone.yaml")
    Path("scenes/goldens/bone").rename("scenes/goldens/a bone")
    repository.commit("Rename a scene")
    artifact, mark = tmp_path / "artifact.zip", tmp_path / "mark"
    places = "'scenes/a bone.yaml' scenes/[es]*.yaml"
    job = repository.run_job("push", artifact, scenes=places, limit="45 dB", frames="1:3")
    assert job.code == 0 and "### 3 films: 3 pass" in job.summary, job.printed
    assert "| a bone | 2 frames pass: 2 the same | 45 dB |" in job.summary
    for name in ("scenes", "limit", "frames"):
        hostile = f"--goldens=/ * ; touch {mark} $(touch {mark}) `touch {mark}`"
        job = repository.run_job("push", artifact, **{"scenes": "scenes", name: hostile})
        assert job.code == 2, job.printed
    assert not mark.exists()
    assert repository.run_job("push", artifact, scenes="--help").code == 2


@pytest.mark.slow
def test_a_job_without_a_comparison_is_red(repository: Repository, tmp_path: Path) -> None:
    job = repository.run_job("push", tmp_path / "artifact.zip")
    assert job.code == 2 and "::error title=golden films::" in job.printed and "no golden.yaml" in job.printed
    shutil.rmtree("scenes/goldens/skin")
    Path("golden.yaml").write_text("scenes: [scenes/*.yaml]\ngoldens: scenes/goldens\n", "utf-8")
    repository.commit("Forget the goldens of a film")
    job = repository.run_job("push", tmp_path / "artifact.zip")
    assert job.code == 2 and "this scene has no goldens" in job.summary
