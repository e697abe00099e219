"""Films rendered from their sidecars, and goals: which frames are kept, and which goals count as met."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from machines import set_renderer_name
from resuming import (
    NUM_FRAMES,
    Draws,
    assert_clean,
    edit_sidecar,
    enter_folder,
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
from hsplat_cli.films import fingerprint


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    enter_folder(tmp_path, monkeypatch)


@pytest.fixture(autouse=True)
def draws(monkeypatch: pytest.MonkeyPatch) -> Draws:
    return watch_draws(monkeypatch)


GOALS = ["{splats: {0: 1, 4: 100}}", "{psnr: 25}", "{seconds: 60}"]


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
@pytest.mark.parametrize("goal", GOALS)
def test_a_film_and_its_sidecar_meet_the_same_goal(
    goal: str, output: str, draws: Draws, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the scene or the sidecar, whichever is first; and what is missing is drawn as it was."""
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
    assert_clean()


@pytest.mark.parametrize("goal", GOALS)
def test_a_film_rendered_from_a_sidecar_elsewhere_is_up_to_date(
    goal: str, draws: Draws, capsys: pytest.CaptureFixture[str]
) -> None:
    given = ("--set", f"error={goal}")
    render("film.mp4", *given)
    rerender("film.mp4.json", "--output", "out/other.gif")
    draws.take_numbers()
    printed_lines(capsys)
    render("other.gif", *given)
    assert printed_lines(capsys) == ["out/other.gif is up to date; --force draws it again"]
    assert draws.take_numbers() == []


@pytest.mark.parametrize("goal", ["{psnr: 25}", "{seconds: 60}"])
def test_a_part_of_a_film_whose_goal_was_one_of_the_whole(
    goal: str, draws: Draws, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whether the part alone meets it is not known: it was asked for at the tolerances of the whole."""
    given, part = ("--set", f"error={goal}"), ("--frames", "1:3", "--output", "out/part/{frame}.png")
    render("{frame}.png", *given)
    rerender("frames.json", *part)
    told = sidecar("part/frames.1-2.json")["schedule"]
    assert [*told["asked"]] == ["tolerance"]
    assert told["met"] and "measured" not in told
    draws.take_numbers()
    printed_lines(capsys)
    rerender("part/frames.1-2.json")
    assert printed_lines(capsys) == ["out/part/{frame}.png is up to date; --force draws it again"]
    assert main.run(["render", "scene.yaml", *given, *part]) == 0
    name = goal[1:].partition(":")[0]
    what = "out/part/{frame}.png is another film and is drawn again"
    assert printed_lines(capsys)[0].startswith(f"{what}: scene.error.{name} was nothing; scene.error.tolerance was ")
    assert draws.take_numbers() == [1, 2]


@pytest.mark.parametrize(
    ("what", "goal"), [("version", GOALS[0]), ("tolerance", GOALS[1]), ("sources", GOALS[1]), ("driver", GOALS[2])]
)
def test_a_goal_counts_as_unmeasured_when_something_changed(
    what: str, goal: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where another program makes a film again, or at another tolerance, it counts as asked for at its tolerances."""
    given = ("--set", f"error={goal}")
    render("film.mp4", *given)
    before = sidecar("film.mp4.json")
    if what == "driver":
        set_renderer_name(monkeypatch, "another")
    elif what == "version":
        monkeypatch.setattr(fingerprint, "package_versions", lambda: {"numpy": "9.0"})
    elif what == "sources":
        monkeypatch.setattr(fingerprint, "sources_digest", lambda: "0")
    else:
        edit_sidecar("film.mp4.json", lambda data: data["scene"]["error"].update(tolerance=0.7))
    Path("out/film.mp4").unlink()
    rerender("film.mp4.json")
    after = sidecar("film.mp4.json")
    assert after["schedule"]["asked"] == {"tolerance": after["scene"]["error"]["tolerance"]}
    assert (after["scene"]["error"] == before["scene"]["error"]) == (what != "tolerance")
    assert after["schedule"]["met"] and after["schedule"]["reproducible"]
    assert "measured" not in after["schedule"]
    printed_lines(capsys)
    render("film.mp4", *given)
    assert printed_lines(capsys)[0].startswith("out/film.mp4 is another film and is drawn again: scene.error.")


def test_frames_that_were_kept_for_the_same_goal(draws: Draws) -> None:
    """Those of a scene, for its film that is made again, and the other way round, if they are as exact."""
    given = ("--set", "error={splats: {0: 1, 4: 100}}")
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


def test_another_version_renders_the_film_in_its_place(
    draws: Draws, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it is made from stays until it is whole, though its frames go one by one."""
    render("{frame}.png")
    expected = output_files()
    monkeypatch.setattr(fingerprint, "sources_digest", lambda: "0")
    for at, options in ((1, []), (3, []), (2, ["--force"]), (4, [])):
        draws.stop_at = at
        rerender("frames.json", *options, code=130)
        assert [frame["frame"] for frame in sidecar("frames.json")["frames"]] == [*range(NUM_FRAMES)]
    assert printed_lines(capsys)[-2].startswith("4 of 5 frames are kept")
    draws.stop_at = None
    draws.take_numbers()
    rerender("frames.json")
    assert draws.take_numbers() == [4]
    assert output_files() == expected
    assert_clean()


@pytest.mark.parametrize("options", [[], ["--force"]])
def test_a_film_that_is_partly_replaced_by_another(options: list[str], draws: Draws) -> None:
    """Nobody takes frames of the one for frames of the other, and either can be finished."""
    other = ("--set", "error.tolerance=2")
    expected = uninterrupted_files("{frame}.png")
    render("{frame}.png")
    interrupt_render(draws, "{frame}.png", *other, *options)
    assert main.run(["assemble", "out", "--output", "film.mp4", "--quiet"]) == 2
    rerender("frames.json")
    assert draws.take_numbers() == [0, 1, 2]
    assert output_files() == expected
    interrupt_render(draws, "{frame}.png", *other, *options)
    render("{frame}.png", *other)
    assert draws.take_numbers() == [3, 4]
    assert main.run(["assemble", "out", "--output", "film.mp4", "--quiet"]) == 0


def test_frames_that_were_kept_but_drawn_at_other_tolerances(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """On a budget of time they are what the clock made them; those of the film are told in its sidecar."""
    given = ("--set", "error={seconds: 60}")
    render("film.mp4", *given)
    expected = output_files()
    Path("out/film.mp4").unlink()
    interrupt_render(draws, "film.mp4", *given)
    for number in (1, 2):
        path = Path(f"out/film.mp4.unfinished/00000{number}.json")
        data = json.loads(path.read_bytes())
        data["record"]["tolerance"] = 0.7
        path.write_text(json.dumps(data), encoding="utf-8")
    printed_lines(capsys)
    rerender("film.mp4.json")
    line = "2 existing frames drawn at other tolerances are drawn again"
    assert printed_lines(capsys)[-2:] == ["1 of 5 frames is already finished", line]
    assert draws.take_numbers() == [1, 2, 3, 4]
    assert output_files() == expected


def test_a_frame_that_was_kept_but_not_drawn_in_its_time(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """It is of the film made again, whose tolerances are found already."""
    given = ("--set", "error={seconds: 60}")
    render("film.mp4", *given)
    Path("out/film.mp4").unlink()
    draws.stop_at = 1
    rerender("film.mp4.json", code=130)
    draws.stop_at = None
    draws.take_numbers()
    printed_lines(capsys)
    render("film.mp4", *given)
    assert "1 existing frame not drawn on a time budget is drawn again" in printed_lines(capsys)
    assert draws.take_numbers() == [0, 1, 2, 3, 4]


def test_what_differs_where_tolerances_are_given_by_frame(capsys: pytest.CaptureFixture[str]) -> None:
    by_frame = ("--set", "error.tolerance={0: 0.5, 4: 0.1}")
    render("film.mp4", *by_frame)
    printed_lines(capsys)
    render("film.mp4", *by_frame, "--set", "camera.path.elevation=10")
    what = "out/film.mp4 is another film and is drawn again"
    assert printed_lines(capsys)[0] == f"{what}: scene.camera.path.elevation was 20"


def of_another(what: str) -> list[str]:
    return [f"out/film.mp4 is another film and is drawn again: {what}"]


def test_why_a_film_of_the_same_frames_is_drawn_again(capsys: pytest.CaptureFixture[str]) -> None:
    render("film.mp4")
    printed_lines(capsys)
    render("film.mp4", "--set", "output.quality=3")
    assert printed_lines(capsys) == of_another("output.quality was 8")
    render("film.mp4", "--set", "output.quality=3", "--set", "output.frames_per_second=10")
    assert printed_lines(capsys) == of_another("output.frames_per_second was 30")
    render("film.mp4", "--frames", "1:3")
    printed_lines(capsys)
    render("film.mp4", "--frames", "0:2")
    assert printed_lines(capsys) == of_another("it has other frames")
    with Path("out/film.mp4").open("ab") as film:
        film.write(b"more")
    render("film.mp4", "--frames", "0:2")
    assert printed_lines(capsys) == ["out/film.mp4 is not the file that its sidecar describes and is drawn again"]
    Path("out/film.mp4").unlink()
    render("film.mp4", "--frames", "0:2")
    assert printed_lines(capsys) == []


def test_why_where_a_sidecar_was_changed(capsys: pytest.CaptureFixture[str]) -> None:
    render("film.mp4")
    edit_sidecar("film.mp4.json", lambda data: data["scene"]["error"].update(tolerance=0.7))
    Path("out/film.mp4").unlink()
    printed_lines(capsys)
    rerender("film.mp4.json")
    missing = "out/film.mp4 does not exist, and its sidecar describes another film"
    assert printed_lines(capsys) == [f"{missing}: scene.error.tolerance was 0.1"]
    edit_sidecar("film.mp4.json", lambda data: data["cause"].update(frames="0" * 32, film="0" * 32))
    render("film.mp4", "--set", "error.tolerance=0.7")
    assert printed_lines(capsys) == of_another("the record of its scene was changed")
    edit_sidecar("film.mp4.json", lambda data: data["cause"].update(frames="0" * 32, film="0" * 32, of=None))
    render("film.mp4", "--set", "error.tolerance=0.7")
    assert printed_lines(capsys) == of_another("its scene is not recorded")
    edit_sidecar("film.mp4.json", lambda data: data["schedule"].update(met=False))
    render("film.mp4", "--set", "error.tolerance=0.7")
    assert printed_lines(capsys) == ["out/film.mp4 is less than what was requested and is drawn again"]


def test_why_kept_frames_are_drawn_again(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    interrupt_render(draws, "film.mp4")
    (cause_file,) = Path("out/film.mp4.unfinished").glob("cause-*.json")
    cause_file.unlink()
    printed_lines(capsys)
    render("film.mp4", "--set", "error.tolerance=0.7")
    what = "3 existing frames of another film are drawn again"
    assert printed_lines(capsys) == [f"{what}: its scene is not recorded"]
