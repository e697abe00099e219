"""A film that was not finished goes on where it was, with the same bytes, and one that is whole is left alone."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import small_scene

from hsplat_cli import drawn, main
from hsplat_cli.render import cause
from renderer.drawing import Frame
from renderer.kept_frames import digest
from renderer.png import encode_png
from renderer.raster_gl import GLRasterizer

CODE = Path(main.__file__).parents[1]
NUM_FRAMES = 5

SCENE = small_scene()

OUTPUTS = ["film.mp4", "film.gif", "{frame}.png", "deep/{frame:03}.png", "clear/{frame}.png"]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder, with SCENE in scene.yaml."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.yaml").write_text(SCENE, encoding="utf-8")
    return tmp_path


class Draws:
    """The frames that were drawn, and a stop in the middle of them."""

    def __init__(self) -> None:
        self.numbers: list[int] = []
        self.stop_at: int | None = None

    def taken(self) -> list[int]:
        """Those since the last call."""
        numbers, self.numbers = self.numbers, []
        return numbers


@pytest.fixture(autouse=True)
def draws(monkeypatch: pytest.MonkeyPatch) -> Draws:
    found, original = Draws(), drawn.render_frames

    def watched(*arguments: Any, **options: Any) -> Iterator[Frame]:
        for frame in original(*arguments, **options):
            if frame.number == found.stop_at:
                raise KeyboardInterrupt
            found.numbers.append(frame.number)
            yield frame

    monkeypatch.setattr(drawn, "render_frames", watched)
    return found


def arguments(output: str, *options: str) -> list[str]:
    clear = ["--set", "output.background=transparent"] if output.startswith("clear") else []
    return ["render", "scene.yaml", "--output", f"out/{output}", *clear, *options]


def render(output: str, *options: str) -> None:
    assert main.run(arguments(output, *options)) == 0


def stopped(draws: Draws, output: str, *options: str, at: int = 3) -> None:
    """Finish the frames before `at`, then be interrupted."""
    draws.stop_at = at
    assert main.run(arguments(output, *options)) == 130
    draws.stop_at = None
    draws.taken()


def made(folder: str = "out") -> dict[str, bytes]:
    """All files, but for the sidecar, which tells of times."""
    return {
        str(path.relative_to(folder)): path.read_bytes()
        for path in Path(folder).rglob("*")
        if path.is_file() and not path.name.endswith("s.json") and path.suffix != ".json"
    }


def undisturbed(output: str, *options: str) -> dict[str, bytes]:
    given = arguments(output, *options, "--quiet")
    given[3] = given[3].replace("out/", "undisturbed/")
    assert main.run(given) == 0
    return made("undisturbed")


def sidecar(name: str) -> dict[str, Any]:
    data: dict[str, Any] = json.loads((Path("out") / name).read_text(encoding="utf-8"))
    return data


def change(name: str, edit: Callable[[dict[str, Any]], Any]) -> None:
    data = sidecar(name)
    edit(data)
    (Path("out") / name).write_text(json.dumps(data), encoding="utf-8")


def assert_clean() -> None:
    left = [path for path in Path().rglob("*") if "unfinished" in path.name or "partial" in path.name]
    assert left == []


def said(capsys: pytest.CaptureFixture[str]) -> list[str]:
    """What was said on the error stream, but for the progress."""
    return [line for line in capsys.readouterr().err.splitlines() if "frames/s" not in line]


@pytest.mark.parametrize("output", OUTPUTS)
def test_it_goes_on_where_it_was(output: str, draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    expected = undisturbed(output)
    stopped(draws, output)
    assert said(capsys)[-2:] == [
        "3 of 5 frames are kept; the same command goes on from there",
        "hsplat: interrupted",
    ]
    render(output)
    assert draws.taken() == [3, 4]
    assert made() == expected
    assert_clean()
    captured = capsys.readouterr()
    assert captured.err.splitlines()[0] == "3 of 5 frames are there already"
    assert "(3 drawn before)" in captured.out


@pytest.mark.parametrize("output", OUTPUTS)
def test_it_may_be_stopped_again_and_again(output: str, draws: Draws) -> None:
    expected = undisturbed(output)
    for at in range(NUM_FRAMES):
        stopped(draws, output, at=at)
    render(output)
    assert draws.taken() == [4]
    assert made() == expected
    assert_clean()


# What is changed, and what is said about it.
CHANGES: list[tuple[list[str], str]] = [
    (["--set", "error.tolerance=0.01"], "scene.error.tolerance was 0.1"),
    (["--set", "camera.path.elevation=10"], "scene.camera.path.elevation was 20"),
    (["--set", "output.size=[36, 32]"], "scene.output.size was [32, 32]"),
]


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
@pytest.mark.parametrize(("options", "why"), CHANGES)
def test_a_changed_scene_starts_afresh(
    output: str, options: list[str], why: str, draws: Draws, capsys: pytest.CaptureFixture[str]
) -> None:
    expected = undisturbed(output, *options)
    stopped(draws, output)
    draws.taken()
    capsys.readouterr()
    render(output, *options)
    assert draws.taken() == [0, 1, 2, 3, 4]
    assert said(capsys)[0] == f"3 frames that were there are drawn anew, for they were of another film: {why}"
    assert made() == expected
    assert_clean()


@pytest.mark.parametrize("what", ["volume", "driver", "version", "sources"])
def test_other_makers_start_afresh(
    what: str, draws: Draws, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    values = np.arange(60, dtype=np.uint8).reshape(3, 4, 5)
    np.save("scan.npy", values)
    stopped(draws, "film.mp4", "--volume", "scan.npy")
    capsys.readouterr()
    if what == "volume":
        np.save("scan.npy", values[::-1])
    elif what == "driver":
        monkeypatch.setattr(GLRasterizer, "renderer_name", "another")
    elif what == "version":
        monkeypatch.setattr(cause, "package_versions", lambda: {"numpy": "9.0"})
    else:
        monkeypatch.setattr(cause, "sources_digest", lambda: "0")
    render("film.mp4", "--volume", "scan.npy")
    assert draws.taken() == [0, 1, 2, 3, 4]
    beginning = {
        "volume": "volume.fingerprint was ",
        "driver": "gl was ",
        "version": "versions.numpy was ",
        "sources": "sources was ",
    }
    told = said(capsys)[0].removeprefix("3 frames that were there are drawn anew, for they were of another film: ")
    assert told.startswith(beginning[what])
    assert_clean()


def test_where_the_volume_lies_changes_nothing(draws: Draws) -> None:
    np.save("scan.npy", np.arange(60, dtype=np.uint8).reshape(3, 4, 5))
    stopped(draws, "film.mp4", "--volume", "scan.npy")
    Path("scan.npy").rename("moved.npy")
    render("film.mp4", "--volume", "moved.npy")
    assert draws.taken() == [3, 4]


@pytest.mark.parametrize("option", ["output.frames_per_second=10", "output.quality=3"])
def test_what_only_the_film_depends_on_keeps_the_frames(option: str, draws: Draws) -> None:
    expected = undisturbed("film.mp4", "--set", option)
    stopped(draws, "film.mp4")
    render("film.mp4", "--set", option)
    assert draws.taken() == [3, 4]
    assert made() == expected
    draws.taken()
    render("film.mp4")
    assert draws.taken() == [0, 1, 2, 3, 4], "a film in one file has no frames that could be kept"


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_other_frames_of_the_same_film(output: str, draws: Draws) -> None:
    expected = undisturbed(output)
    stopped(draws, output, "--frames", "1::2")
    render(output)
    assert draws.taken() == [0, 2, 3, 4]
    assert made() == expected
    assert_clean()


def test_a_part_of_frames_that_were_kept(draws: Draws) -> None:
    """The film of the part is whole: nothing is kept any more."""
    stopped(draws, "film.mp4")
    render("film.mp4", "--frames", "1:3")
    assert draws.taken() == []
    assert [frame["frame"] for frame in sidecar("film.mp4.json")["frames"]] == [1, 2]
    assert_clean()


def test_stills_of_one_name(draws: Draws) -> None:
    stopped(draws, "still.png", "--frames", "2", at=2)
    Path("out/still.png.unfinished").mkdir()
    Path("out/still.png.unfinished/000002.json").touch()  # as when it was killed later
    for number in (3, 2):
        render("still.png", "--frames", str(number))
        assert draws.taken() == [number]
        assert_clean()
    assert made()["still.png"] == undisturbed("{frame}.png", "--frames", "2")["2.png"]


@pytest.mark.parametrize("damage", [Path.unlink, lambda path: path.write_bytes(b"changed")])
def test_a_picture_that_is_not_what_it_was(draws: Draws, damage: Callable[[Path], Any]) -> None:
    """While the film is not whole, and when it was."""
    expected = undisturbed("{frame}.png")
    stopped(draws, "{frame}.png")
    damage(Path("out/1.png"))
    render("{frame}.png")
    assert draws.taken() == [1, 3, 4]
    damage(Path("out/2.png"))
    render("{frame}.png")
    assert draws.taken() == [2]
    assert made() == expected
    assert_clean()


def touched() -> dict[Path, int]:
    return {path: path.stat().st_mtime_ns for path in Path("out").rglob("*") if path.is_file()}


@pytest.mark.parametrize("output", OUTPUTS)
def test_a_film_that_is_up_to_date(output: str, draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    render(output)
    before = touched()
    draws.taken()
    capsys.readouterr()
    render(output)
    assert touched() == before
    assert draws.taken() == []
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
    stopped(draws, "film.mp4", *other)
    render("film.mp4", *options)
    draws.taken()
    render("film.mp4", *other)
    assert draws.taken() == [3, 4]
    assert_clean()


def test_frames_of_a_film_that_is_there_go(draws: Draws) -> None:
    """As where it was killed when it was whole."""
    render("film.mp4")
    stopped(draws, "film.mp4", "--force")
    assert Path("out/film.mp4.unfinished").exists()
    render("film.mp4")
    assert draws.taken() == []
    assert_clean()


@pytest.mark.parametrize("output", OUTPUTS)
def test_force(output: str, draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    expected = undisturbed(output)
    render(output)
    draws.taken()
    render(output, "--force")
    assert draws.taken() == [0, 1, 2, 3, 4]
    stopped(draws, output, "--force")
    once = "" if output.endswith(".png") else f", once out/{output} is removed,"
    left = f"3 of 5 frames are kept; the same command without --force{once} goes on from there"
    assert said(capsys)[-2] == left
    render(output, "--force")
    assert draws.taken() == [0, 1, 2, 3, 4]
    if once:
        stopped(draws, output, "--force")
        Path(f"out/{output}").unlink()
        stopped(draws, output, "--force")
        assert said(capsys)[-2] == left.replace(once, "")
        render(output)
        assert draws.taken() == [3, 4]
    assert made() == expected
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
    expected = undisturbed(output)
    render(output)
    draws.taken()
    change("film.mp4.json" if output == "film.mp4" else "frames.json", edit)
    Path("out/film.mp4" if output == "film.mp4" else "out/3.png").unlink()
    render(output)
    assert 3 in draws.taken()
    assert made() == expected
    assert_clean()


@pytest.mark.parametrize("content", [b"", b"\0\xff", b"[" * 100_000, b"7", b'"text"', b"[]", b"null", b"9" * 5000])
def test_a_sidecar_of_garbage(content: bytes, draws: Draws) -> None:
    render("film.mp4")
    draws.taken()
    Path("out/film.mp4.json").write_bytes(content)
    render("film.mp4")
    assert len(draws.taken()) == NUM_FRAMES


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_a_film_made_again_in_its_place(output: str, draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    render(output)
    expected, name = made(), "film.mp4.json" if output == "film.mp4" else "frames.json"
    draws.taken()
    capsys.readouterr()
    assert main.run(["render", f"out/{name}"]) == 0
    assert draws.taken() == []
    assert said(capsys)[-1].endswith("is up to date; --force draws it again")
    Path("out/film.mp4" if output == "film.mp4" else "out/3.png").unlink()
    draws.stop_at = 3
    assert main.run(["render", f"out/{name}"]) == 130
    draws.stop_at = None
    draws.taken()
    assert main.run(["render", f"out/{name}"]) == 0
    assert draws.taken() == ([3, 4] if output == "film.mp4" else [3])
    assert made() == expected
    assert_clean()


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
@pytest.mark.parametrize("schedule", ["{tolerance: {0: 0.5, 4: 0.02}}", "{splats: {0: 50, 4: 2000}}", "{psnr: 25}"])
def test_schedules(schedule: str, output: str, draws: Draws) -> None:
    given = ("--set", f"error={schedule}")
    expected = undisturbed(output, *given)
    stopped(draws, output, *given)
    render(output, *given)
    assert draws.taken() == [3, 4]
    assert made() == expected
    tolerances = [frame["tolerance"] for frame in sidecar(Path(_sidecar_of(output)).name)["frames"]]
    undisturbed_sidecar = json.loads(Path("undisturbed", _sidecar_of(output)).read_text())
    assert tolerances == [frame["tolerance"] for frame in undisturbed_sidecar["frames"]]


def _sidecar_of(output: str) -> str:
    return "frames.json" if output.endswith(".png") else f"{output}.json"


def again(name: str, *options: str, code: int = 0) -> None:
    """Make a film once more from the sidecar in out/."""
    assert main.run(["render", f"out/{name}", *options]) == code


GOALS = ["{splats: {0: 50, 4: 2000}}", "{psnr: 25}", "{seconds: 0.5}"]


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
@pytest.mark.parametrize("goal", GOALS)
def test_a_goal_that_was_met_is_met_when_the_film_is_made_again(
    goal: str, output: str, draws: Draws, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the scene or the sidecar, whichever is first; and what is missing is drawn as it was."""
    given, name = ("--set", f"error={goal}"), _sidecar_of(output)
    render(output, *given)
    expected, up_to_date = made(), [f"out/{output} is up to date; --force draws it again"]
    for _ in range(2):
        draws.taken()
        said(capsys)
        for command in (lambda: render(output, *given), lambda: again(name)):
            before = touched()
            command()
            assert said(capsys) == up_to_date
            assert touched() == before
        assert draws.taken() == []
        Path("out/film.mp4" if output == "film.mp4" else "out/3.png").unlink()
        again(name)
        assert draws.taken() == ([0, 1, 2, 3, 4] if output == "film.mp4" else [3])
        assert made() == expected
    assert_clean()


@pytest.mark.parametrize("goal", GOALS)
def test_a_film_made_again_elsewhere(goal: str, draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    given = ("--set", f"error={goal}")
    render("film.mp4", *given)
    again("film.mp4.json", "--output", "out/other.gif")
    draws.taken()
    said(capsys)
    render("other.gif", *given)
    assert said(capsys) == ["out/other.gif is up to date; --force draws it again"]
    assert draws.taken() == []


@pytest.mark.parametrize("goal", ["{psnr: 25}", "{seconds: 0.5}"])
def test_a_part_of_a_film_whose_goal_was_one_of_the_whole(
    goal: str, draws: Draws, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whether the part alone meets it is not known: it was asked for at the tolerances of the whole."""
    given, part = ("--set", f"error={goal}"), ("--frames", "1:3", "--output", "out/part/{frame}.png")
    render("{frame}.png", *given)
    again("frames.json", *part)
    told = sidecar("part/frames.1-2.json")["schedule"]
    assert [*told["asked"]] == ["tolerance"]
    assert told["met"] and "measured" not in told
    draws.taken()
    said(capsys)
    again("part/frames.1-2.json")
    assert said(capsys) == ["out/part/{frame}.png is up to date; --force draws it again"]
    assert main.run(["render", "scene.yaml", *given, *part]) == 0
    name = goal[1:].partition(":")[0]
    what = "out/part/{frame}.png is drawn anew, for what is there is another film"
    assert said(capsys)[0].startswith(f"{what}: scene.error.{name} was nothing; scene.error.tolerance was ")
    assert draws.taken() == [1, 2]


@pytest.mark.parametrize(
    ("what", "goal"), [("version", GOALS[0]), ("tolerance", GOALS[1]), ("sources", GOALS[1]), ("driver", GOALS[2])]
)
def test_a_goal_that_nobody_knows_to_be_met(
    what: str, goal: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where another program makes a film again, or at another tolerance, it counts as asked for at its tolerances."""
    given = ("--set", f"error={goal}")
    render("film.mp4", *given)
    before = sidecar("film.mp4.json")
    if what == "driver":
        monkeypatch.setattr(GLRasterizer, "renderer_name", "another")
    elif what == "version":
        monkeypatch.setattr(cause, "package_versions", lambda: {"numpy": "9.0"})
    elif what == "sources":
        monkeypatch.setattr(cause, "sources_digest", lambda: "0")
    else:
        change("film.mp4.json", lambda data: data["scene"]["error"].update(tolerance=0.7))
    Path("out/film.mp4").unlink()
    again("film.mp4.json")
    after = sidecar("film.mp4.json")
    assert after["schedule"]["asked"] == {"tolerance": after["scene"]["error"]["tolerance"]}
    assert (after["scene"]["error"] == before["scene"]["error"]) == (what != "tolerance")
    assert after["schedule"]["met"] and after["schedule"]["reproducible"]
    assert "measured" not in after["schedule"]
    said(capsys)
    render("film.mp4", *given)
    assert said(capsys)[0].startswith("out/film.mp4 is drawn anew, for what is there is another film: scene.error.")


def test_frames_that_were_kept_for_the_same_goal(draws: Draws) -> None:
    """Those of a scene, for its film that is made again, and the other way round, if they are as exact."""
    given = ("--set", "error={splats: {0: 50, 4: 2000}}")
    render("film.mp4", *given)
    expected = made()
    Path("out/film.mp4").unlink()
    stopped(draws, "film.mp4", *given)
    again("film.mp4.json")
    assert draws.taken() == [3, 4]
    Path("out/film.mp4").unlink()
    draws.stop_at = 3
    again("film.mp4.json", code=130)
    draws.stop_at = None
    draws.taken()
    render("film.mp4", *given)
    assert draws.taken() == [3, 4]
    assert made() == expected


def test_a_film_that_another_program_makes_again_in_its_place(
    draws: Draws, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What it is made from stays until it is whole, though its frames go one by one."""
    render("{frame}.png")
    expected = made()
    monkeypatch.setattr(cause, "sources_digest", lambda: "0")
    for at, options in ((1, []), (3, []), (2, ["--force"]), (4, [])):
        draws.stop_at = at
        again("frames.json", *options, code=130)
        assert [frame["frame"] for frame in sidecar("frames.json")["frames"]] == [*range(NUM_FRAMES)]
    assert said(capsys)[-2].startswith("4 of 5 frames are kept")
    draws.stop_at = None
    draws.taken()
    again("frames.json")
    assert draws.taken() == [4]
    assert made() == expected
    assert_clean()


@pytest.mark.parametrize("options", [[], ["--force"]])
def test_a_film_that_another_one_has_begun_to_replace(options: list[str], draws: Draws) -> None:
    """Nobody takes frames of the one for frames of the other, and either can be finished."""
    other = ("--set", "error.tolerance=2")
    expected = undisturbed("{frame}.png")
    render("{frame}.png")
    stopped(draws, "{frame}.png", *other, *options)
    assert main.run(["assemble", "out", "--output", "film.mp4", "--quiet"]) == 2
    again("frames.json")
    assert draws.taken() == [0, 1, 2]
    assert made() == expected
    stopped(draws, "{frame}.png", *other, *options)
    render("{frame}.png", *other)
    assert draws.taken() == [3, 4]
    assert main.run(["assemble", "out", "--output", "film.mp4", "--quiet"]) == 0


def test_frames_that_were_kept_but_drawn_at_other_tolerances(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """On a budget of time they are what the clock made them; those of the film are told in its sidecar."""
    given = ("--set", "error={seconds: 0.5}")
    render("film.mp4", *given)
    expected = made()
    Path("out/film.mp4").unlink()
    stopped(draws, "film.mp4", *given)
    for number in (1, 2):
        path = Path(f"out/film.mp4.unfinished/00000{number}.json")
        data = json.loads(path.read_bytes())
        data["record"]["tolerance"] = 0.7
        path.write_text(json.dumps(data), encoding="utf-8")
    said(capsys)
    again("film.mp4.json")
    anew = "2 frames that were there are drawn anew, for they were drawn at other tolerances"
    assert said(capsys)[-2:] == ["1 of 5 frames are there already", anew]
    assert draws.taken() == [1, 2, 3, 4]
    assert made() == expected


def test_a_frame_that_was_kept_but_not_drawn_in_its_time(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """It is of the film made again, whose tolerances are found already."""
    given = ("--set", "error={seconds: 0.5}")
    render("film.mp4", *given)
    Path("out/film.mp4").unlink()
    draws.stop_at = 1
    again("film.mp4.json", code=130)
    draws.stop_at = None
    draws.taken()
    said(capsys)
    render("film.mp4", *given)
    assert "1 frame that was there is drawn anew, for it was not drawn on a budget of time" in said(capsys)
    assert draws.taken() == [0, 1, 2, 3, 4]


def test_what_differs_where_tolerances_are_given_by_frame(capsys: pytest.CaptureFixture[str]) -> None:
    by_frame = ("--set", "error.tolerance={0: 0.5, 4: 0.1}")
    render("film.mp4", *by_frame)
    said(capsys)
    render("film.mp4", *by_frame, "--set", "camera.path.elevation=10")
    what = "out/film.mp4 is drawn anew, for what is there is another film"
    assert said(capsys)[0] == f"{what}: scene.camera.path.elevation was 20"


@pytest.mark.parametrize("shape", [(16, 32, 3), (32, 32, 4)])
@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_a_picture_of_another_size_whose_record_agrees(output: str, shape: tuple[int, int, int], draws: Draws) -> None:
    expected = undisturbed(output)
    stopped(draws, output)
    folder = Path("out/film.mp4.unfinished" if output == "film.mp4" else "out/frames.unfinished")
    content = encode_png(np.zeros(shape, np.uint8))
    (folder / "000001.png" if output == "film.mp4" else Path("out/1.png")).write_bytes(content)
    data = json.loads((folder / "000001.json").read_bytes())
    data["record"]["digest"] = digest(content)
    (folder / "000001.json").write_text(json.dumps(data))
    render(output)
    assert draws.taken() == [1, 3, 4]
    assert made() == expected


def test_a_picture_of_another_size_in_a_film_that_was_whole(draws: Draws) -> None:
    render("{frame}.png")
    expected = made()
    draws.taken()
    content = encode_png(np.zeros((16, 32, 3), np.uint8))
    Path("out/1.png").write_bytes(content)
    change("frames.json", lambda data: data["frames"][1].update(digest=digest(content)))
    render("{frame}.png")
    assert draws.taken() == [1]
    assert made() == expected


def test_frames_of_different_drivers(draws: Draws, capsys: pytest.CaptureFixture[str]) -> None:
    """As when a film of one cluster goes on on another: it is told once, as text that does nothing to a terminal."""
    stopped(draws, "film.mp4")
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
def test_frames_on_a_budget_of_time_are_kept_as_they_are(output: str, draws: Draws) -> None:
    given = ("--set", "error={seconds: 0.05}", "--best-effort")
    stopped(draws, output, *given)
    render(output, *given)
    assert draws.taken() == [3, 4]
    assert_clean()


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_a_film_that_refines_after_one_that_was_stopped(output: str, draws: Draws) -> None:
    given = ("--set", "error.tolerance=0")
    expected = undisturbed(output, *given)
    stopped(draws, output, *given)
    render(output, *given, "--progressive")
    assert made() == expected
    assert_clean()


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_one_pass_after_a_film_that_was_to_refine(output: str, draws: Draws) -> None:
    given = ("--set", "error.tolerance=0")
    expected = undisturbed(output, *given)
    draws.stop_at = 3
    assert main.run(arguments(output, *given, "--progressive")) == 130
    draws.stop_at = None
    assert_clean()
    render(output, *given)
    assert made() == expected
    assert_clean()
