"""`hsplat compare` draws the scenes of a project again, and fails wherever a golden is not matched, or not there."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from golden_projects import (
    CHANGE,
    ENGINE,
    NAMES,
    SCENE,
    compare,
    edit_scene,
    files,
    golden,
    golden_json,
    report,
    statuses,
)
from small_scene import edit_sidecar

from hsplat_cli import main
from renderer.film import decode_png, encode_png

pytestmark = pytest.mark.usefixtures("project")


def test_an_unchanged_project_passes(capsys: pytest.CaptureFixture[str]) -> None:
    before = files()
    assert main.run(["compare", "scenes"]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "2 films: 2 pass"
    assert files() == before
    assert compare() == 0
    assert capsys.readouterr() == ("", "")


def test_a_change_is_reported_at_its_line(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    edit_scene()
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_STEP_SUMMARY", "summary.md")
    Path("summary.md").write_text("before\n", "utf-8")
    code, films = report()
    out = capsys.readouterr().out.splitlines()
    assert code == 1
    assert statuses(films["engine"]) == ["different"] * 4 and statuses(films["box"]) == ["same"] * 4
    (change,) = films["engine"]["changes"]
    assert change == {"key": "transfer_function.points.2.color", "was": "#ffffff", "now": "#ff0000", "line": 6}
    commands = [line for line in out if line.startswith("::error ")]
    assert [line.split(",title")[0] for line in commands] == ["::error file=scenes/engine.yaml,line=6"]
    assert out[0].startswith("::stop-commands::") and out.index(f"::{out[0].split('::')[2]}::") < out.index(commands[0])
    assert Path("summary.md").read_text("utf-8").startswith("before\n### 2 films: 1 fail, 1 pass\n")
    assert {path.name for path in Path("report").iterdir()} == {
        "index.html", "report.json", "junit.xml", "code-quality.json", "summary.md", "films"
    }  # fmt: skip
    assert ElementTree.parse("report/junit.xml").getroot().tag == "testsuites"
    assert json.loads(Path("report/code-quality.json").read_bytes())[0]["location"]["lines"] == {"begin": 6}
    (folder,) = Path("report/films").iterdir()  # films that pass have no pictures
    assert sorted(files(folder)) == sorted(str(folder / side / name) for side in ("old", "new") for name in NAMES)


def test_the_new_pictures_are_those_that_render_draws() -> None:
    edit_scene()
    _, films = report()
    assert main.run(["render", "scenes/engine.yaml", "--output", "drawn/{frame:04}.png", "--quiet"]) == 0
    for number, frame in enumerate(films["engine"]["frames"]):
        assert Path("report", frame["new"]["file"]).read_bytes() == Path(f"drawn/{number:04}.png").read_bytes()
        assert Path("report", frame["old"]["file"]).read_bytes() == (ENGINE / NAMES[number]).read_bytes()


def test_the_nearer_picture_is_named_where_the_scene_is_the_same(capsys: pytest.CaptureFixture[str]) -> None:
    """The goldens are those of another version, which drew the frames in a wrong order."""
    shutil.copytree(ENGINE, "right")
    for number, name in enumerate(NAMES):
        shutil.copy(Path("right", NAMES[number - 1]), ENGINE / name)

    def shift(data: dict[str, object]) -> None:
        digests = [frame["pictures"][0]["digest"] for frame in data["frames"]]  # type: ignore[attr-defined]
        for number, frame in enumerate(data["frames"]):  # type: ignore[arg-type, var-annotated]
            frame["pictures"][0]["digest"] = digests[number - 1]

    edit_sidecar(ENGINE / "golden.json", shift)
    _, films = report()
    out = capsys.readouterr().out
    measured = [frame for frame in films["engine"]["frames"] if "nearer" in frame]
    assert len(measured) == 3, "the worst"
    for frame in measured:
        assert frame["nearer"]["differs"] and frame["nearer"]["new"] > frame["nearer"]["old"] + 5
        assert f"{frame['name']}: nearer to the exact picture" in out
    edit_scene("tolerance: 0.1", "tolerance: 0.2")
    _, films = report()
    assert any("nearer" in frame for frame in films["engine"]["frames"]), "the exact picture is the same"
    edit_scene()
    _, films = report()
    assert set(statuses(films["engine"])) == {"different"}
    assert not any("nearer" in frame for frame in films["engine"]["frames"]), "goldens show another scene"


@pytest.mark.parametrize(("limit", "code"), [("same bytes", 1), ("60", 1), ("20 dB", 0)])
def test_the_limit_decides(limit: str, code: int) -> None:
    edit_scene("tolerance: 0.1", "tolerance: 0.2")
    assert compare("scenes/engine.yaml", "--limit", limit) == code


@pytest.mark.slow
def test_stated_accuracies_allow_another_tolerance_and_no_other_look() -> None:
    """Both state theirs by exact rays through most of the pixels."""
    edit_scene("probes: 16", "probes: 900")
    edit_scene("tolerance: 0.1", "tolerance: 0.4")
    assert golden("scenes/engine.yaml", "--update", "--yes") == 0
    edit_scene("tolerance: 0.4", "tolerance: 0.1")
    assert compare("scenes/engine.yaml") == 1
    assert compare("scenes/engine.yaml", "--limit", "stated accuracy") == 0
    edit_scene()
    assert compare("scenes/engine.yaml", "--limit", "stated accuracy") == 1


# Failures that are easily passed in silence


def test_a_missing_picture_fails() -> None:
    (ENGINE / NAMES[1]).unlink()
    code, films = report()
    assert (code, statuses(films["engine"])) == (1, ["same", "missing", "same", "same"])


def test_fewer_frames_fail_until_it_is_accepted_that_they_are_gone(capsys: pytest.CaptureFixture[str]) -> None:
    """The report shows the goldens that the film does not have any more."""
    edit_scene("frames: 4", "frames: 3")
    code, films = report()
    assert code == 1
    (*_, frame) = films["engine"]["frames"]
    assert (frame["status"], frame["why"]) == ("missing", "the film does not have this frame any more")
    assert Path("report", frame["old"]["file"]).read_bytes() == (ENGINE / NAMES[3]).read_bytes()
    assert main.run(["golden", "scenes", "--accept", "report"]) == 0

    assert "engine: 3 frames accepted, 1 golden removed" in capsys.readouterr().out.splitlines()
    assert not (ENGINE / NAMES[3]).exists()
    assert compare() == 0
    assert golden("scenes", "--update") == 0, "an update draws the same"


def test_a_removed_frame_is_accepted_alone() -> None:
    edit_scene("frames: 4", "frames: 3")
    report()
    assert golden("scenes", "--accept", "report", "--only", "engine:3") == 0
    assert [each["frame"] for each in golden_json()["frames"]] == [0, 1, 2]
    edit_scene("frames: 3", "frames: 4")
    code, films = report()
    assert (code, statuses(films["engine"])[3]) == (1, "new"), "golden.json asks for all frames"


def test_the_last_golden_is_not_removed_by_accepting(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("scenes/engine.yaml", "--update", "--yes", "--frames", "3", "--prune") == 0
    Path("scenes/golden.yaml").write_text("scenes: [engine.yaml]\nframes: 0\n")
    edit_scene("frames: 4", "frames: 3")
    shutil.rmtree("scenes/goldens/box")
    code, films = report()
    assert (code, statuses(films["engine"])) == (1, ["new", "missing"])
    assert golden("scenes", "--accept", "report", "--only", "engine:3") == 2
    assert "no golden of this film would be left" in capsys.readouterr().err
    assert golden("scenes", "--accept", "report") == 0
    assert [each["frame"] for each in golden_json()["frames"]] == [0]


def test_more_frames_fail() -> None:
    edit_scene("frames: 4", "frames: 6")
    code, films = report()
    assert (code, statuses(films["engine"])) == (1, [*["different"] * 4, "new", "new"])
    assert golden("scenes", "--accept", "report") == 0
    assert compare() == 0
    edit_scene("frames: 6", "frames: 7")
    assert golden("scenes/engine.yaml", "--update", "--yes") == 0
    assert [each["frame"] for each in golden_json()["frames"]] == [*range(7)]
    assert compare("scenes", "--frames", "::2") == 0


def test_another_size_fails() -> None:
    edit_scene("size: [32, 32]", "size: [32, 16]")
    code, films = report()
    assert (code, statuses(films["engine"])) == (1, ["other size"] * 4)


def test_a_lost_alpha_fails() -> None:
    edit_scene("size: [32, 32]", "size: [32, 32]\n  background: transparent")
    code, films = report("--limit", "1")
    assert (code, statuses(films["engine"])) == (1, ["other channels"] * 4)


def test_a_golden_that_was_edited_fails() -> None:
    """It is not the picture that golden.json describes, even if it is the one that is drawn."""
    edit_scene()
    report()
    shutil.copy("report/films/1/new/frame-0002.png", ENGINE)
    _, films = report()
    frame = films["engine"]["frames"][2]
    assert frame["status"] == "different"
    assert frame["why"].startswith("frame-0002.png is not the picture that golden.json describes")


def test_one_step_in_one_pixel_fails() -> None:
    path = ENGINE / NAMES[3]
    pixels = decode_png(path.read_bytes()).copy()
    pixels[5, 5, 1] ^= 1
    path.write_bytes(encode_png(pixels))
    assert compare() == 1


@pytest.mark.parametrize("spoil", ["no goldens", "no record", "damaged", "no scene", "a bad scene"])
def test_what_cannot_be_compared_has_the_code_2(spoil: str, capsys: pytest.CaptureFixture[str]) -> None:
    error = {
        "no goldens": "this scene has no goldens",
        "no record": "golden.json does not list all goldens in this folder",
        "damaged": "restore it by `git checkout -- scenes/goldens/engine/frame-0002.png`, or draw it again by `hsplat",
        "no scene": "scenes/goldens/engine: no scene has these goldens; hint: restore the scene; if it was renamed, "
        "`git mv scenes/goldens/engine scenes/goldens/NEW_NAME`; or remove the folder: "
        "`git rm -r scenes/goldens/engine`, or `hsplat golden scenes --update --prune`",
        "a bad scene": "camera.path.frames",
    }[spoil]
    if spoil == "no goldens":
        shutil.rmtree(ENGINE)
    elif spoil == "no record":
        (ENGINE / "golden.json").unlink()
    elif spoil == "damaged":
        (ENGINE / NAMES[2]).write_bytes((ENGINE / NAMES[2]).read_bytes()[:-20])
    elif spoil == "no scene":
        Path("scenes/engine.yaml").unlink()
    else:
        edit_scene("frames: 4", "frames: none")
    code, films = report()
    assert code == 2
    assert [name for name, film in films.items() if "error" not in film] == ["box"], "the rest is compared"
    assert error in capsys.readouterr().out
    root = ElementTree.parse("report/junit.xml").getroot()
    assert [suite.get("errors") for suite in root] == ["1", "0"]
    (issue,) = json.loads(Path("report/code-quality.json").read_bytes())
    place = "scenes/goldens/engine/golden.json" if spoil == "no scene" else "scenes/engine.yaml"
    assert issue["location"]["path"] == place
    assert [path.name for path in Path("report").glob("films/*")] == [], "no picture is left"


def test_goldens_of_a_renamed_scene_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    Path("scenes/engine.yaml").rename("scenes/motor.yaml")
    assert compare() == 2
    move = "git mv scenes/goldens/engine scenes/goldens/motor"
    text = capsys.readouterr().out
    assert "scenes/motor.yaml: this scene has no goldens; expected: scenes/goldens/motor; hint: if " in text
    assert f"`{move}`" in text
    before = files()
    for options in ((), ("--update", "--yes")):
        assert golden("scenes", *options) == 2
        error = capsys.readouterr().err
        assert "scenes/motor.yaml: goldens in another place may be this scene's" in error
        assert f"hint: `{move}` keeps them, `git rm -r scenes/goldens/engine` removes them; " in error
    assert files() == before
    ENGINE.rename("scenes/goldens/motor")
    assert compare() == 0
    Path("scenes/goldens/motor").rename(ENGINE)
    assert golden("scenes", "--update", "--prune", "--yes") == 0, "they are removed, and others drawn"
    assert compare() == 0


def test_goldens_in_the_place_without_a_golden_yaml_are_named(capsys: pytest.CaptureFixture[str]) -> None:
    """A second set, which nobody has looked at, would be drawn otherwise; nor does `--prune` draw one."""
    Path("golden.yaml").write_text("scenes: [scenes/*.yaml]\n", "utf-8")
    assert main.run(["compare"]) == 2
    moves = [f"git mv scenes/goldens/{name} goldens/scenes/{name}" for name in ("box", "engine")]
    text = capsys.readouterr().out
    for move in moves:
        assert f"`mkdir -p goldens/scenes && {move}`" in text
    assert golden() == golden("--update", "--prune", "--yes") == 2
    assert f"got: {Path('scenes/goldens/box')}" in capsys.readouterr().err
    Path("goldens").mkdir()
    Path("scenes/goldens").rename("goldens/scenes")
    assert main.run(["compare", "--quiet"]) == 0
    Path("golden.yaml").unlink()
    assert golden("scenes") == 2, "the other way round"
    assert f"got: {Path('goldens/scenes/box')}" in capsys.readouterr().err
    assert golden("scenes", "--goldens", "second") == 0, "an option says so"


def test_an_error_of_the_command_leaves_no_report() -> None:
    """Nor the report of an earlier comparison, which passed."""
    assert report()[0] == 0
    assert compare("nowhere", "--report", "report") == 2
    assert not Path("report").exists()


# Options


def test_options_change_all_scenes() -> None:
    np.save("scan.npy", np.arange(2048, dtype=np.uint8).reshape(8, 16, 16))
    code, films = report("scenes", "--volume", "scan.npy", "--set", "error.tolerance=0.2", "--frames", "1:3")
    assert code == 1
    for film in films.values():
        assert [frame["frame"] for frame in film["frames"]] == [1, 2]
        keys = {change["key"] for change in film["changes"]}
        assert {"volume.fingerprint", "error.tolerance"} <= keys
        assert not any("nearer" in frame for frame in film["frames"]), "goldens show another volume"


def test_another_device_is_named_and_no_failure() -> None:
    def other_device(data: dict[str, object]) -> None:
        data["origins"][0].update(device="another driver", versions={"numpy": "1"})  # type: ignore[index]

    edit_sidecar(ENGINE / "golden.json", other_device)
    code, films = report()
    changes = {change["key"]: change["was"] for change in films["engine"]["changes"]}
    assert code == 0
    assert changes == {"device": "another driver", "version of numpy": "1"}


def test_rules_of_a_project_file() -> None:
    Path("golden.yaml").write_text(
        "scenes: [scenes/*.yaml]\ngoldens: scenes/goldens\nlimit: 20\neach: {scenes/box.yaml: {limit: same bytes}}\n"
    )
    Path("scenes/goldens").rename("moved")
    Path("scenes/goldens").mkdir()
    Path("moved").rename("scenes/goldens/scenes")
    for name in ("engine", "box"):
        edit_scene("tolerance: 0.1", "tolerance: 0.2", name)
    code, films = report(".")
    assert code == 1
    assert {name: film["limit"] for name, film in films.items()} == {
        "scenes/box": "same bytes",
        "scenes/engine": "20 dB",
    }
    assert set(statuses(films["scenes/engine"])) == {"close"}
    assert compare("scenes/engine.yaml") == 0


@pytest.mark.slow
def test_frames_of_a_project_file_without_goldens_are_drawn_and_can_be_accepted() -> None:
    assert golden("scenes", "--update", "--yes", "--frames", "::2", "--prune") == 0
    Path("golden.yaml").write_text("scenes: [scenes/*.yaml]\ngoldens: scenes/goldens\nframes: '::1'\n")
    Path("scenes/goldens").rename("moved")
    Path("scenes/goldens").mkdir()
    Path("moved").rename("scenes/goldens/scenes")
    code, films = report(".")
    assert code == 1
    for film in films.values():
        assert statuses(film) == ["same", "new"] * 2
        assert [frame["name"] for frame in film["frames"]] == NAMES
        assert all(Path("report", frame["new"]["file"]).is_file() for frame in film["frames"][1::2])
    assert golden(".", "--accept", "report", "--only", "scenes/engine:1") == 0
    assert statuses(report(".")[1]["scenes/engine"]) == ["same", "same", "same", "new"]
    assert compare(".", "--frames", "::2") == 0, "an option selects goldens"
    assert golden(".", "--update", "--yes") == 0
    assert compare(".") == 0


def test_mistakes_of_a_scene_are_reported_at_their_lines(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    edit_scene("elevation: 20", "elevatio: 20")
    edit_scene("tolerance: 0.1", "tolerance: -1")
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    monkeypatch.setenv("GITHUB_WORKSPACE", str(Path.cwd()))
    monkeypatch.chdir("scenes")
    assert compare(".") == 2
    out = capsys.readouterr().out
    assert [line for line in out.splitlines() if line.startswith("::error ")] == [
        "::error file=scenes/engine.yaml,line=8,title=golden film engine::camera.path.elevatio: unknown key; "
        "expected: type, frames, start, elevation, axis or seconds; hint: did you mean elevation?",
        "::error file=scenes/engine.yaml,line=9,title=golden film engine::error.tolerance: out of range; got: -1; "
        "expected: a number of at least 0",
    ]
    assert "^" not in out, "the one line of a film has no excerpt of the file"


def test_a_sidecar_is_a_scene() -> None:
    """It has the tolerances of a time budget, which a scene with one has not: its frames cannot be golden."""
    text = SCENE.replace("tolerance: 0.1, probes: 16", "seconds: 5")
    Path("timed.yaml").write_text(text, "utf-8")
    assert golden("timed.yaml") == 2
    assert main.run(["render", "timed.yaml", "--quiet"]) == 0
    assert golden("film.mp4.json") == 0
    assert Path("goldens/film.mp4/golden.json").exists()
    code, films = report("film.mp4.json")
    assert (code, statuses(films["film.mp4"])) == (0, ["same"] * 4)


@pytest.mark.slow
def test_goldens_of_several_machines_and_one_that_nothing_matches_any_more(
    capsys: pytest.CaptureFixture[str],
) -> None:
    edit_scene(*CHANGE)
    assert golden("scenes/engine.yaml", "--also") == 0
    edit_scene(CHANGE[1], "#00ff00")
    assert golden("scenes/engine.yaml", "--also") == 0
    assert len(golden_json()["origins"]) == 3
    code, films = report()
    assert code == 0
    assert [frame["golden"] for frame in films["engine"]["frames"]] == [3] * 4
    names = "frame-0000.png, frame-0000-2.png, frame-0001.png and 5 more"
    assert f"no picture matches these goldens any more: {names}" in films["engine"]["notes"]
    edit_scene("#00ff00", "#0000ff")
    code, films = report()
    assert (code, statuses(films["engine"])) == (1, ["different"] * 4)
    assert not any("no picture matches" in note for note in films["engine"].get("notes", []))


# Reports


@pytest.mark.parametrize("place", ["mine", "mine/file", "link", "scenes", ".", "..", "scenes/goldens/engine"])
def test_a_report_replaces_nothing_else(place: str) -> None:
    Path("mine").mkdir()
    Path("mine/file").touch()
    Path("mine/report.json").write_text('{"format": "hsplat comparison 1"}')
    Path("link").symlink_to("mine")
    before = files()
    assert compare("scenes", "--report", place) == 2
    assert files() == before


def test_a_report_does_not_replace_what_is_compared() -> None:
    edit_scene()
    report()
    before = files()
    assert compare("report/films/1/old", "report/films/1/new", "--report", "report") == 2
    shutil.copytree("scenes/goldens", "report/films/goldens")
    assert compare("scenes", "--goldens", "report/films/goldens", "--report", "report") == 2
    shutil.rmtree("report/films/goldens")
    assert files() == before
    assert compare("scenes", "--report", "report") == 1


def test_an_empty_folder_becomes_a_report() -> None:
    Path("report").mkdir()
    assert report()[0] == 0


def test_equal_comparisons_have_equal_reports() -> None:
    edit_scene()
    report()
    before = files(Path("report"))
    report()
    assert files(Path("report")) == before
