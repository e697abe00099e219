"""Messages about a film that is verified."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from message_scenes import shorter_scene
from small_scene import contents, edit_sidecar
from transcripts import Case, cases

from hsplat_cli import main


@pytest.fixture(scope="module")
def template(module_folder: Path) -> Path:
    """Draw a film and its frames once for all cases."""
    Path("scene.yaml").write_text(shorter_scene(6), encoding="utf-8")
    for output in ("film.gif", "frames/{frame}.png"):
        assert main.run(["render", "scene.yaml", "--quiet", "--output", output]) == 0
    np.save("other.npy", np.arange(512, dtype=np.uint8).reshape(8, 8, 8))
    Path("other.json").write_text("{}", encoding="utf-8")
    return module_folder


def damage_pictures() -> None:
    Path("frames/0.png").unlink()
    shutil.copy("frames/2.png", "frames/1.png")
    Path("frames/5.png").write_bytes(Path("frames/5.png").read_bytes()[:-9])


# What happens before the commands of a case, by its title.
PREPARATIONS: dict[str, Callable[[], object]] = {
    "pictures that are missing, exchanged and edited": damage_pictures,
    "a film that is cut off": lambda: Path("film.gif").write_bytes(Path("film.gif").read_bytes()[:-9]),
    "another scene in the sidecar": lambda: edit_sidecar(
        "film.gif.json", lambda data: data["scene"]["camera"]["path"].update(elevation=21)
    ),
    "a picture that is gone and has no digest": lambda: edit_sidecar(
        "frames/frames.json", lambda data: data["frames"][3].pop("digest")
    ),
    "no sidecar": lambda: Path("film.gif.json").unlink(),
}


@cases("verify.txt")
def test_messages(case: Case, template: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No command changes a file; `~` and `rm` do."""
    shutil.copytree(template, folder, dirs_exist_ok=True)
    PREPARATIONS.get(case.title, lambda: None)()
    before = contents()
    case.check(capsys)
    if "written to" not in case.title and not any(line.startswith(("~", "$ rm")) for line in case.lines):
        assert contents() == before
