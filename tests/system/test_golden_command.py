"""`hsplat golden` from the first frames on: what is written, what is asked, what is left alone."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from small_scene import small_scene

from hsplat_cli import main
from hsplat_cli.commands import golden as command
from hsplat_cli.compare.picture_file import read_picture
from hsplat_cli.executors import frame_result as drawn
from renderer.frame import Frame

CODE = Path(main.__file__).parents[1]

SCENE = small_scene(shape="16, 16, 8", frames=4)
FOLDER = Path("goldens")
NAMES = [f"frame-000{number}.png" for number in range(4)]
OTHER = ["--set", "transfer_function.points.2.color=red"]


@pytest.fixture(autouse=True)
def _folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The current folder, with SCENE in scene.yaml, on a machine that is no CI."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    (tmp_path / "temporary").mkdir()
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")


def golden(*options: str) -> int:
    code = main.run(["golden", "scene.yaml", "goldens", *options])
    assert list(Path("temporary").iterdir()) == [], "temporary files are left"
    assert not (FOLDER / "golden.unfinished").exists()
    return code


def told() -> dict[str, Any]:
    data: dict[str, Any] = json.loads((FOLDER / "golden.json").read_bytes())
    return data


def files() -> dict[str, tuple[bytes, int]]:
    """Content and time of all files in the folder."""
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in FOLDER.iterdir()}


def answer(monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    """What the user says at the terminal."""
    monkeypatch.setattr(command, "_confirm_overwrite", lambda: {"y": True, "n": False}[text])


def test_the_first_goldens(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--date", "2026-11-21") == 0
    assert sorted(path.name for path in FOLDER.iterdir()) == [*NAMES, "golden.json"]
    data = told()
    assert list(data) == ["format", "volume", "gl", "scene", "versions", "frames"]
    assert data["volume"]["shape"] == [16, 16, 8]
    assert data["scene"]["error"]["tolerance"] == 0.1, "defaults are written out"
    assert "file" not in data["scene"]["output"]
    assert [(frame["file"], frame["date"]) for frame in data["frames"]] == [(name, "2026-11-21") for name in NAMES]
    assert capsys.readouterr().out == "goldens: 4 goldens\norigin: goldens/golden.json\n"


def test_they_are_the_frames_of_render() -> None:
    assert golden("--quiet") == 0
    assert main.run(["render", "scene.yaml", "--output", "drawn/{frame:04}.png", "--quiet"]) == 0
    for number, name in enumerate(NAMES):
        assert (FOLDER / name).read_bytes() == Path(f"drawn/{number:04}.png").read_bytes()


def test_the_same_goldens_are_the_same_bytes() -> None:
    assert golden("--quiet") == 0
    before = {name: content for name, (content, _) in files().items()}
    shutil.rmtree(FOLDER)
    assert golden("--quiet", "--workers", "1") == 0
    assert {name: content for name, (content, _) in files().items()} == before


def test_progress_is_shown_and_nothing_else_of_the_inner_film(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden() == 0
    captured = capsys.readouterr()
    assert "drawing" in captured.err and "4/4 frames" in captured.err
    assert "how it was made" not in captured.out and "temporary" not in captured.out + captured.err
    shutil.rmtree(FOLDER)
    assert golden("--quiet") == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(("frames", "numbers"), [("1::2", [1, 3]), ("2", [2])])
def test_some_frames(frames: str, numbers: list[int], capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--frames", frames) == 0
    num = "2 goldens" if len(numbers) == 2 else "1 golden"
    assert capsys.readouterr().out == f"goldens: {num}\norigin: goldens/golden.json\n"
    assert [frame["frame"] for frame in told()["frames"]] == numbers
    assert sorted(FOLDER.glob("*.png")) == [FOLDER / NAMES[number] for number in numbers]


def test_names_of_a_long_path() -> None:
    assert golden("--frames", "7", "--set", "camera.path.frames=100001", "--quiet") == 0
    assert [frame["file"] for frame in told()["frames"]] == ["frame-000007.png"]


def test_where_goldens_are_there_nothing_is_drawn(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--quiet") == 0
    before = files()
    assert golden(*OTHER) == 2
    assert files() == before
    assert "--update" in capsys.readouterr().err


def test_an_update_without_a_change(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--quiet") == 0
    before = files()
    capsys.readouterr()
    assert golden("--update", "--date", "another") == 0
    assert capsys.readouterr().out == "goldens: nothing changes\n"
    assert files() == before


def test_an_update_that_is_wanted(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert golden("--quiet", "--date", "first") == 0
    before = files()
    answer(monkeypatch, "y")
    assert golden("--update", *OTHER) == 0
    after = files()
    assert all(after[name][0] != before[name][0] for name in (*NAMES, "golden.json"))
    assert [frame for frame in told()["frames"] if "date" in frame] == []
    out = capsys.readouterr().out
    assert out.startswith("4 of 4 frames change:\n  levels, worst first   largest   densest       p99      bias\n")
    assert "changed since they were rendered: scene.transfer_function.points was [" in out


def test_an_update_that_is_not_wanted(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    assert golden("--quiet") == 0
    before = files()
    answer(monkeypatch, "n")
    assert golden("--update", *OTHER) == 1
    assert files() == before
    assert capsys.readouterr().out.splitlines()[-1] == "nothing was written"


@pytest.mark.parametrize("ci", ["true", "1"])
def test_nobody_can_be_asked_in_ci(
    ci: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert golden("--quiet") == 0
    before = files()
    monkeypatch.setenv("CI", ci)
    assert golden("--update", *OTHER) == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("4 of 4 frames change:")
    assert "CI is set in the environment" in captured.err
    assert files() == before
    assert golden("--update", "--yes", "--quiet", *OTHER) == 0
    assert capsys.readouterr() == ("", "")
    assert files() != before


def test_nobody_can_be_asked_without_a_terminal(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert golden("--quiet") == 0
    monkeypatch.setenv("CI", "false")
    monkeypatch.setattr(sys, "stdin", open(os.devnull, encoding="utf-8"))  # noqa: SIM115
    assert golden("--update", *OTHER) == 2
    assert "the standard input is not a terminal" in capsys.readouterr().err


def test_frames_that_are_the_same_keep_their_file() -> None:
    assert golden("--quiet") == 0
    before, digests = files(), [frame["digest"] for frame in told()["frames"]]
    coarser = "error.tolerance={0: 0.1, 1: 0.1, 2: 2, 3: 2}"
    assert golden("--update", "--yes", "--quiet", "--set", coarser) == 0
    after = files()
    assert [after[name] == before[name] for name in NAMES] == [True, True, False, False]
    assert [frame["digest"] == digest for frame, digest in zip(told()["frames"], digests, strict=True)] == [
        True, True, False, False
    ]  # fmt: skip


def test_goldens_that_nobody_asks_for(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--quiet") == 0
    (FOLDER / "compare.yaml").write_text("level: exact\n", encoding="utf-8")
    (FOLDER / "frame-0009.png").write_bytes(b"of somebody else")
    before = files()
    capsys.readouterr()
    assert golden("--update", "--frames", ":2") == 0
    told_of = "not requested, and kept (--prune removes them): frame-0002.png, frame-0003.png\n"
    assert capsys.readouterr().out == f"goldens: nothing changes\n{told_of}"
    assert files() == before
    assert golden("--update", "--prune", "--yes", "--frames", ":2") == 0
    assert "to be removed, because not requested: frame-0002.png, frame-0003.png\n" in capsys.readouterr().out
    assert sorted(files()) == ["compare.yaml", "frame-0000.png", "frame-0001.png", "frame-0009.png", "golden.json"]
    assert files()["frame-0009.png"] == before["frame-0009.png"]


def test_limits_of_goldens_that_go(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--quiet") == 0
    limits = "frames:\n  frame-0000.png: {largest: 9}\n  frame-0003.png: {largest: 9}\n"
    (FOLDER / "compare.yaml").write_text(limits, encoding="utf-8")
    assert golden("--update", "--prune", "--yes", "--frames", ":2") == 0
    told_of = "goldens/compare.yaml still names removed goldens, which `hsplat compare` refuses: frame-0003.png\n"
    assert told_of in capsys.readouterr().out


def test_files_of_somebody_else_are_not_touched(capsys: pytest.CaptureFixture[str]) -> None:
    FOLDER.mkdir()
    (FOLDER / "frame-0002.png").write_bytes(b"of somebody else")
    before = files()
    for _ in range(2):
        assert golden() == 2
        assert files() == before
    assert golden("--frames", ":2", "--quiet") == 0
    assert golden("--update", "--yes", "--quiet", "--frames", ":") == 2
    assert files()["frame-0002.png"] == before["frame-0002.png"]


class Killed(BaseException):
    """Stands in for the end of the process."""


def killed_after(num_done: int, monkeypatch: pytest.MonkeyPatch, *options: str) -> list[str]:
    """Run `hsplat golden`, and end it after so many files have vanished or got their names; those that have."""
    done: list[str] = []
    replace, unlink = os.replace, Path.unlink

    def step(path: Path) -> None:
        if path.parent.name == FOLDER.name and not path.name.startswith("."):
            if len(done) == num_done:
                raise Killed
            done.append(path.name)

    def replacing(source: Path, target: Path) -> None:
        step(Path(target))
        replace(source, target)

    def unlinking(path: Path, missing_ok: bool = False) -> None:
        step(path)
        unlink(path, missing_ok=missing_ok)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", replacing)
        patch.setattr(Path, "unlink", unlinking)
        with pytest.raises(Killed):
            main.run(["golden", "scene.yaml", "goldens", "--quiet", *options])
    return done


@pytest.mark.parametrize("num_done", range(5))
def test_what_a_kill_leaves_the_next_update_repairs(num_done: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever between the operations that change the folder: a golden goes, golden.json and three goldens come."""
    assert golden("--quiet") == 0
    options = ("--update", "--yes", "--prune", "--frames", ":3", *OTHER)
    done = killed_after(num_done, monkeypatch, *options)
    assert done == ["frame-0003.png", "golden.json", *NAMES][:num_done]
    assert {path.name for path in FOLDER.glob("*.png")} <= {frame["file"] for frame in told()["frames"]}
    assert golden(*options) == 0
    repaired = {name: content for name, (content, _) in files().items()}
    shutil.rmtree(FOLDER)
    assert golden("--quiet", *options[3:]) == 0
    assert {name: content for name, (content, _) in files().items()} == repaired


@pytest.mark.parametrize("num_done", range(5))
def test_what_a_kill_leaves_of_the_first_goldens(num_done: int, monkeypatch: pytest.MonkeyPatch) -> None:
    assert killed_after(num_done, monkeypatch) == ["golden.json", *NAMES][:num_done]
    assert golden() == (2 if num_done else 0), "there are goldens, or there is nothing"
    assert golden("--update", "--yes", "--quiet") == 0
    assert [name for name in NAMES if not (FOLDER / name).is_file()] == []
    assert golden("--update") == 0, "nothing changes, and so nobody is asked"


KILLED = """
import os, signal, sys
from pathlib import Path
from hsplat_cli import main
from hsplat_cli.executors import frame_result

replace = os.replace

def dying(source, target):
    if Path(target).parent.name == "goldens":
        if Path(target).name == "frame-0001.png":
            os.kill(os.getpid(), signal.SIGKILL)
    replace(source, target)

os.replace = dying
main.run(sys.argv[1:])
"""


def test_a_real_kill_leaves_nothing_for_ever() -> None:
    command_line = [sys.executable, "-c", KILLED, "golden", "scene.yaml", "goldens", "--quiet"]
    environment = os.environ | {"PYTHONPATH": str(CODE), "TMPDIR": str(Path("temporary").absolute())}
    done = subprocess.run(command_line, check=False, env=environment)
    assert done.returncode == -signal.SIGKILL
    assert sorted(path.name for path in FOLDER.glob("*.*")) == ["frame-0000.png", "golden.json", "golden.unfinished"]
    shutil.rmtree("temporary")  # as the system does it in time
    Path("temporary").mkdir()
    assert golden("--update", "--yes", "--quiet") == 0
    assert sorted(files()) == [*NAMES, "golden.json"]


HOLDING = """
import sys
from pathlib import Path
from renderer.film import lock_slots

with lock_slots(Path("goldens/golden.unfinished"), [0], Path("goldens/golden.json")):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_two_at_a_time_keep_apart(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--quiet") == 0
    before = {name: content for name, content in files().items() if name != "golden.unfinished"}
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLDING],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=os.environ | {"PYTHONPATH": str(CODE)},
    )
    with holder:
        assert holder.stdout is not None and holder.stdout.readline() == b"held\n"
        assert main.run(["golden", "scene.yaml", "goldens", "--update", "--yes", *OTHER]) == 2
        assert "another job is writing this output" in capsys.readouterr().err
    assert files() == before


def test_a_film_that_can_be_made_again() -> None:
    """Of a film on a budget of time the sidecar has the tolerances, and so it can be golden."""
    budget = ["--set", "error={seconds: 0.02}", "--best-effort", "--quiet"]
    assert main.run(["render", "scene.yaml", "--output", "film.mp4", "--frames", ":2", *budget]) == 0
    assert main.run(["golden", "film.mp4.json", "goldens", "--quiet"]) == 0
    assert [frame["frame"] for frame in told()["frames"]] == [0, 1]
    assert main.run(["golden", "film.mp4.json", "goldens", "--update"]) == 0


def test_odd_sizes_and_transparency_that_a_film_could_not_have() -> None:
    assert golden("--quiet", "--set", "output.size=[31, 29]", "--set", "output.background=transparent") == 0
    assert read_picture(FOLDER / "frame-0000.png").shape == (29, 31, 4)


def test_an_interrupt_waits_until_files_have_changed_together(monkeypatch: pytest.MonkeyPatch) -> None:
    assert golden("--quiet") == 0
    replace = os.replace

    def interrupted(source: Path, target: Path) -> None:
        replace(source, target)
        if Path(target).name == "golden.json":
            os.kill(os.getpid(), signal.SIGINT)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupted)
        assert golden("--update", "--yes", "--quiet", *OTHER) == 130
    assert golden("--update", "--quiet", *OTHER) == 0, "nothing changes, and so nobody is asked"


def test_an_interrupt_while_frames_are_drawn_leaves_all_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    assert golden("--quiet") == 0
    before, original = files(), drawn.render_frames

    def stopped(*arguments: Any, **options: Any) -> Iterator[Frame]:
        yield next(original(*arguments, **options))
        raise KeyboardInterrupt

    monkeypatch.setattr(drawn, "render_frames", stopped)
    assert golden("--update", "--yes", *OTHER) == 130
    assert files() == before


def test_what_is_not_seen_is_said(capsys: pytest.CaptureFixture[str]) -> None:
    hidden = [
        "--set",
        "transfer_function.points=[{value: 300, color: white, opacity: 0}, {value: 301, color: white, opacity: 1}]",
    ]
    assert golden(*hidden) == 0
    assert capsys.readouterr().out.startswith("note: nothing is visible: ")
    shutil.rmtree(FOLDER)
    assert golden("--quiet", *hidden) == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    "options", [["--set", "output.size=[16384, 16384]"], ["--set", "error={seconds: 1}"], ["--set", "a=1"]]
)
def test_scenes_that_cannot_be_golden(options: list[str]) -> None:
    assert golden(*options) == 2
    assert not FOLDER.exists()


def test_no_place_for_frames(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", "nowhere")
    assert main.run(["golden", "scene.yaml", "goldens"]) == 1
    assert capsys.readouterr().err == (
        "cannot create a temporary folder for frames\n"
        "  got: No such file or directory\n"
        "  hint: set the environment variable TMPDIR to another folder\n"
    )


def test_an_update_is_of_the_frames_that_are_golden() -> None:
    """Whoever keeps some frames need not say again which."""
    assert golden("--frames", "1::2", "--quiet") == 0
    before = files()
    assert golden("--update", "--yes", "--quiet", *OTHER) == 0
    after = files()
    assert after.keys() == before.keys()
    assert [name for name in after if after[name] == before[name]] == []


@pytest.mark.parametrize("options", [["--frames", "0:3", *OTHER], ["--set", "camera.path.frames=3"]])
def test_golden_json_tells_of_one_scene(options: list[str]) -> None:
    """What some goldens would no longer be of is not written over what they are of."""
    assert golden("--quiet") == 0
    before = files()
    assert golden("--update", "--yes", *options) == 2
    assert files() == before
    assert golden("--update", "--yes", "--prune", "--quiet", *options) == 0
    assert [frame["frame"] for frame in told()["frames"]] == [0, 1, 2]


def test_each_golden_keeps_the_date_of_its_picture() -> None:
    assert golden("--quiet", "--date", "first", "--frames", ":2") == 0
    (FOLDER / "frame-0001.png").unlink()
    assert golden("--update", "--yes", "--quiet", "--date", "second", "--frames", "1:3") == 0
    assert [(frame["frame"], frame["date"]) for frame in told()["frames"]] == [
        (0, "first"), (1, "second"), (2, "second")
    ]  # fmt: skip
