"""`hsplat golden` writes goldens, asks before it overwrites them, and leaves other files alone."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import other_process
from png_files import interlaced
from resuming import watch_draws
from small_scene import edit_sidecar, small_scene

from hsplat_cli import main
from hsplat_cli.commands import golden as command
from renderer.film import bytes_digest, decode_png, encode_png
from renderer.volume import UInt8

SCENE = small_scene(shape="16, 16, 8", frames=4)
FOLDER = Path("goldens")
FIRST: dict[str, bytes] = {}
NAMES = [f"frame-000{number}.png" for number in range(4)]
OTHER = ["--set", "transfer_function.points.2.color=red"]


@pytest.fixture(autouse=True)
def _folder(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder with SCENE the current one; the environment is not that of CI."""
    monkeypatch.delenv("CI", raising=False)
    monkeypatch.setattr(tempfile, "tempdir", str(folder / "temporary"))
    Path("temporary").mkdir()
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")


def golden(*options: str) -> int:
    code = main.run(["golden", "scene.yaml", "goldens", *options])
    assert list(Path("temporary").iterdir()) == [], "temporary files are left"
    assert not (FOLDER / "golden.unfinished").exists()
    return code


def golden_json() -> dict[str, Any]:
    data: dict[str, Any] = json.loads((FOLDER / "golden.json").read_bytes())
    return data


def files() -> dict[str, tuple[bytes, int]]:
    """Return content and time of all files in the folder."""
    return {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in FOLDER.iterdir()}


def first_goldens() -> None:
    """Write the goldens of SCENE, which are drawn once for all tests."""
    if FIRST:
        FOLDER.mkdir()
        for name, content in FIRST.items():
            (FOLDER / name).write_bytes(content)
    else:
        assert golden("--quiet") == 0
        FIRST.update((name, content) for name, (content, _) in files().items())


def test_the_first_goldens_are_the_frames_of_render(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--date", "2026-11-21") == 0
    captured = capsys.readouterr()
    assert captured.out == "goldens: 4 goldens\norigin: goldens/golden.json\n"
    assert "drawing" in captured.err and "4/4 frames" in captured.err and "temporary" not in captured.err
    assert sorted(path.name for path in FOLDER.iterdir()) == [*NAMES, "golden.json"]
    data = golden_json()
    assert list(data) == ["format", "volume", "device", "scene", "versions", "frames"]
    assert data["volume"]["shape"] == [16, 16, 8]
    assert data["scene"]["error"]["tolerance"] == 0.1, "defaults are written out"
    assert "file" not in data["scene"]["output"]
    assert [(frame["file"], frame["date"]) for frame in data["frames"]] == [(name, "2026-11-21") for name in NAMES]
    assert main.run(["render", "scene.yaml", "--output", "drawn/{frame:04}.png", "--quiet"]) == 0
    for number, name in enumerate(NAMES):
        assert (FOLDER / name).read_bytes() == Path(f"drawn/{number:04}.png").read_bytes()


def test_equal_goldens_are_equal_bytes(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--quiet") == 0
    before = {name: content for name, (content, _) in files().items()}
    shutil.rmtree(FOLDER)
    assert golden("--quiet") == 0
    assert {name: content for name, (content, _) in files().items()} == before
    assert capsys.readouterr() == ("", "")


def test_without_update_or_with_a_declined_one_nothing_is_written(capsys, monkeypatch) -> None:
    first_goldens()
    before = files()
    assert golden(*OTHER) == 2
    monkeypatch.setattr(command, "_confirm_overwrite", lambda _: False)
    assert golden("--update", *OTHER) == 1
    assert capsys.readouterr().out.splitlines()[-1] == "nothing was written"
    assert golden("--update", "--date", "another") == 0
    assert capsys.readouterr().out == "goldens: nothing changes\n"
    assert files() == before


def test_without_an_answer_goldens_are_not_overwritten(capsys, monkeypatch) -> None:
    first_goldens()
    before = files()
    monkeypatch.setenv("CI", "false")
    with open(os.devnull, encoding="utf-8") as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        assert golden("--update", *OTHER) == 2
    captured = capsys.readouterr()
    assert captured.out.startswith("4 of 4 frames change:")
    assert "the standard input is not a terminal" in captured.err
    assert files() == before
    assert golden("--update", "--yes", "--quiet", *OTHER) == 0
    assert capsys.readouterr() == ("", "")
    assert files() != before


def test_unchanged_frames_keep_their_files() -> None:
    first_goldens()
    before, digests = files(), [frame["digest"] for frame in golden_json()["frames"]]
    coarser = "error.tolerance={0: 0.1, 1: 0.1, 2: 2, 3: 2}"
    assert golden("--update", "--yes", "--quiet", "--set", coarser) == 0
    after = files()
    assert [after[name] == before[name] for name in NAMES] == [True, True, False, False]
    assert [frame["digest"] == digest for frame, digest in zip(golden_json()["frames"], digests, strict=True)] == [
        True, True, False, False
    ]  # fmt: skip


class Killed(BaseException):
    """Stands in for the end of the process."""


def killed_after(num_done: int, monkeypatch: pytest.MonkeyPatch, *options: str) -> list[str]:
    """Run `hsplat golden`, and end it after `num_done` files were removed or renamed; return their names."""
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


@pytest.mark.parametrize("num_done", [1, 2, 4])
def test_the_next_update_repairs_what_a_kill_leaves(num_done: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """The folder changes in this order: a golden is removed; golden.json and three goldens are written."""
    first_goldens()
    options = ("--update", "--yes", "--prune", "--frames", ":3", *OTHER)
    done = killed_after(num_done, monkeypatch, *options)
    assert done == ["frame-0003.png", "golden.json", *NAMES][:num_done]
    assert {path.name for path in FOLDER.glob("*.png")} <= {frame["file"] for frame in golden_json()["frames"]}
    assert golden(*options) == 0
    repaired = {name: content for name, (content, _) in files().items()}
    shutil.rmtree(FOLDER)
    assert golden("--quiet", *options[3:]) == 0
    assert {name: content for name, (content, _) in files().items()} == repaired


def test_two_commands_do_not_write_one_folder(capsys: pytest.CaptureFixture[str]) -> None:
    first_goldens()
    before = {name: content for name, content in files().items() if name != "golden.unfinished"}
    lock = "lock_slots(Path('goldens/golden.unfinished'), [0], Path('goldens/golden.json'))"
    with other_process("from renderer.film import lock_slots", lock):
        assert main.run(["golden", "scene.yaml", "goldens", "--update", "--yes", *OTHER]) == 2
        assert "another job is writing this output" in capsys.readouterr().err
    assert files() == before


@pytest.mark.usefixtures("heeds_interrupts")
def test_an_interrupt_waits_until_all_files_are_written(monkeypatch: pytest.MonkeyPatch) -> None:
    first_goldens()
    replace = os.replace

    def interrupted(source: Path, target: Path) -> None:
        replace(source, target)
        if Path(target).name == "golden.json":
            os.kill(os.getpid(), signal.SIGINT)

    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", interrupted)
        assert golden("--update", "--yes", "--quiet", *OTHER) == 130
    assert golden("--update", "--quiet", *OTHER) == 0, "nothing changes, so that nobody is asked"


def test_an_interrupt_while_frames_are_drawn_changes_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    first_goldens()
    before = files()
    watch_draws(monkeypatch).stop_at = 1
    assert golden("--update", "--yes", *OTHER) == 130
    assert files() == before


def test_a_missing_temporary_folder(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", "nowhere")
    assert main.run(["golden", "scene.yaml", "goldens"]) == 1
    assert capsys.readouterr().err == (
        "cannot create a temporary folder for frames\n"
        "  got: No such file or directory\n"
        "  hint: set the environment variable TMPDIR to another folder\n"
    )


# Plans of updates, which the command prints before it asks


def change_golden(number: int, change: Callable[[UInt8], object]) -> None:
    """Change the pixels of a golden in place."""
    path = FOLDER / NAMES[number]
    pixels = decode_png(path.read_bytes()).copy()
    change(pixels)
    path.write_bytes(encode_png(pixels))


def brighten(number: int, *steps: int) -> None:
    """Make some dark pixels of the first row of a golden brighter by these steps."""

    def change(pixels: UInt8) -> None:
        pixels[0, : len(steps)] += np.array(steps, np.uint8)[:, None]

    change_golden(number, change)


def declined_update(capsys: pytest.CaptureFixture[str], *options: str) -> list[str]:
    """Return the lines that an update prints before its question, which is answered by no."""
    capsys.readouterr()
    assert golden("--update", *options) == 1
    *lines, last = capsys.readouterr().out.splitlines()
    assert last == "nothing was written"
    return lines


@pytest.fixture
def _says_no(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command, "_confirm_overwrite", lambda _: False)


@pytest.mark.usefixtures("_says_no")
def test_changes_are_listed_worst_first(capsys: pytest.CaptureFixture[str]) -> None:
    first_goldens()
    for number, steps in ((0, [1]), (2, [9]), (3, [9, 9])):
        brighten(number, *steps)
    lines = declined_update(capsys)
    assert lines[0] == "3 of 4 frames change:"
    assert [line.split()[:2] for line in lines[2:5]] == [[NAMES[3], "9"], [NAMES[2], "9"], [NAMES[0], "1"]]


@pytest.mark.usefixtures("_says_no")
def test_of_many_changes_the_worst_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert golden("--quiet", "--set", "camera.path.frames=26", "--frames", ":") == 0
    for number in range(1, 26):
        shutil.copy(FOLDER / NAMES[0], FOLDER / f"frame-{number:04}.png")
    lines = declined_update(capsys, "--set", "camera.path.frames=26")
    assert lines[0] == "25 of 26 frames change:"
    largest = [float(line.split()[1]) for line in lines[2:22]]
    assert largest == sorted(largest, reverse=True)
    assert lines[22] == "  and 5 more, none of which changes more"


@pytest.mark.usefixtures("_says_no")
def test_frames_that_cannot_be_compared_are_listed_first(capsys: pytest.CaptureFixture[str]) -> None:
    first_goldens()
    brighten(0, 200)
    (FOLDER / NAMES[1]).unlink()
    (FOLDER / NAMES[2]).write_bytes(b"\x89PNG\r\n\x1a\n")
    (FOLDER / NAMES[3]).write_bytes(encode_png(np.zeros((8, 8, 4), np.uint8)))
    lines = declined_update(capsys)
    assert [line.split(":")[0].strip() for line in lines[1:4]] == NAMES[1:]
    assert lines[5].split()[:2] == [NAMES[0], "200"]


@pytest.mark.usefixtures("_says_no")
def test_changes_of_invisible_colours_are_explained(capsys: pytest.CaptureFixture[str]) -> None:
    clear = ("--set", "output.background=transparent")
    assert golden("--quiet", *clear) == 0

    def color(pixels: UInt8) -> None:
        pixels[pixels[..., 3] == 0] += np.uint8([7, 7, 7, 0])

    change_golden(1, color)
    lines = declined_update(capsys, *clear)
    assert lines[2].split()[:2] == [NAMES[1], "0"]
    assert lines[3] == "  0 everywhere: only colours at an alpha of 0 differ"


@pytest.mark.usefixtures("_says_no")
def test_other_bytes_of_equal_pixels_are_kept_and_listed(capsys: pytest.CaptureFixture[str]) -> None:
    first_goldens()
    path = FOLDER / NAMES[0]
    content = interlaced(decode_png(path.read_bytes()))
    path.write_bytes(content)
    assert declined_update(capsys) == [
        "no pixel of 4 frames changes",
        "golden.json changes: the files differ from those it lists",
    ]
    assert golden("--update", "--yes", "--quiet") == 0
    assert path.read_bytes() == content
    assert golden_json()["frames"][0]["digest"] == bytes_digest(content)


def test_another_driver_or_version_alone_is_no_change() -> None:
    first_goldens()
    edit_sidecar(FOLDER / "golden.json", lambda data: data.update(device="y", versions={"numpy": "1"}))
    before = files()
    assert golden("--update") == 0
    assert files() == before
    brighten(0, 1)
    assert golden("--update", "--yes", "--quiet") == 0
    assert golden_json()["device"] != "y"


def test_another_scene_of_equal_pixels_is_a_change() -> None:
    first_goldens()
    before = files()
    assert golden("--update", "--yes", "--quiet", "--set", "error.tolerance=0.10000001") == 0
    assert [name for name, content in files().items() if content != before[name]] == ["golden.json"]
    assert golden_json()["scene"]["error"]["tolerance"] == 0.10000001


def test_a_golden_without_a_file_is_no_longer_listed() -> None:
    first_goldens()
    (FOLDER / NAMES[3]).unlink()
    assert golden("--update", "--yes", "--quiet", "--frames", ":3") == 0
    assert [frame["frame"] for frame in golden_json()["frames"]] == [0, 1, 2]


def test_names_of_goldens_are_in_the_order_of_frames() -> None:
    assert golden("--quiet", "--set", "camera.path.frames=10001", "--frames", "7") == 0
    assert sorted(path.name for path in FOLDER.iterdir()) == ["frame-00007.png", "golden.json"]


@pytest.mark.parametrize("name", ["a\nb.npy", "\udcff.npy", f"{'x' * 240}.npy"])
def test_the_place_of_a_volume_is_not_recorded_and_its_name_may_change(name: str) -> None:
    Path("scans").mkdir()
    np.save(Path("scans", name), np.arange(2048, dtype=np.uint8).reshape(8, 16, 16))
    assert golden("--quiet", "--volume", f"scans/{name}") == 0
    data, before = golden_json(), files()
    assert b"scans" not in before["golden.json"][0]
    assert data["volume"]["name"].isprintable() and "file" not in data["scene"]["volume"]
    os.rename(f"scans/{name}", "moved.npy")
    assert golden("--update", "--quiet", "--volume", "moved.npy") == 0, "nothing changes"
    assert files() == before
