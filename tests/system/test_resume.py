"""An unfinished film resumes with the same bytes, and a film that is up to date is not drawn again."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from machines import set_renderer_name
from resuming import (
    NUM_FRAMES,
    Draws,
    arguments,
    assert_clean,
    edit_sidecar,
    enter_folder,
    interrupt_render,
    modification_times,
    output_files,
    printed_lines,
    render,
    sidecar,
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


OUTPUTS = ["film.mp4", "film.gif", "deep/{frame:03}.png", "clear/{frame}.png"]


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
def test_frames_of_a_changed_scene_are_drawn_again(
    output: str, options: list[str], why: str, draws: Draws, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = uninterrupted_files(output, *options)
    interrupt_render(draws, output)
    draws.take_numbers()
    capsys.readouterr()
    render(output, *options)
    assert draws.take_numbers() == [0, 1, 2, 3, 4]
    assert printed_lines(capsys)[0] == f"3 existing frames of another film are drawn again: {why}"
    assert output_files() == expected
    assert_clean()


@pytest.mark.parametrize("what", ["volume", "driver", "version", "sources"])
def test_frames_of_another_volume_driver_or_version_are_drawn_again(
    what: str, draws: Draws, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    values = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)
    np.save("scan.npy", values)
    interrupt_render(draws, "film.mp4", "--volume", "scan.npy")
    capsys.readouterr()
    if what == "volume":
        np.save("scan.npy", values[::-1])
    elif what == "driver":
        set_renderer_name(monkeypatch, "another")
    elif what == "version":
        monkeypatch.setattr(fingerprint, "package_versions", lambda: {"numpy": "9.0"})
    else:
        monkeypatch.setattr(fingerprint, "sources_digest", lambda: "0")
    render("film.mp4", "--volume", "scan.npy")
    assert draws.take_numbers() == [0, 1, 2, 3, 4]
    beginning = {
        "volume": "volume.fingerprint was ",
        "driver": "gl was ",
        "version": "versions.numpy was ",
        "sources": "sources was ",
    }
    told = printed_lines(capsys)[0].removeprefix("3 existing frames of another film are drawn again: ")
    assert told.startswith(beginning[what])
    assert_clean()


def test_a_volume_may_move(draws: Draws) -> None:
    np.save("scan.npy", np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    interrupt_render(draws, "film.mp4", "--volume", "scan.npy")
    Path("scan.npy").rename("moved.npy")
    render("film.mp4", "--volume", "moved.npy")
    assert draws.take_numbers() == [3, 4]


@pytest.mark.parametrize("option", ["output.frames_per_second=10", "output.quality=3"])
def test_another_encoding_keeps_the_frames(option: str, draws: Draws) -> None:
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


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
@pytest.mark.parametrize(
    "edit",
    [
        lambda data: data.clear(),
        lambda data: data.update(cause=[]),
        lambda data: data.update(cause={"frames": [[]], "film": {}}),
        lambda data: data.update(schedule=None),
        lambda data: data.update(schedule={"met": "yes"}),
        lambda data: data.update(frames=7),
        lambda data: data.update(frames={"0": {}}),
        lambda data: data.update(frames=[{"frame": "../../x", "digest": "0"}]),
        lambda data: data.update(frames=[{"frame": -1, "digest": [0]}]),
        lambda data: data.update(frames=[data["frames"][0] | {"seconds": {"draw": float("nan")}}]),
        lambda data: data.update(frames=[]),
        lambda data: data.update(digest=[1], frames=None),
        lambda data: data["frames"][0].update(tolerance=10**400),
        lambda data: data["cause"].update(of="nothing"),
        lambda data: data["cause"].update(frames="0", of={"deep": json.loads("[" * 500 + "]" * 500)}),
    ],
)
def test_a_sidecar_that_somebody_changed(output: str, edit: Callable[[dict[str, Any]], Any], draws: Draws) -> None:
    expected = uninterrupted_files(output)
    render(output)
    draws.take_numbers()
    edit_sidecar("film.mp4.json" if output == "film.mp4" else "frames.json", edit)
    Path("out/film.mp4" if output == "film.mp4" else "out/3.png").unlink()
    render(output)
    assert 3 in draws.take_numbers()
    assert output_files() == expected
    assert_clean()


@pytest.mark.parametrize("content", [b"", b"\0\xff", b"[" * 100_000, b"7", b'"text"', b"[]", b"null", b"9" * 5000])
def test_a_sidecar_of_garbage(content: bytes, draws: Draws) -> None:
    render("film.mp4")
    draws.take_numbers()
    Path("out/film.mp4.json").write_bytes(content)
    render("film.mp4")
    assert len(draws.take_numbers()) == NUM_FRAMES


def test_frames_of_different_drivers(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """As when a film of one cluster goes on on another: it is told once, as text that does nothing to a terminal."""
    interrupt_render(draws, "film.mp4")
    path = Path("out/film.mp4.unfinished/000001.json")
    data = json.loads(path.read_bytes())
    data["record"]["gl"] = "Other GL\x1b[31m"
    path.write_text(json.dumps(data))
    capsys.readouterr()
    render("film.mp4")
    told = sidecar("film.mp4.json")
    here = told["gl"].removeprefix("Other GL\x1b[31m and ")
    note = f"bytes may differ from frame to frame, drawn by different drivers: 'Other GL\\x1b[31m' and {here}"
    assert told["notes"] == [note]
    lines = capsys.readouterr().out.splitlines()
    assert lines[1:] == [f"note: {note}", "how it was made: out/film.mp4.json"]


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_frames_on_a_budget_of_time_are_kept(output: str, draws: Draws) -> None:
    given = ("--set", "error={seconds: 0.05}", "--best-effort")
    interrupt_render(draws, output, *given)
    render(output, *given)
    assert draws.take_numbers() == [3, 4]
    assert_clean()


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_a_progressive_film_after_an_interrupted_one(output: str, draws: Draws) -> None:
    given = ("--set", "error.tolerance=0")
    expected = uninterrupted_files(output, *given)
    interrupt_render(draws, output, *given)
    render(output, *given, "--progressive")
    assert output_files() == expected
    assert_clean()


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_one_pass_after_an_interrupted_progressive_film(output: str, draws: Draws) -> None:
    given = ("--set", "error.tolerance=0")
    expected = uninterrupted_files(output, *given)
    draws.stop_at = 3
    assert main.run(arguments(output, *given, "--progressive")) == 130
    draws.stop_at = None
    assert_clean()
    render(output, *given)
    assert output_files() == expected
    assert_clean()
