"""`hsplat golden --accept` takes the new pictures of a report, if all that they were compared with is unchanged."""

from __future__ import annotations

import os
import shutil
import signal
import sys
from collections.abc import Callable
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from golden_projects import CHANGE, ENGINE, NAMES, compare, edit_scene, files, golden, golden_json, report, statuses
from small_scene import edit_sidecar

from hsplat_cli import main
from hsplat_cli.compare import GOLDEN_RECORD, GoldenFolder, picture_digest
from renderer.film import decode_png, encode_png

ENGINE_NEW = Path("report/films/1/new")


@pytest.fixture(autouse=True, scope="module")
def compared(tmp_path_factory: pytest.TempPathFactory, made_project: Path) -> Path:
    """Return a folder with a project of which both scenes have changed, and the report."""
    folder = tmp_path_factory.mktemp("compared")
    shutil.copytree(made_project, folder, dirs_exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        edit_scene()
        edit_scene(name="box")
        assert report()[0] == 1
        shutil.make_archive("archive", "zip", "report")
    return folder


@pytest.fixture(autouse=True)
def _folder(compared: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a copy of `compared` the current folder, where nobody can be asked."""
    shutil.copytree(compared, tmp_path, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CI", "true")
    for name in ("GITHUB_EVENT_NAME", "CI_PIPELINE_SOURCE", "CI_JOB_MANUAL"):
        monkeypatch.delenv(name, raising=False)


def accept(*only: str, source: str = "report", scenes: str = "scenes", options: tuple[str, ...] = ()) -> int:
    """Accept frames of a report, and require that nothing is drawn."""
    choices = [word for each in only for word in ("--only", each)]
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("renderer.job.make_film", None)
        return golden(scenes, "--accept", source, *choices, *options)


def refused(capsys: pytest.CaptureFixture[str], *only: str, **more: Any) -> str:
    """Require that nothing is accepted, and return the error."""
    before = files()
    capsys.readouterr()
    assert accept(*only, **more) in (1, 2)
    assert files() == before
    return capsys.readouterr().err


def accepted() -> dict[str, list[int]]:
    """Return the frames of each scene whose goldens are the new pictures."""
    found = {}
    for number, name in enumerate(("box", "engine")):
        new = Path(f"report/films/{number}/new")
        pairs = [(new / each, Path("scenes/goldens", name, each)) for each in NAMES]
        found[name] = [frame for frame, pair in enumerate(pairs) if pair[0].read_bytes() == pair[1].read_bytes()]
    return found


def edit_report(edit: Callable[[dict[str, Any]], object]) -> None:
    edit_sidecar("report/report.json", lambda data: edit(data["films"][1]))


# What is accepted


@pytest.mark.parametrize("source", ["report", "report/report.json", "archive.zip"])
def test_all_that_fails_is_accepted(source: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["golden", "scenes", "--accept", source]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "box: 4 frames accepted",
        "scenes/goldens/box: 4 goldens",
        "engine: 4 frames accepted",
        "scenes/goldens/engine: 4 goldens",
    ]
    assert accepted() == {"box": [0, 1, 2, 3], "engine": [0, 1, 2, 3]}
    before = files()
    assert main.run(["golden", "scenes", "--accept", source]) == 0
    assert capsys.readouterr().out == "nothing changes\n"
    assert files() == before


def test_what_is_accepted_is_what_an_update_draws() -> None:
    assert accept() == 0
    by_report = files(Path("scenes"))
    shutil.copytree("scenes", "again/scenes", ignore=shutil.ignore_patterns("goldens"))
    assert golden("again/scenes") == 0
    assert files(Path("again/scenes")) == {f"again/{name}": content for name, content in by_report.items()}


def test_frames_are_accepted_one_after_the_other() -> None:
    assert accept("engine:1-2") == 0
    assert accepted() == {"box": [], "engine": [1, 2]}
    assert accept("engine:1", "engine:0,1", "box:3") == 0
    assert accepted() == {"box": [3], "engine": [0, 1, 2]}
    assert accept("engine", "engine:3") == 0
    assert accepted() == {"box": [3], "engine": [0, 1, 2, 3]}
    assert [len(golden_json(Path("scenes/goldens", name))["origins"]) for name in ("box", "engine")] == [2, 1]
    assert accept() == 0
    assert accepted() == {"box": [0, 1, 2, 3], "engine": [0, 1, 2, 3]}


def test_after_some_frames_are_accepted_the_others_still_fail() -> None:
    """With the changed key as the reason."""
    before = report()[1]["engine"]["changes"]
    assert accept("engine:1-2") == 0
    _, films = report()
    assert statuses(films["engine"]) == ["different", "same", "same", "different"]
    assert films["engine"]["changes"] == before != []


def test_frames_accepted_in_two_steps_have_the_flicker_of_the_film() -> None:
    assert accept("engine:1-2", "box") == 0
    assert "flicker" not in golden_json()
    assert accept() == 0
    assert golden_json()["flicker"] > 0
    before = files()
    assert golden("scenes", "--update") == 0
    assert files() == before


def test_pictures_of_another_machine_join_the_goldens() -> None:
    assert accept("engine:0", options=("--also",)) == 0
    assert [len(each["pictures"]) for each in golden_json()["frames"]] == [2, 1, 1, 1]
    assert (ENGINE / "frame-0000-2.png").read_bytes() == (ENGINE_NEW / NAMES[0]).read_bytes()
    _, films = report()
    assert statuses(films["engine"]) == ["same", "different", "different", "different"]
    assert films["engine"]["frames"][0]["golden"] == 2


@pytest.mark.parametrize("options", [(), ("--also",)])
def test_a_missing_picture_is_accepted(options: tuple[str, ...]) -> None:
    """It is the one that golden.json describes, whose file was lost."""
    edit_scene(*reversed(CHANGE))
    before = files(ENGINE)
    (ENGINE / NAMES[2]).unlink()
    assert compare("scenes/engine.yaml", "--report", "report") == 1
    assert accept(scenes="scenes/engine.yaml", options=options) == 0
    assert files(ENGINE) == before


def test_digests_are_accepted_as_digests() -> None:
    edit_scene(*reversed(CHANGE))
    assert golden("scenes/engine.yaml", "--update", "--yes", "--digests") == 0
    edit_scene()
    assert compare("scenes/engine.yaml", "--report", "report") == 1
    assert accept("engine:1", scenes="scenes/engine.yaml") == 0
    assert sorted(path.name for path in ENGINE.iterdir()) == ["golden.json"]
    assert compare("scenes/engine.yaml", "--frames", "1") == 0


# What is refused: something else than when it was compared


def test_another_scene(capsys: pytest.CaptureFixture[str]) -> None:
    edit_scene("tolerance: 0.1", "tolerance: 0.2")
    error = refused(capsys)
    assert "scenes/engine.yaml: the scene, or its volume, changed since the pictures were drawn" in error
    assert "error.tolerance was 0.1, is 0.2" in error
    assert accept("box") == 0, "the other scene is as it was"


def test_another_scene_whose_pictures_were_accepted(capsys: pytest.CaptureFixture[str]) -> None:
    assert accept("engine") == 0
    edit_scene("tolerance: 0.1", "tolerance: 0.2")
    assert "changed since the pictures were drawn" in refused(capsys, "engine")


def test_another_name_of_the_film_is_no_other_scene() -> None:
    """Nor are comments and the layout of the file."""
    edit_scene("engine.mp4", "other.mp4\n  # a comment")
    assert accept("engine") == 0


def test_another_volume(capsys: pytest.CaptureFixture[str]) -> None:
    values = np.arange(2048, dtype=np.uint8).reshape(8, 16, 16)
    np.save("scenes/scan.npy", values)
    edit_scene("{procedural: {name: engine_block, shape: [16, 16, 8]}}", "{file: scan.npy}")
    assert compare("scenes", "--report", "report") == 1
    values[3, 3, 3] ^= 1
    np.save("scenes/scan.npy", values)
    assert "got: the voxels of the volume changed" in refused(capsys, "engine")


def test_options_of_the_comparison_are_another_scene(capsys: pytest.CaptureFixture[str]) -> None:
    assert compare("scenes", "--set", "error.tolerance=1", "--report", "report") == 1
    assert "changed since the pictures were drawn" in refused(capsys)


def test_other_goldens(capsys: pytest.CaptureFixture[str]) -> None:
    """The frame that changed cannot be accepted, the others can."""
    edit_scene(CHANGE[1], "#00ff00")
    assert golden("scenes/engine.yaml", "--update", "--yes", "--frames", "1") == 0
    edit_scene("#00ff00", CHANGE[1])
    assert "these goldens have changed since they were compared" in refused(capsys, "engine")
    assert accept("engine:0,2-3") == 0
    assert accepted()["engine"] == [0, 2, 3]


def test_another_picture_than_the_golden_that_was_compared(capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy(ENGINE / NAMES[1], ENGINE / NAMES[2])
    assert "these goldens have changed since they were compared" in refused(capsys, "engine")
    assert accept("engine:0-1,3") == 0
    report()
    assert accept("engine") == 0, "that is what was compared"
    assert accepted()["engine"] == [0, 1, 2, 3]


@pytest.mark.parametrize("lost", ["golden.json", "."])
def test_goldens_that_are_gone(lost: str, capsys: pytest.CaptureFixture[str]) -> None:
    path = ENGINE / lost
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    assert "these goldens have changed" in refused(capsys, "engine")


def test_an_input_of_the_scene_in_the_folder(capsys: pytest.CaptureFixture[str]) -> None:
    Path("mine.yaml").hardlink_to("scenes/engine.yaml")
    (ENGINE / NAMES[0]).unlink()
    (ENGINE / NAMES[0]).hardlink_to("scenes/engine.yaml")
    assert "would overwrite an input" in refused(capsys, "engine:1")


# What is refused: an edited report


def edited_picture(change: Callable[[Any], Any], *, describes: bool) -> None:
    """Change the new picture of a frame; describes: whether the report describes the changed one."""
    path = ENGINE_NEW / NAMES[1]
    pixels = change(decode_png(path.read_bytes()))
    path.write_bytes(encode_png(pixels))
    if describes:
        edit_report(lambda film: film["frames"][1]["new"].update(digest=picture_digest(pixels)))


def test_a_picture_that_the_report_does_not_describe(capsys: pytest.CaptureFixture[str]) -> None:
    edited_picture(lambda pixels: pixels ^ np.uint8(1), describes=False)
    error = refused(capsys)
    assert "report/films/1/new/frame-0001.png: this picture is not the one that the report describes" in error


def test_a_picture_of_another_size(capsys: pytest.CaptureFixture[str]) -> None:
    edited_picture(lambda pixels: np.ascontiguousarray(pixels[1:]), describes=True)
    assert "a picture of another size than the scene's" in refused(capsys)


def test_a_picture_that_changes_after_it_was_checked(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is checked again when it is written: the other frames are not accepted either."""
    before = files(ENGINE)
    change = GoldenFolder.change

    def changing(*arguments: Any) -> None:
        edited_picture(lambda pixels: pixels ^ np.uint8(1), describes=False)
        change(*arguments)

    monkeypatch.setattr(GoldenFolder, "change", changing)
    assert accept("engine") == 2
    assert files(ENGINE) == before


@pytest.mark.parametrize(
    ("edit", "error"),
    [
        (lambda film: film["frames"][1]["new"].update(file="/etc/passwd"), "not a picture of a report"),
        (lambda film: film["frames"][1]["new"].update(file="films/1/new/../../x.png"), "not a picture of a report"),
        (lambda film: film["frames"][1]["new"].update(file="films/1/new/gone.png"), "gone.png: no such file"),
        (lambda film: film["frames"][1]["new"].update(file=""), "no new picture in this report"),
        (lambda film: film["frames"][1].pop("new"), "no new picture in this report"),
        (lambda film: (film["frames"][1].pop("new"), film["frames"][1].update(status="missing")), "has this frame"),
        (lambda film: film["frames"][1].update(frame=900), "these goldens have changed since they were compared"),
        (lambda film: film["frames"][1].update(frame=2), "two frames of this report have one number"),
        (lambda film: film["frames"][1].update(frame=-1), "films.1.frames.1.frame: out of range"),
        (lambda film: film["frames"][1].update(status="splendid"), "films.1.frames.1.status: unknown value"),
        (lambda film: film.update(name="box"), "two films that fail have one name"),
        (lambda film: film.update(name="other"), "the project has no such scene"),
        (lambda film: film.update(name="../../mine"), "the project has no such scene"),
        (lambda film: film.pop("origin"), "does not say what drew the pictures"),
        (lambda film: film["origin"]["scene"]["error"].update(tolerance=3), "the scene, or its volume, changed"),
        (lambda film: film["origin"]["volume"].update(fingerprint="0" * 32), "the scene, or its volume, changed"),
        (lambda film: film["origin"].update(device="\x1b[31m"), "films.1.origin.device: not a line of text"),
        (lambda film: [frame["new"].update(psnr=1e9) for frame in film["frames"]], "psnr: out of range"),
    ],
)
def test_an_edited_report(edit: Callable[[dict[str, Any]], object], error: str, capsys) -> None:
    edit_report(edit)
    assert error in refused(capsys)


def test_frames_that_the_scene_lacks(capsys: pytest.CaptureFixture[str]) -> None:
    def edit(film: dict[str, Any]) -> None:
        film["frames"][1].update(frame=900)
        film["frames"][1].pop("old")

    edit_report(edit)
    assert "the scene has no such frame" in refused(capsys)


@pytest.mark.parametrize("content", [b"", b"[]", b"{", b'{"format": "hsplat comparison 2"}', b"\xff"])
def test_a_report_that_is_none(content: bytes, capsys: pytest.CaptureFixture[str]) -> None:
    Path("report/report.json").write_bytes(content)
    assert "report/report.json" in refused(capsys)


# What is refused: wishes


@pytest.mark.parametrize(
    ("only", "error"),
    [
        ("engin", "did you mean engine?"),
        ("nosuch", "expected: box, engine"),
        ("engine,box", "repeat --only for each film"),
        ("", "--only: an empty name"),
        ("engine:9", "these frames do not fail in this report"),
        ("engine:", "not frames of a film"),
        ("engine:2-1", "not frames of a film"),
        ("engine:-1", "not frames of a film"),
        ("engine:1-99999999999", "not frames of a film"),
        ("engine:x", "not frames of a film"),
    ],
)
def test_wishes_that_a_report_cannot_meet(only: str, error: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert error in refused(capsys, only)


def test_a_word_after_only_may_be_a_second_film(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("scenes", "--accept", "report", "--only", "engine", "box:1-2") == 2
    assert (
        "box:1-2: no such scene or folder\n  hint: if it is a film of the report, repeat --only: `--only box:1-2`"
        in (capsys.readouterr().err)
    )


def test_films_without_goldens_are_left_out_and_named(capsys: pytest.CaptureFixture[str]) -> None:
    shutil.copy("scenes/engine.yaml", "scenes/new.yaml")
    assert compare("scenes", "--report", "report") == 2
    assert main.run(["golden", "scenes", "--accept", "report"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert (
        "note: left out, as they could not be compared: new; `hsplat golden` draws the first goldens of a scene"
        in lines
    )
    assert "engine: 4 frames accepted" in lines


def test_a_film_that_passes_is_not_accepted(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("scenes/box.yaml", "--update", "--yes") == 0
    assert compare("scenes", "--report", "report") == 1
    assert "got: box: 4 frames pass: 4 the same" in refused(capsys, "box")
    assert golden("scenes/engine.yaml", "--update", "--yes") == 0
    assert compare("scenes", "--report", "report") == 0
    assert "no film of a scene fails in this report" in refused(capsys)


def test_reports_of_pictures_that_have_no_scene_are_passed_over(capsys: pytest.CaptureFixture[str]) -> None:
    """Two tests may compare pictures of one name, beside those that compare scenes."""
    pictures = ("report/films/1/old", "report/films/1/new")
    for number in range(2):
        assert compare(*pictures, "--report", f"pictures/{number}") == 1
    assert "no film of a scene fails in this report" in refused(capsys, source="pictures")
    shutil.copytree("report", "pictures/2")
    assert accept(source="pictures") == 0
    assert accepted() == {"box": [0, 1, 2, 3], "engine": [0, 1, 2, 3]}


def test_a_report_of_films_that_could_not_be_compared(capsys: pytest.CaptureFixture[str]) -> None:
    shutil.rmtree("scenes/goldens")
    assert compare("scenes", "--report", "report") == 2
    error = refused(capsys)
    assert "report: nothing can be accepted: 2 films could not be compared" in error
    assert "got: box: scenes/box.yaml: this scene has no goldens" in error


def test_other_scenes_than_those_compared(capsys: pytest.CaptureFixture[str]) -> None:
    assert "the project has no such scene" in refused(capsys, scenes="scenes/engine.yaml")
    assert accept("engine", scenes="scenes/engine.yaml") == 0


# Kills


EVENTS = ("open", "os.mkdir", "os.remove", "os.rename", "os.rmdir")


def run_killed(place: int) -> bool:
    """Accept a report in a child that is killed before its operation of this number on goldens.

    Return whether it was killed.
    """
    child = os.fork()
    if child == 0:
        numbers = count(1)

        def kill(event: str, values: tuple[object, ...]) -> None:
            is_golden = event in EVENTS and "goldens" in str(values[0])
            if is_golden and next(numbers) == place:
                os.kill(os.getpid(), signal.SIGKILL)

        code = 1
        try:
            sys.addaudithook(kill)
            code = accept()
        finally:
            os._exit(code)
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert code in (0, -signal.SIGKILL)
    return code != 0


@pytest.mark.usefixtures("heeds_interrupts")
def test_an_interrupt_tells_which_films_are_accepted(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    change = GoldenFolder.change

    def interrupted(folder: GoldenFolder, *arguments: Any) -> None:
        if folder.path.name == "engine":
            raise KeyboardInterrupt
        change(folder, *arguments)

    monkeypatch.setattr(GoldenFolder, "change", interrupted)
    assert main.run(["golden", "scenes", "--accept", "report"]) == 130
    assert capsys.readouterr().out.splitlines() == [
        "box: 4 frames accepted",
        "scenes/goldens/box: 4 goldens",
        "interrupted: the goldens of 1 of 2 films are written; the same command writes the others",
    ]
    assert accepted() == {"box": [0, 1, 2, 3], "engine": []}


@pytest.mark.slow
def test_a_kill_at_any_operation_leaves_whole_goldens(compared: Path) -> None:
    """Of each scene, the old or the new ones; accepting again ends the work."""
    old = {name: GOLDEN_RECORD.read(compared / f"scenes/goldens/{name}/golden.json") for name in ("box", "engine")}
    states, num_killed = set(), 0
    for place in count(1, 3):
        shutil.rmtree("scenes")
        shutil.copytree(compared / "scenes", "scenes")
        if not run_killed(place):
            break
        num_killed += 1
        state = []
        for name, before in old.items():
            folder = GoldenFolder(Path("scenes/goldens", name))
            record = folder.find()
            assert record is not None
            folder.unlisted(record)
            assert all(folder.holds(picture) for each in record.frames for picture in each.pictures)
            changed = [each != was for each, was in zip(record.frames, before.frames, strict=True)]
            assert all(changed) or not any(changed), "no mixture"
            state.append(changed[0])
        states.add(tuple(state))
        assert accept() == 0
        assert accepted() == {"box": [0, 1, 2, 3], "engine": [0, 1, 2, 3]}
        assert not list(Path("scenes").rglob("golden.*ing")) and not list(Path("scenes").rglob("golden.ready"))
    assert num_killed >= 17
    assert states == {(False, False), (True, False), (True, True)}


@pytest.mark.parametrize(
    ("variables", "is_refused"),
    [
        ({"GITHUB_EVENT_NAME": "push"}, True),
        ({"GITHUB_EVENT_NAME": "pull_request_target"}, True),
        ({"GITHUB_EVENT_NAME": "workflow_dispatch"}, False),
        ({"CI_PIPELINE_SOURCE": "merge_request_event"}, True),
        ({"CI_PIPELINE_SOURCE": "push"}, True),
        ({"CI_PIPELINE_SOURCE": "push", "CI_JOB_MANUAL": "true"}, False),
        ({"CI_PIPELINE_SOURCE": "web"}, False),
    ],
)
def test_a_job_that_a_change_starts_accepts_nothing(
    variables: dict[str, str], is_refused: bool, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Neither with `--yes`: no change of the code approves itself."""
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    if is_refused:
        assert "goldens do not change in a job that a change of the code starts" in refused(capsys, options=("--yes",))
    else:
        assert accept() == 0
