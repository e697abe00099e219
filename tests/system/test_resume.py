"""An unfinished film resumes with the same bytes, and a film that is up to date is not drawn again."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from machines import set_device
from resuming import (
    SCENE,
    Draws,
    arguments,
    assert_clean,
    edit_sidecar,
    interrupt_render,
    modification_times,
    output_files,
    printed_lines,
    render,
    rerender,
    sidecar,
    sidecar_of,
    uninterrupted_files,
    watch_draws,
)

from hsplat_cli import main
from renderer.system import printable


@pytest.fixture(autouse=True)
def folder(folder: Path) -> None:
    (folder / "scene.yaml").write_text(SCENE, encoding="utf-8")


@pytest.fixture(autouse=True)
def draws(monkeypatch: pytest.MonkeyPatch) -> Draws:
    return watch_draws(monkeypatch)


OUTPUTS = ["film.mp4", "clear/{frame:03}.png"]


@pytest.mark.parametrize("output", OUTPUTS)
def test_it_resumes(output: str, draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    expected = uninterrupted_files(output)
    interrupt_render(draws, output, at=1)
    interrupt_render(draws, output)
    assert printed_lines(capsys)[-2:] == [
        "3 of 5 frames are kept; the same command resumes there",
        "hsplat: interrupted",
    ]
    render(output)
    assert draws.take_numbers() == [3, 4]
    assert output_files() == expected
    assert_clean()
    captured = capsys.readouterr()
    assert captured.err.splitlines()[0] == "3 of 5 frames are already finished"
    assert "(3 drawn before)" in captured.out


@pytest.mark.parametrize(
    ("output", "options", "why"),
    [
        ("film.mp4", ["--set", "error.tolerance=0.01"], "scene.error.tolerance was 0.1"),
        ("{frame}.png", ["--set", "output.size=[36, 32]"], "scene.output.size was [32, 32]"),
    ],
)
def test_frames_of_a_changed_scene_are_drawn_again(output, options, why, draws, capsys) -> None:
    expected = uninterrupted_files(output, *options)
    interrupt_render(draws, output)
    draws.take_numbers()
    capsys.readouterr()
    render(output, *options)
    assert draws.take_numbers() == [0, 1, 2, 3, 4]
    assert printed_lines(capsys)[0] == f"3 existing frames of another film are drawn again: {why}"
    assert output_files() == expected
    assert_clean()


def test_frames_of_another_volume_are_drawn_again(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """The same one may move."""
    values = 4 * np.arange(60, dtype=np.uint8).reshape(3, 4, 5)
    np.save("scan.npy", values)
    interrupt_render(draws, "film.mp4", "--volume", "scan.npy")
    Path("scan.npy").rename("moved.npy")
    interrupt_render(draws, "film.mp4", "--volume", "moved.npy", at=4)
    assert "3 of 5 frames are already finished" in printed_lines(capsys)
    np.save("moved.npy", values[::-1])
    render("film.mp4", "--volume", "moved.npy")
    assert draws.take_numbers() == [0, 1, 2, 3, 4]
    what = "4 existing frames of another film are drawn again: volume.fingerprint was "
    assert printed_lines(capsys)[0].startswith(what)
    assert_clean()


def test_another_encoding_keeps_the_frames(draws: Draws) -> None:
    option = "output.frames_per_second=10"
    expected = uninterrupted_files("film.mp4", "--set", option)
    interrupt_render(draws, "film.mp4")
    render("film.mp4", "--set", option)
    assert draws.take_numbers() == [3, 4]
    assert output_files() == expected
    draws.take_numbers()
    render("film.mp4")
    assert draws.take_numbers() == [0, 1, 2, 3, 4], "a film in one file has no frames that could be kept"


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_other_frames_of_the_same_film(output: str, draws: Draws) -> None:
    expected = uninterrupted_files(output)
    interrupt_render(draws, output, "--frames", "1::2")
    render(output)
    assert draws.take_numbers() == [0, 2, 3, 4]
    assert output_files() == expected
    assert_clean()


def test_a_part_of_frames_that_were_kept(draws: Draws) -> None:
    """The film of the part is whole: nothing is kept any more."""
    interrupt_render(draws, "film.mp4")
    render("film.mp4", "--frames", "1:3")
    assert draws.take_numbers() == []
    assert [frame["frame"] for frame in sidecar("film.mp4.json")["frames"]] == [1, 2]
    assert_clean()


def test_stills_of_one_name(draws: Draws) -> None:
    interrupt_render(draws, "still.png", "--frames", "2", at=2)
    Path("out/still.png.unfinished").mkdir()
    Path("out/still.png.unfinished/000002.json").touch()  # as when it was killed later
    Path("out/still.png.unfinished/lock").write_text("process 1 on host", encoding="ascii")
    for number in (3, 2):
        render("still.png", "--frames", str(number))
        assert draws.take_numbers() == [number]
        assert_clean()
    assert output_files()["still.png"] == uninterrupted_files("{frame}.png", "--frames", "2")["2.png"]


@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(b"changed")])
def test_a_picture_that_is_not_what_it_was(draws: Draws, damage: Callable[[Path], Any]) -> None:
    """While the film is not whole, and when it was."""
    expected = uninterrupted_files("{frame}.png")
    interrupt_render(draws, "{frame}.png")
    damage(Path("out/1.png"))
    render("{frame}.png")
    assert draws.take_numbers() == [1, 3, 4]
    damage(Path("out/2.png"))
    render("{frame}.png")
    assert draws.take_numbers() == [2]
    assert output_files() == expected
    assert_clean()


@pytest.mark.parametrize("output", OUTPUTS)
def test_a_film_that_is_up_to_date(output: str, draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    render(output)
    before = modification_times()
    draws.take_numbers()
    capsys.readouterr()
    render(output)
    assert modification_times() == before
    assert draws.take_numbers() == []
    captured = capsys.readouterr()
    assert (captured.out, captured.err) == ("", f"out/{output} is up to date; --force draws it again\n")
    render(output, "--quiet")
    assert capsys.readouterr().err == ""
    assert_clean()


@pytest.mark.parametrize("options", [[], ["--progressive"]])
def test_frames_of_another_film_that_was_stopped_stay(options: list[str], draws: Draws) -> None:
    """Where the film is up to date, or passes are drawn, which keep no frames."""
    other = ("--set", "error.tolerance=2")
    if not options:
        render("film.mp4")
    interrupt_render(draws, "film.mp4", *other)
    render("film.mp4", *options)
    draws.take_numbers()
    render("film.mp4", *other)
    assert draws.take_numbers() == [3, 4]
    assert_clean()


def test_frames_of_a_film_that_is_there_go(draws: Draws) -> None:
    """As where it was killed when it was whole."""
    render("film.mp4")
    interrupt_render(draws, "film.mp4", "--force")
    assert Path("out/film.mp4.unfinished").exists()
    render("film.mp4")
    assert draws.take_numbers() == []
    assert_clean()


@pytest.mark.parametrize("output", OUTPUTS)
def test_force(output: str, draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    expected = uninterrupted_files(output)
    render(output)
    draws.take_numbers()
    render(output, "--force")
    assert draws.take_numbers() == [0, 1, 2, 3, 4]
    interrupt_render(draws, output, "--force")
    once = "" if output.endswith(".png") else f", once out/{output} is removed,"
    left = f"3 of 5 frames are kept; the same command without --force{once} resumes there"
    assert printed_lines(capsys)[-2] == left
    render(output, "--force")
    assert draws.take_numbers() == [0, 1, 2, 3, 4]
    if once:
        interrupt_render(draws, output, "--force")
        Path(f"out/{output}").unlink()
        interrupt_render(draws, output, "--force")
        assert printed_lines(capsys)[-2] == left.replace(once, "")
        render(output)
        assert draws.take_numbers() == [3, 4]
    assert output_files() == expected
    assert_clean()


EDITS: list[Callable[[dict[str, Any]], Any]] = [
    lambda data: data.clear(),
    lambda data: data.update(unknown=1),
    lambda data: data.update(fingerprint=[]),
    lambda data: data["frames"][0].update(frame="../../x"),
    lambda data: data["frames"][0]["seconds"].update(draw=float("nan")),
    lambda data: data["frames"][0].update(tolerance=10**400),
    lambda data: data["fingerprint"].update(depends_on={"deep": json.loads("[" * 500 + "]" * 500)}),
]
GARBAGE = [b"\0\xff", b"[" * 100_000, b"7", b"9" * 5000]


@pytest.mark.slow
@pytest.mark.parametrize(("output", "edits"), [("{frame}.png", EDITS), ("film.mp4", [EDITS[0], EDITS[-1], *GARBAGE])])
def test_a_sidecar_that_somebody_changed(output: str, edits: list[Any], draws: Draws) -> None:
    render(output)
    expected, path = output_files(), Path("out", sidecar_of(output))
    content = path.read_bytes()
    for edit in edits:
        path.write_bytes(edit if isinstance(edit, bytes) else content)
        if not isinstance(edit, bytes):
            edit_sidecar(path.name, edit)
        Path("out/film.mp4" if output == "film.mp4" else "out/3.png").unlink()
        draws.take_numbers()
        render(output)
        assert 3 in draws.take_numbers()
        assert output_files() == expected
    assert_clean()


def test_frames_of_different_devices(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """As when a film of one cluster goes on on another: it is told once, as text that does nothing to a terminal."""
    interrupt_render(draws, "film.mp4")
    edit_sidecar("film.mp4.unfinished/000001.json", lambda data: data["record"].update(device="Other GL\x1b[31m"))
    capsys.readouterr()
    render("film.mp4")
    told = sidecar("film.mp4.json")
    here = told["device"].removeprefix("Other GL\x1b[31m and ")
    note = f"bytes may differ from frame to frame, drawn by different devices: Other GL\x1b[31m and {here}"
    assert told["notes"] == [note]
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:] == [f"note: {printable(note)}", "how it was made: out/film.mp4.json"]


def test_frames_on_a_budget_of_time_are_kept(draws: Draws) -> None:
    output = "film.mp4"
    given = ("--set", "error={seconds: 0.05, probes: 16}", "--best-effort")
    interrupt_render(draws, output, *given)
    render(output, *given)
    assert draws.take_numbers() == [3, 4]
    assert_clean()


GOALS = ["{splats: {0: 1, 4: 100}, probes: 16}", "{psnr: 25, probes: 16}", "{seconds: 60, probes: 16}"]


@pytest.mark.parametrize(
    ("goal", "output"), [(GOALS[0], "{frame}.png"), (GOALS[1], "film.mp4"), (GOALS[2], "{frame}.png")]
)
def test_a_film_and_its_sidecar_meet_the_same_goal(goal: str, output: str, draws: Draws, capsys) -> None:
    """A film is up to date for the scene and for the sidecar; missing frames are drawn as before."""
    given, name = ("--set", f"error={goal}"), sidecar_of(output)
    render(output, *given)
    expected, up_to_date = output_files(), [f"out/{output} is up to date; --force draws it again"]
    for _ in range(2):
        draws.take_numbers()
        printed_lines(capsys)
        for command in (lambda: render(output, *given), lambda: rerender(name)):
            before = modification_times()
            command()
            assert printed_lines(capsys) == up_to_date
            assert modification_times() == before
        assert draws.take_numbers() == []
        Path("out/film.mp4" if output == "film.mp4" else "out/3.png").unlink()
        rerender(name)
        assert draws.take_numbers() == ([0, 1, 2, 3, 4] if output == "film.mp4" else [3])
        assert output_files() == expected
    rerender(name, "--output", "out/other.gif")
    printed_lines(capsys)
    render("other.gif", *given)
    assert printed_lines(capsys) == ["out/other.gif is up to date; --force draws it again"]
    assert_clean()


def test_a_part_of_a_film_whose_goal_was_one_of_the_whole(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """Whether the part alone meets it is unknown: it counts as requested at the tolerances of the whole."""
    given, part = ("--set", "error={psnr: 25, probes: 16}"), ("--frames", "1:3", "--output", "out/part/{frame}.png")
    render("{frame}.png", *given)
    rerender("frames.json", *part)
    told = sidecar("part/frames.1-2.json")["schedule"]
    assert [*told["requested"]] == ["tolerance"]
    assert told["met"] and "measured" not in told
    draws.take_numbers()
    printed_lines(capsys)
    rerender("part/frames.1-2.json")
    assert printed_lines(capsys) == ["out/part/{frame}.png is up to date; --force draws it again"]
    assert main.run(["render", "scene.yaml", *given, *part]) == 0
    what = "out/part/{frame}.png is another film and is drawn again"
    assert printed_lines(capsys)[0].startswith(f"{what}: scene.error.psnr was nothing; scene.error.tolerance was ")
    assert draws.take_numbers() == [1, 2]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("what", "goal"), [("version", GOALS[0]), ("tolerance", GOALS[1]), ("sources", GOALS[0]), ("driver", GOALS[2])]
)
def test_a_goal_counts_as_unmeasured_when_something_changed(what: str, goal: str, monkeypatch, capsys) -> None:
    """A film of another version, or at another tolerance, counts as requested at its tolerances."""
    given = ("--set", f"error={goal}")
    render("film.mp4", *given)
    before = sidecar("film.mp4.json")
    if what == "driver":
        set_device(monkeypatch, "another")
    elif what == "version":
        monkeypatch.setattr("renderer.record.up_to_date.package_versions", lambda: {"numpy": "9.0"})
    elif what == "sources":
        monkeypatch.setattr("renderer.record.up_to_date.sources_digest", lambda: "0")
    else:
        edit_sidecar("film.mp4.json", lambda data: data["scene"]["error"].update(tolerance=0.7))
    Path("out/film.mp4").unlink()
    rerender("film.mp4.json")
    after = sidecar("film.mp4.json")
    assert after["schedule"]["requested"] == {"tolerance": after["scene"]["error"]["tolerance"]}
    assert (after["scene"]["error"] == before["scene"]["error"]) == (what != "tolerance")
    assert after["schedule"]["met"] and after["schedule"]["reproducible"]
    assert "measured" not in after["schedule"]
    printed_lines(capsys)
    render("film.mp4", *given)
    assert printed_lines(capsys)[0].startswith("out/film.mp4 is another film and is drawn again: scene.error.")


def test_frames_that_were_kept_for_the_same_goal(draws: Draws) -> None:
    """Frames of the scene are kept for the sidecar, and the other way round, if they are as exact."""
    given = ("--set", "error={splats: {0: 1, 4: 100}, probes: 16}")
    render("film.mp4", *given)
    expected = output_files()
    Path("out/film.mp4").unlink()
    interrupt_render(draws, "film.mp4", *given)
    rerender("film.mp4.json")
    assert draws.take_numbers() == [3, 4]
    Path("out/film.mp4").unlink()
    draws.stop_at = 3
    rerender("film.mp4.json", code=130)
    draws.stop_at = None
    draws.take_numbers()
    render("film.mp4", *given)
    assert draws.take_numbers() == [3, 4]
    assert output_files() == expected


def test_a_film_that_is_partly_replaced_by_another(draws: Draws) -> None:
    """Frames of the two films are told apart, and either can be finished."""
    other = ("--set", "error.tolerance=2")
    expected = uninterrupted_files("{frame}.png")
    render("{frame}.png")
    interrupt_render(draws, "{frame}.png", *other)
    assert main.run(["assemble", "out", "--output", "film.mp4", "--quiet"]) == 2
    rerender("frames.json")
    assert draws.take_numbers() == [0, 1, 2]
    assert output_files() == expected
    interrupt_render(draws, "{frame}.png", *other, "--force")
    render("{frame}.png", *other)
    assert draws.take_numbers() == [3, 4]
    assert main.run(["assemble", "out", "--output", "film.mp4", "--quiet"]) == 0


def test_frames_that_were_kept_but_drawn_at_other_tolerances(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """On a time budget, the sidecar records the tolerances of the film."""
    given = ("--set", "error={seconds: 60, probes: 16}")
    render("film.mp4", *given)
    expected = output_files()
    Path("out/film.mp4").unlink()
    interrupt_render(draws, "film.mp4", *given)
    for number in (1, 2):
        path = f"film.mp4.unfinished/00000{number}.json"
        edit_sidecar(path, lambda data: data["record"].update(tolerance=0.7))
    printed_lines(capsys)
    rerender("film.mp4.json")
    line = "2 existing frames drawn at other tolerances are drawn again"
    printed = printed_lines(capsys)
    assert printed[printed.index(line) - 1] == "1 of 5 frames is already finished"
    assert draws.take_numbers() == [1, 2, 3, 4]
    assert output_files() == expected
    Path("out/film.mp4").unlink()
    draws.stop_at = 1
    rerender("film.mp4.json", code=130)
    draws.stop_at = None
    printed_lines(capsys)
    render("film.mp4", *given)
    assert "1 existing frame not drawn on a time budget is drawn again" in printed_lines(capsys)


def of_another(what: str) -> list[str]:
    return [f"out/film.mp4 is another film and is drawn again: {what}"]


def test_why_where_a_sidecar_was_changed(capsys: pytest.CaptureFixture[str]) -> None:
    render("film.mp4")
    edit_sidecar("film.mp4.json", lambda data: data["scene"]["error"].update(tolerance=0.7))
    Path("out/film.mp4").unlink()
    printed_lines(capsys)
    rerender("film.mp4.json")
    missing = "out/film.mp4 does not exist, and its sidecar describes another film"
    assert printed_lines(capsys)[0] == f"{missing}: scene.error.tolerance was 0.1"
    edit_sidecar("film.mp4.json", lambda data: data["fingerprint"].update(frames_digest="0" * 32))
    render("film.mp4", "--set", "error.tolerance=0.7")
    assert printed_lines(capsys)[:1] == of_another("the record of its scene was changed")
    edit_sidecar("film.mp4.json", lambda data: data["fingerprint"].update(frames_digest="0" * 32, depends_on={}))
    render("film.mp4", "--set", "error.tolerance=0.7")
    assert printed_lines(capsys)[:1] == of_another("its scene is not recorded")
    edit_sidecar("film.mp4.json", lambda data: data["schedule"].update(met=False))
    render("film.mp4", "--set", "error.tolerance=0.7")
    assert printed_lines(capsys)[:1] == ["out/film.mp4 is less than what was requested and is drawn again"]


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_a_progressive_film_and_an_interrupted_one(output: str, draws: Draws) -> None:
    """Each makes the same film after the other was interrupted."""
    given = ("--set", "error.tolerance=0")
    expected = uninterrupted_files(output, *given)
    interrupt_render(draws, output, *given)
    render(output, *given, "--progressive")
    assert output_files() == expected
    assert_clean()
    draws.stop_at = 3
    assert main.run(arguments(output, *given, "--progressive", "--force")) == 130
    draws.stop_at = None
    assert not any("partial" in path.name for path in Path().rglob("*"))
    render(output, *given)
    assert output_files() == expected
    assert_clean()
