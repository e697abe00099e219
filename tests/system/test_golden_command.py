"""`hsplat golden` draws goldens, asks before it replaces them, and leaves other files alone."""

from __future__ import annotations

import os
import pty
import shutil
import signal
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
from golden_projects import CHANGE, ENGINE, NAMES, compare, edit_scene, files, golden, golden_json
from png_files import interlaced
from resuming import watch_draws
from small_scene import edit_sidecar

from hsplat_cli import main
from hsplat_cli.commands import golden as command
from renderer.film import decode_png, encode_png

UPDATE = ("scenes/engine.yaml", "--update", "--yes")


@pytest.fixture(autouse=True)
def temporary(project: Path, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder for temporary files."""
    folder = tmp_path_factory.mktemp("temporary")
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.fixture(autouse=True)
def _nothing_is_left(temporary: Path) -> object:
    yield
    assert list(temporary.iterdir()) == [], "temporary files are left"
    left = [name for name in files() if "golden.ready" in name or "golden.making" in name or ".lock" in name]
    assert left == []


def frames(folder: Path = ENGINE) -> dict[int, list[str | None]]:
    return {
        each["frame"]: [picture.get("file") for picture in each["pictures"]] for each in golden_json(folder)["frames"]
    }


# The first goldens


def test_the_first_goldens_are_the_frames_of_render(capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree("scenes/goldens")
    assert main.run(["golden", "scenes"]) == 0
    captured = capsys.readouterr()
    assert captured.out.splitlines()[1::2] == ["scenes/goldens/box: 4 goldens", "scenes/goldens/engine: 4 goldens"]
    assert "4/4 frames" in captured.err and "temporary" not in captured.err
    data = golden_json()
    assert list(data) == ["format", "origins", "selection", "flicker", "frames"]
    (origin,) = data["origins"]
    assert origin["volume"]["shape"] == [16, 16, 8]
    assert "file" not in origin["scene"]["output"]
    assert main.run(["render", "scenes/engine.yaml", "--output", "drawn/{frame:04}.png", "--quiet"]) == 0
    for number, name in enumerate(NAMES):
        assert (ENGINE / name).read_bytes() == Path(f"drawn/{number:04}.png").read_bytes()


def test_equal_goldens_are_equal_bytes() -> None:
    before = files()
    shutil.rmtree("scenes/goldens")
    assert golden("scenes") == 0
    assert files() == before


def test_a_new_scene_joins_a_project(capsys: pytest.CaptureFixture[str]) -> None:
    before = files()
    shutil.copy("scenes/engine.yaml", "scenes/new.yaml")
    assert main.run(["golden", "scenes"]) == 0
    assert "note: 2 scenes with goldens left alone" in capsys.readouterr().out
    assert {name: content for name, content in files().items() if "new" not in name} == before
    assert golden("scenes") == 2
    assert "all scenes have goldens" in capsys.readouterr().err


def test_digests_have_no_pictures_and_are_as_strict(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("scenes", "--update", "--yes", "--digests") == 0
    assert sorted(files(Path("scenes/goldens"))) == [f"scenes/goldens/{name}/golden.json" for name in ("box", "engine")]
    assert compare() == 0
    edit_scene()
    assert golden(*UPDATE) == 0
    assert frames() == {number: [None] for number in range(4)}, "digests stay digests"
    edit_scene(*reversed(CHANGE))
    assert compare() == 1
    assert "other stored values than those of the golden's digest" in capsys.readouterr().out


def test_digests_become_pictures_by_the_project_file(capsys: pytest.CaptureFixture[str]) -> None:
    before = files()
    assert golden(*UPDATE, "--digests") == 0
    Path("scenes/golden.yaml").write_text("pictures: files\n")
    assert main.run(["golden", "scenes/engine.yaml", "--update"]) == 0, "nothing is replaced, so that nobody is asked"
    assert capsys.readouterr().out.splitlines()[:2] == ["engine: 4 goldens of 4", f"  {NAMES[0]}  new"]
    Path("scenes/golden.yaml").unlink()
    assert files() == before


# Updates


def test_nothing_changes_where_nothing_differs(capsys: pytest.CaptureFixture[str]) -> None:
    before = files()
    assert main.run(["golden", "scenes", "--update"]) == 0
    assert capsys.readouterr().out == "nothing changes\n"
    assert files() == before


def test_another_device_or_version_alone_is_no_change() -> None:
    def edit(data: dict[str, object]) -> None:
        data["origins"][0].update(device="y", versions={"numpy": "1"})  # type: ignore[index]

    edit_sidecar(ENGINE / "golden.json", edit)
    before = files()
    assert golden("scenes", "--update") == 0
    assert files() == before


def test_without_an_answer_or_with_no_goldens_stay(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    edit_scene()
    before = files()
    assert golden("scenes") == 2
    with open(os.devnull, encoding="utf-8") as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        assert golden("scenes", "--update") == 2
        assert "the standard input is not a terminal" in capsys.readouterr().err
    monkeypatch.setenv("CI", "true")
    assert golden("scenes", "--update") == 2
    assert "CI is set in the environment" in capsys.readouterr().err
    monkeypatch.setattr(command, "_confirm", lambda _: False)
    assert golden("scenes", "--update") == 1
    assert capsys.readouterr().out.splitlines()[-1] == "nothing was written"
    assert files() == before


@pytest.mark.parametrize(("answer", "code"), [("y", 0), ("n", 1)])
def test_the_question_is_asked_at_a_terminal(answer: str, code: int, capsys, monkeypatch) -> None:
    edit_scene()
    keyboard, terminal = pty.openpty()
    with open(keyboard, "w", encoding="utf-8") as keys, open(terminal, encoding="utf-8") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        keys.write(f"{answer}\n")
        keys.flush()
        assert golden("scenes", "--update") == code
    assert "Replace these goldens? [y/N]: " in capsys.readouterr().out
    assert compare() == code


def test_the_changes_are_shown(capsys: pytest.CaptureFixture[str]) -> None:
    edit_scene("tolerance: 0.1", "tolerance: {0: 0.1, 1: 0.1, 2: 2, 3: 2}")
    before = files()
    assert main.run(["golden", *UPDATE]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "engine: 2 goldens of 4"
    assert [line.split()[0] for line in lines[1:3]] == NAMES[2:]
    assert "error.tolerance was 0.1, is " in lines[3]
    after = files()
    changed = {Path(name).name for name in after if after[name] != before[name]}
    assert changed == {*NAMES[2:], "golden.json"}
    assert [each["pictures"][0]["origin"] for each in golden_json()["frames"]] == [0, 0, 1, 1]


def test_frames_of_an_option_are_updated_alone_and_others_pruned() -> None:
    before = files()
    edit_scene()
    assert golden(*UPDATE, "--frames", "1") == 0
    after = files()
    assert {Path(name).name for name in before if after[name] != before[name]} == {
        NAMES[1], "golden.json", "engine.yaml"
    }  # fmt: skip
    assert golden(*UPDATE, "--frames", ":2", "--prune") == 0
    assert sorted(path.name for path in ENGINE.iterdir()) == [*NAMES[:2], "golden.json"]
    assert compare("scenes/engine.yaml") == 0


def selection() -> object:
    return golden_json()["selection"]


def test_the_slice_of_golden_frames_is_recorded(capsys: pytest.CaptureFixture[str]) -> None:
    assert selection() == ":"
    assert golden(*UPDATE, "--frames", "1") == 0
    assert selection() == ":", "a part of them was drawn again"
    assert main.run(["golden", *UPDATE, "--frames", "::2", "--prune"]) == 0
    assert "  frames ::2, in place of :" in capsys.readouterr().out.splitlines()
    edit_scene("frames: 4", "frames: 6")
    assert golden(*UPDATE) == 0
    assert (selection(), [*frames()]) == ("::2", [0, 2, 4])
    assert golden(*UPDATE, "--frames", ":3") == 0
    assert (selection(), [*frames()]) == ("::2", [0, 1, 2, 4]), "not all frames of the slice before are drawn"
    assert golden(*UPDATE, "--prune") == 0
    assert (selection(), [*frames()]) == ("::2", [0, 2, 4])
    assert golden(*UPDATE, "--frames", "0:") == 0
    assert (selection(), [*frames()]) == ("0:", [0, 1, 2, 3, 4, 5]), "the option takes in all of them"
    Path("scenes/golden.yaml").write_text("frames: 1\n")
    assert golden("scenes", "--update", "--yes", "--prune") == 0
    assert (selection(), [*frames()]) == ("1", [1])


def test_an_update_after_a_partial_one_is_no_change_of_the_flicker_alone() -> None:
    edit_sidecar(ENGINE / "golden.json", lambda data: data.pop("flicker"))
    before = files()
    assert golden("scenes", "--update") == 0
    assert files() == before


@pytest.mark.parametrize("arguments", [("--digests", "--limit", "45"), ("--digests", "--limit", "stated accuracy")])
def test_digests_have_no_other_limit(arguments: tuple[str, ...], capsys: pytest.CaptureFixture[str]) -> None:
    assert golden(*UPDATE, *arguments) == 2
    assert "digests have no limit but `same bytes`" in capsys.readouterr().err
    assert golden(*UPDATE, "--digests") == 0
    assert compare("scenes/engine.yaml", "--limit", "45") == 2
    assert "hint: leave the limit out, or keep pictures by `pictures: files`" in capsys.readouterr().out
    assert compare("scenes/engine.yaml", "--limit", "same bytes") == 0


def test_an_update_is_of_the_golden_frames() -> None:
    assert golden(*UPDATE, "--frames", "1:3", "--prune") == 0
    edit_scene()
    assert golden(*UPDATE) == 0
    assert list(frames()) == [1, 2]


def test_a_shorter_film(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden(*UPDATE, "--frames", "2:", "--prune") == 0
    edit_scene("frames: 4", "frames: 2")
    assert golden(*UPDATE) == 2
    assert "the scene has none of the frames that have goldens" in capsys.readouterr().err
    assert golden(*UPDATE, "--frames", ":", "--prune") == 0
    assert list(frames()) == [0, 1]


def test_goldens_that_an_update_leaves_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["golden", *UPDATE, "--frames", "1"]) == 0
    note = "note: engine: goldens of frames that were not drawn stay: 0, 2, 3; --prune removes them"
    assert capsys.readouterr().out.splitlines() == [note, "nothing changes"]
    edit_scene("frames: 4", "frames: 2")
    edit_scene()
    assert main.run(["golden", *UPDATE]) == 0
    note = "note: engine: goldens of frames that the film does not have any more stay: 2, 3; --prune removes them"
    assert capsys.readouterr().out.splitlines()[0] == note
    assert main.run(["golden", *UPDATE, "--prune"]) == 0
    assert main.run(["golden", *UPDATE]) == 0
    assert "stay" not in capsys.readouterr().out


def test_a_golden_without_a_file_is_drawn_again() -> None:
    before = files()
    (ENGINE / NAMES[3]).unlink()
    (ENGINE / NAMES[2]).write_bytes(b"no picture")
    (ENGINE / NAMES[1]).write_bytes(encode_png(np.zeros((8, 8, 4), np.uint8)))
    assert golden("scenes", "--update") == 0
    assert files() == before


def test_other_bytes_of_equal_pixels_are_kept() -> None:
    path = ENGINE / NAMES[0]
    path.write_bytes(interlaced(decode_png(path.read_bytes())))
    before = files()
    assert compare() == 0
    assert golden("scenes", "--update") == 0
    assert files() == before


def test_further_goldens_are_kept_where_pictures_exceed_the_limit() -> None:
    edit_scene("tolerance: 0.1", "tolerance: {0: 0.1, 1: 0.2, 2: 8, 3: 8}")
    before = files()
    assert golden("scenes/engine.yaml", "--also", "--limit", "35") == 0
    assert frames() == {
        0: NAMES[:1],
        1: NAMES[1:2],
        2: [NAMES[2], "frame-0002-2.png"],
        3: [NAMES[3], "frame-0003-2.png"],
    }
    assert all(files()[name] == before[name] for name in before if not name.endswith("golden.json"))
    assert compare("scenes/engine.yaml", "--limit", "35") == 0
    edit_scene()
    assert golden(*UPDATE) == 0
    assert frames() == {number: [name] for number, name in enumerate(NAMES)}, "an update replaces all of them"
    assert sorted(path.name for path in ENGINE.iterdir()) == [*NAMES, "golden.json"]


def test_a_limit_that_neighbours_pass_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    edit_scene()
    assert main.run(["golden", *UPDATE, "--limit", "1"]) == 0
    line = capsys.readouterr().out.splitlines()[-2]
    assert line == (
        "note: at `1 dB`, 3 pairs of neighbouring goldens would pass as each other: 0 and 1, 1 and 2, 2 and 3"
    )
    edit_scene(*reversed(CHANGE))
    assert main.run(["golden", *UPDATE]) == 0
    assert "would pass" not in capsys.readouterr().out


def test_goldens_without_a_scene_are_pruned(capsys: pytest.CaptureFixture[str]) -> None:
    Path("scenes/engine.yaml").unlink()
    (ENGINE / "notes.txt").touch()
    before = files()
    assert main.run(["golden", "scenes", "--update", "--yes"]) == 0
    assert "note: no scene has the goldens in scenes/goldens/engine: --prune removes them" in capsys.readouterr().out
    assert golden("scenes", "--update", "--prune") == 2, "nobody can be asked"
    assert files() == before
    capsys.readouterr()
    assert main.run(["golden", "scenes", "--update", "--prune", "--yes"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "scenes/goldens/engine: 4 goldens removed, which no scene has",
        "scenes/goldens/engine: removed",
    ]
    assert [path.name for path in ENGINE.iterdir()] == ["notes.txt"]
    (ENGINE / "notes.txt").unlink()
    assert compare() == 0


# Refusals, before anything is drawn


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (["scenes", "--accept", "report", "--frames", "1"], "--frames: of no use with --accept"),
        (["scenes", "--accept", "report", "--limit", "1"], "--limit: of no use with --accept"),
        (["scenes", "--update", "--frames", "9"], "--frames: no frame is in this range"),
        (["scenes", "--update", "--frames", "x"], "--frames: not a range of frames"),
        (["scenes", "--limit", "exact"], "--limit exact: not a limit"),
    ],
)
def test_options_that_have_no_use(arguments: list[str], error: str, capsys, monkeypatch) -> None:
    monkeypatch.setattr("hsplat_cli.compare.golden.update.drawn_frames", None)
    before = files()
    assert golden(*arguments) == 2
    assert error in capsys.readouterr().err
    assert files() == before


def test_frames_that_cannot_be_golden(capsys: pytest.CaptureFixture[str]) -> None:
    for goal, error in (("seconds: 1", "within a time budget"), ("psnr: 40", "depend on the other frames")):
        edit_scene("tolerance: 0.1, probes: 16", goal)
        assert golden(*UPDATE) == 2
        assert error in capsys.readouterr().err
        edit_scene(goal, "tolerance: 0.1, probes: 16")


@pytest.mark.parametrize("num_listed", [3, 0])
def test_pictures_of_unknown_origin_are_not_replaced(num_listed: int, capsys: pytest.CaptureFixture[str]) -> None:
    if num_listed:
        edit_sidecar(ENGINE / "golden.json", lambda data: data["frames"].pop())
    else:
        (ENGINE / "golden.json").unlink()
    before = files()
    assert golden(*UPDATE) == 2
    assert "golden.json does not list all goldens in this folder" in capsys.readouterr().err
    assert files() == before


def test_a_place_where_nothing_can_be_written_is_found_before_drawing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hsplat_cli.compare.golden.update.drawn_frames", None)
    Path("file").touch()
    assert golden("scenes/engine.yaml", "--goldens", "file") == 2
    assert golden("scenes/engine.yaml", "--goldens", "/proc") == 1


def test_a_job_that_a_change_starts_replaces_nothing(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    edit_scene()
    before = files()
    monkeypatch.setenv("GITHUB_EVENT_NAME", "pull_request")
    for option in ("--update", "--also"):
        assert golden("scenes/engine.yaml", option, "--yes") == 2
        assert f"{option}: goldens do not change in a job that" in capsys.readouterr().err
    assert files() == before
    monkeypatch.setenv("GITHUB_EVENT_NAME", "workflow_dispatch")
    assert golden(*UPDATE) == 0


# Interrupts


@pytest.mark.usefixtures("heeds_interrupts")
def test_an_interrupt_waits_until_all_files_of_a_scene_are_written(monkeypatch: pytest.MonkeyPatch) -> None:
    edit_scene()
    replace = os.replace

    def interrupted(source: Path, target: Path) -> None:
        replace(source, target)
        if Path(target).name == NAMES[0]:
            os.kill(os.getpid(), signal.SIGINT)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupted)
        assert golden(*UPDATE) == 130
    assert golden("scenes/engine.yaml", "--update") == 0, "nothing changes, so that nobody is asked"


def test_an_interrupt_while_frames_are_drawn_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    edit_scene()
    before = files()
    watch_draws(monkeypatch).stop_at = 1
    assert golden(*UPDATE) == 130
    assert files() == before


def test_a_missing_temporary_folder(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", "nowhere")
    assert golden(*UPDATE) == 1
    assert capsys.readouterr().err == (
        "cannot create a temporary folder for frames\n"
        "  got: No such file or directory\n"
        "  hint: set the environment variable TMPDIR to another folder\n"
    )


# What is recorded


@pytest.mark.parametrize("name", ["a\nb.npy", "\udcff.npy", f"{'x' * 240}.npy"])
def test_the_place_of_a_volume_is_not_recorded_and_its_name_may_change(name: str) -> None:
    Path("scans").mkdir()
    np.save(Path("scans", name), np.arange(2048, dtype=np.uint8).reshape(8, 16, 16))
    os.rename(f"scans/{name}", "scans/scan.npy")
    edit_scene("{procedural: {name: engine_block, shape: [16, 16, 8]}}", "{file: ../scans/scan.npy}")
    Path("linked").symlink_to("scans")
    assert golden(*UPDATE) == 0
    before = files(ENGINE)
    assert b"scans" not in before[str(ENGINE / "golden.json")]
    assert "file" not in golden_json()["origins"][0]["scene"]["volume"]
    os.rename("scans/scan.npy", f"scans/{name}")
    Path("scans/scan.npy").symlink_to(name)
    assert golden("scenes/engine.yaml", "--update") == 0
    assert files(ENGINE) == before


def test_names_of_goldens_are_in_the_order_of_frames() -> None:
    edit_scene("frames: 4", "frames: 10001")
    assert golden(*UPDATE, "--frames", "7", "--prune") == 0
    assert sorted(path.name for path in ENGINE.iterdir()) == ["frame-00007.png", "golden.json"]
