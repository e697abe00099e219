"""`hsplat render --progressive`: whatever happens, what lies under the final name is a whole film."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import imageio.v3 as imageio
import pytest
from commands import files
from resuming import on_each_frame, printed_lines
from small_scene import sidecar, small_scene

from hsplat_cli import main
from renderer.film import file_digest
from renderer.frame import Frame

pytestmark = pytest.mark.usefixtures("scene_folder")

NUM_FRAMES = 4

# Splats, of which a small volume has enough that coarse passes are much faster; test_render_integrated refines bricks.
SCENE = small_scene(shape="64, 64, 48", frames=4, size="48, 32", error="tolerance: 0, probes: 16", footprint="gaussian")


def render(*options: str) -> int:
    return main.run(["render", "scene.yaml", "--quiet", *options])


Hook = Callable[[int, Frame], None]


def interrupt_at(frame_number: int, first_pass: int = 1) -> Hook:
    """Return what interrupts the job at this frame, from this pass on."""

    def interrupt(number: int, frame: Frame) -> None:
        if number >= first_pass and frame.number == frame_number:
            raise KeyboardInterrupt

    return interrupt


@pytest.fixture
def on_frame(monkeypatch: pytest.MonkeyPatch) -> Callable[[Hook], None]:
    """Return a function that sets what is called with the number of the pass and each frame, before it is written."""
    hook: Hook = lambda *_: None  # noqa: E731
    num_passes = 0

    def look(frame: Frame) -> None:
        nonlocal num_passes
        num_passes += frame.number == 0
        hook(num_passes, frame)

    def set_hook(new: Hook) -> None:
        nonlocal hook, num_passes
        hook, num_passes = new, 0

    on_each_frame(monkeypatch, look)
    return set_hook


def test_passes_refine_to_the_film_that_one_pass_makes(folder: Path, on_frame: Callable[[Hook], None]) -> None:
    """Each pass is finer; while it is drawn the film of the pass before can be played."""
    seen = []

    def look(number: int, frame: Frame) -> None:
        if number > 1:
            seen.append(imageio.imread("film.mp4", plugin="FFMPEG").shape)
            assert sidecar()["schedule"]["met"] is False
            assert len(sidecar()["passes"]) == number - 1

    on_frame(look)
    assert render("--progressive") == 0
    assert len(seen) >= NUM_FRAMES
    assert set(seen) == {(NUM_FRAMES, 32, 48, 3)}
    made = sidecar()
    assert made["schedule"]["met"] and made["schedule"]["reproducible"]
    passes = made["passes"]
    assert len(passes) >= 2
    assert all(a["tolerance"][0] > b["tolerance"][0] and a["cells"][1] < b["cells"][0] for a, b in pairwise(passes))
    assert "difference" not in passes[0]
    assert all(each["difference"]["rmse"] > 0 and each["difference"]["frames"] == NUM_FRAMES for each in passes[1:])
    assert all(each["seconds"] > 0 and each["predicted_seconds"] > 0 for each in passes)
    on_frame(lambda *_: None)
    assert render("--output", "plain.mp4") == 0
    assert files(folder) == ["film.mp4", "film.mp4.json", "plain.mp4", "plain.mp4.json", "scene.yaml"]
    assert Path("film.mp4").read_bytes() == Path("plain.mp4").read_bytes()


def test_numbered_frames_change_all_together(folder, on_frame: Callable[[Hook], None], capsys) -> None:
    """A film never has some coarse and some fine frames. Frames of the last pass are kept by the next job."""
    before: dict[int, list[bytes]] = {}
    numbers = []

    def look(number: int, frame: Frame) -> None:
        numbers.append(frame.number)
        if number > 1:
            content = [Path(f"frames/{i}.png").read_bytes() for i in range(NUM_FRAMES)]
            assert before.setdefault(number, content) == content

    on_frame(look)
    output = ("--output", "frames/{frame}.png")
    assert render("--progressive", *output) == 0
    assert len(before) >= 1
    assert files(folder) == [*(f"frames/{i}.png" for i in range(NUM_FRAMES)), "frames/frames.json", "scene.yaml"]
    whole = [Path(f"frames/{i}.png").read_bytes() for i in range(NUM_FRAMES)]
    assert all(frame != coarse for frame, coarse in zip(whole, before[2], strict=True))
    Path("frames/2.png").unlink()
    numbers.clear()
    on_frame(lambda _, frame: numbers.append(frame.number))
    printed_lines(capsys)
    assert main.run(["render", "scene.yaml", *output]) == 0
    assert printed_lines(capsys) == ["3 of 4 frames are already finished"]
    assert numbers == [2]
    assert Path("frames/2.png").read_bytes() == whole[2]


@pytest.mark.parametrize("output", ["film.mp4", "{frame}.png"])
def test_an_interrupt_leaves_the_film_of_the_pass_before(folder, on_frame, output, capsys) -> None:
    on_frame(interrupt_at(2, first_pass=2))
    best_effort = ["--best-effort"] * (output != "film.mp4")
    code = main.run(["render", "scene.yaml", "--progressive", "--output", output, *best_effort])
    assert code == (0 if best_effort else 130)
    assert f"{output} is whole, as pass 1 made it\n" in capsys.readouterr().out
    if output == "film.mp4":
        assert files(folder) == ["film.mp4", "film.mp4.json", "scene.yaml"]
        assert imageio.imread("film.mp4", plugin="FFMPEG").shape == (NUM_FRAMES, 32, 48, 3)
        record = sidecar()
        assert not record["schedule"]["met"]
        assert not record["schedule"]["reproducible"]
        assert len(record["passes"]) == 1
        assert len(record["frames"]) == NUM_FRAMES
    else:
        assert files(folder) == ["0.png", "1.png", "2.png", "3.png", "frames.json", "scene.yaml"]


def test_an_interrupt_of_the_first_pass_leaves_nothing(folder: Path, on_frame: Callable[[Hook], None]) -> None:
    on_frame(interrupt_at(2))
    assert render("--progressive", "--output", "{frame}.png") == 130
    assert files(folder) == ["scene.yaml"]


PSNR = ("--set", "error.tolerance=null", "--set", "error.psnr=20")


@pytest.mark.parametrize(("options", "code"), [((), 1), (("--best-effort",), 0), (PSNR, 1)])
def test_the_first_pass_is_made_whatever_the_limit(folder: Path, options: tuple[str, ...], code: int) -> None:
    """And no search for an accuracy after it."""
    assert render("--progressive", "--time-limit", "0.01", *options) == code
    assert len(sidecar()["passes"]) == 1
    assert not sidecar()["schedule"]["met"]
    assert imageio.imread("film.mp4", plugin="FFMPEG").shape == (NUM_FRAMES, 32, 48, 3)


def test_coarse_frames_are_not_taken_for_fine_ones(on_frame: Callable[[Hook], None]) -> None:
    """Though those of one pass take the places of the coarse ones one by one."""
    output = ("--output", "frames/{frame}.png")
    assert render("--progressive", "--time-limit", "0.01", *output) == 1
    for frame in sidecar("frames/frames.json")["frames"]:
        assert frame["digest"] == file_digest(Path(f"frames/{frame['frame']}.png"))
    assert main.run(["assemble", "frames", "--output", "coarse.mp4", "--quiet"]) == 0

    on_frame(interrupt_at(2))
    assert render(*output) == 130
    assert main.run(["assemble", "frames", "--output", "film.mp4", "--quiet"]) == 2
    assert not Path("film.mp4").exists()


def test_when_time_is_up_in_the_middle_of_a_pass_it_is_given_up(folder, on_frame, monkeypatch) -> None:
    now = time.perf_counter

    def stop(number: int, frame: Frame) -> None:
        if number == 2 and frame.number == 1:
            monkeypatch.setattr(time, "perf_counter", lambda: now() + 1e6)

    on_frame(stop)
    assert render("--progressive", "--time-limit", "100000s") == 1
    assert len(sidecar()["passes"]) == 1
    assert files(folder) == ["film.mp4", "film.mp4.json", "scene.yaml"]


def test_a_still_is_refined_too(folder: Path) -> None:
    assert render("--progressive", "--frames", "2", "--output", "{frame}.png") == 0
    assert files(folder) == ["2.png", "frames.2.json", "scene.yaml"]
    assert len(sidecar("frames.2.json")["passes"]) >= 2


def test_a_film_that_is_hardly_quicker_when_coarse_has_one_pass(folder: Path) -> None:
    assert render("--progressive", "--set", "error.tolerance=5") == 0
    assert len(sidecar()["passes"]) == 1
    assert sidecar()["schedule"]["met"]


@pytest.mark.parametrize("schedule", ["splats=20000", "seconds=0.05"])
def test_budgets_are_refined_to(folder: Path, schedule: str) -> None:
    changes = ("--set", "error.tolerance=null", "--set", f"error.{schedule}")
    assert render("--progressive", "--best-effort", *changes) == 0
    passes = sidecar()["passes"]  # how many, and with `seconds` how large, is up to the clock
    assert schedule == "seconds=0.05" or all(a["cells"][1] < b["cells"][1] for a, b in pairwise(passes))
    assert sidecar()["schedule"]["requested"] == {schedule.partition("=")[0]: float(schedule.partition("=")[2])}


@pytest.mark.parametrize(
    ("schedule", "options"),
    [("splats=1000", ("--progressive",)), ("seconds=0.05", ()), ("psnr=30", ("--progressive",))],
)
def test_where_nothing_is_visible_any_schedule_is_met(schedule: str, options: tuple[str, ...]) -> None:
    hidden = (
        "transfer_function.points=[{value: 1000, color: white, opacity: 0}, {value: 1001, color: white, opacity: 0.5}]"
    )
    changes = ("--set", hidden, "--set", "error.tolerance=null", "--set", f"error.{schedule}")
    assert render("--set", "camera.distance=300", *changes, *options) == 0
    assert sidecar()["schedule"]["met"]
    assert sidecar()["schedule"]["cells"] == [0, 0]


def test_a_pass_that_is_finer_than_an_accuracy_needs_is_not_the_last() -> None:
    """The film is the one that a single pass makes."""
    assert render("--progressive", "--set", "error.tolerance=null", "--set", "error.psnr=5") == 0
    record = sidecar()
    assert len(record["passes"]) == 2
    assert record["schedule"]["met"] and record["schedule"]["reproducible"]
    assert record["schedule"]["measured"]["worst"] >= 5


@pytest.fixture
def named_with_an_interrupt(heeds_interrupts: None, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Interrupt this process whenever a film or its first picture gets its final name."""
    replace = os.replace

    def interrupted(source: Path, target: Path) -> None:
        if Path(target).name in ("film.mp4", "0.png"):
            os.kill(os.getpid(), signal.SIGINT)
        replace(source, target)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupted)
        yield


@pytest.mark.usefixtures("named_with_an_interrupt")
@pytest.mark.parametrize("options", [(), ("--best-effort",)])
def test_an_interrupt_between_film_and_sidecar_waits_for_both(folder, options: tuple[str, ...], capsys) -> None:
    """Otherwise the sidecar would describe another film than the one beside it. The pass before is the film."""
    assert main.run(["render", "scene.yaml", "--progressive", *options]) == (0 if options else 130)
    assert "film.mp4 is whole, as pass 1 made it\n" in capsys.readouterr().out
    assert len(sidecar()["passes"]) == 1
    assert files(folder) == ["film.mp4", "film.mp4.json", "scene.yaml"]
    first = Path("film.mp4").read_bytes()
    assert main.run(["render", "film.mp4.json", "--output", "again.mp4", "--quiet"]) == 0
    assert Path("again.mp4").read_bytes() == first


@pytest.mark.usefixtures("named_with_an_interrupt")
def test_an_interrupt_between_a_frame_and_its_record_waits_for_both(folder: Path) -> None:
    """Frames appear one by one, each whole: the one that was being written has its record, and so has each after it."""
    assert render("--output", "{frame}.png") == 130
    names = [name for name in files(folder) if "fingerprint-" not in name]
    numbers = [int(name.removesuffix(".png")) for name in names if name.endswith(".png")]
    assert numbers == [*range(len(numbers))] and 1 <= len(numbers) <= 3, "of the frames that were drawn by then"
    records = [f"frames.unfinished/{number:06}.json" for number in numbers]
    assert [name for name in names if not name.endswith(".png")] == [*records, "frames.unfinished/lock", "scene.yaml"]


def test_budgets_that_some_frames_cannot_keep_are_told(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    changes = ("--set", "error.tolerance=null", "--set", "error.seconds={0: 0.0001, 1: 0.0001, 2: 100}")
    assert render(*changes) == 1
    assert capsys.readouterr().err.startswith("error.seconds: 2 of 4 frames took longer than the time budget\n")
    assert not sidecar()["schedule"]["met"]


@pytest.mark.parametrize(("output", "goal"), [("film.mp4", "psnr=24"), ("{frame}.png", "splats=20000")])
def test_a_finished_film_is_up_to_date(folder, output, goal, on_frame, capsys) -> None:
    """This holds with and without passes, and from the sidecar; `--force` draws it again."""
    options = ["scene.yaml", "--output", output, "--set", "error.tolerance=null", "--set", f"error.{goal}"]
    refined = [*options, "--progressive"]
    assert main.run(["render", *refined]) == 0
    name = "film.mp4.json" if output == "film.mp4" else "frames.json"
    before = {path: path.stat().st_mtime_ns for path in folder.iterdir()}
    numbers: list[int] = []
    on_frame(lambda _, frame: numbers.append(frame.number))
    printed_lines(capsys)
    for command in (refined, [*refined, "--time-limit", "100s"], options, [name]):
        assert main.run(["render", *command]) == 0
        assert printed_lines(capsys) == [f"{output} is up to date; --force draws it again"]
    assert {path: path.stat().st_mtime_ns for path in folder.iterdir()} == before
    assert numbers == []
    assert main.run(["render", *refined, "--time-limit", "0.01s", "--best-effort", "--force", "--quiet"]) == 0
    assert numbers == [*range(NUM_FRAMES)]


def test_a_film_that_was_not_finished_is_not_up_to_date(on_frame: Callable[[Hook], None]) -> None:
    numbers: list[int] = []
    for _ in range(2):
        on_frame(lambda _, frame: numbers.append(frame.number))
        assert render("--progressive", "--best-effort", "--time-limit", "0.01s") == 0
        assert "fingerprint" not in sidecar()
        assert not sidecar()["schedule"]["reproducible"]
        assert numbers[:NUM_FRAMES] == [*range(NUM_FRAMES)]
        numbers.clear()
