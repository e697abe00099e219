"""Parts that several jobs have drawn, put together: the bytes of one job's film, and a sidecar that makes it again."""

from __future__ import annotations

import contextlib
import shlex
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from resuming import modification_times
from small_scene import edit_sidecar, sidecar, small_scene

from hsplat_cli import main
from renderer.film import bytes_digest, encode_png
from renderer.job import OutputWriter, open_output
from renderer.system import package_versions

pytestmark = pytest.mark.usefixtures("scene_folder")

SCENE = small_scene(frames=7)
# Of one run, its clock and its machine, or of the place of the file.
OWN = ("seconds", "digest", "parts", "memory")


@pytest.fixture(scope="module")
def template(module_folder: Path) -> Path:
    """Return a folder with the film of SCENE and its three parts."""
    Path("scene.yaml").write_text(SCENE, encoding="utf-8")
    draw_parts()
    return module_folder


@pytest.fixture
def parts(folder: Path, template: Path) -> None:
    """Copy the parts of SCENE to the current folder."""
    shutil.copytree(template / "parts", "parts")


def run(*arguments: str, code: int = 0) -> None:
    assert main.run([*arguments, "--quiet"]) == code


def draw_parts(*options: str, ranges: tuple[str, ...] = ("0:3", "3:4", "4:7")) -> None:
    for frames in ranges:
        run("render", "scene.yaml", *options, "--frames", frames, "--output", "parts/{frame:04}.png")


def told(path: str) -> dict[str, Any]:
    """What does not depend on the run, nor on whether exact rays measured the encoded file."""
    data = sidecar(path)
    data.get("accuracy", {}).pop("file", None)
    data["scene"]["output"]["file"] = ""
    for frame in data["frames"]:
        del frame["seconds"]
    return {key: value for key, value in data.items() if key not in OWN}


@pytest.mark.parametrize(
    ("output", "schedule"),
    [
        ("film.mp4", "{tolerance: {0: 0.5, 6: 0.02}, probes: 16}"),
        ("{frame}.png", "{splats: {0: 1, 6: 100}, probes: 16}"),
    ],
)
def test_as_if_made_in_one_go(schedule: str, output: str, folder: Path) -> None:
    options = ("--set", f"error={schedule}")
    run("render", "scene.yaml", *options, "--output", f"whole/{output}")
    draw_parts(*options)
    run("assemble", "parts", "--output", f"made/{output}")
    whole = {path.name: path.read_bytes() for path in Path("whole").iterdir() if path.suffix != ".json"}
    made = {path.name: path.read_bytes() for path in Path("made").iterdir() if path.suffix != ".json"}
    assert made == whole
    name = "frames.json" if "png" in output else f"{output}.json"
    assert told(f"made/{name}") == told(f"whole/{name}")
    for path in made:
        (Path("made") / path).unlink()
    run("render", f"made/{name}")
    assert {path: (Path("made") / path).read_bytes() for path in made} == whole


def test_some_of_the_frames_at_another_rate_and_quality(parts: None) -> None:
    changed = ("--set", "output.frames_per_second=12", "--set", "output.quality=3")
    run("render", "scene.yaml", "--frames", "1:6:2", *changed, "--output", "whole.mp4")
    options = ("--frames-per-second", "12", "--quality", "3", "--frames", "1:6:2")
    run("assemble", "parts", "--output", "made.mp4", *options)
    assert Path("made.mp4").read_bytes() == Path("whole.mp4").read_bytes()
    assert told("made.mp4.json") == told("whole.mp4.json")


def test_other_versions_are_noted(parts: None, capsys: pytest.CaptureFixture[str]) -> None:
    """So are notes of the parts, once each, except those about a part alone."""
    path, notes = "parts/frames.4-6.json", ["nobody was there", "nobody was there"]
    here = sidecar(path)["device"]
    edit_sidecar(path, lambda data: data.update(device="Other GL", notes=notes))
    assert main.run(["assemble", "parts", "--output", "film.mp4"]) == 0
    note = f"bytes may differ from part to part, drawn with different versions: device {here} and Other GL"
    first, rest = capsys.readouterr().out.split("\n", 1)
    assert first.startswith("film.mp4: 7 frames of 3 parts, ") and " before encoding, frames flicker " in first
    assert rest == f"note: {note}\nnote: nobody was there\nhow it was made: film.mp4.json\n"
    made = sidecar("film.mp4.json")
    assert made["notes"] == [note, "nobody was there"]
    assert made["device"] == f"{here} and Other GL"


def test_the_command_for_what_is_missing_draws_it(capsys: pytest.CaptureFixture[str]) -> None:
    """It needs only the sidecars, and no scene file."""
    schedule = "{splats: {0: 1, 6: 100}, probes: 16}"
    run("render", "scene.yaml", "--set", f"error={schedule}", "--output", "whole.mp4")
    draw_parts("--set", f"error={schedule}", ranges=("0:3", "5:7"))
    Path("scene.yaml").unlink()
    capsys.readouterr()
    run("assemble", "parts", "--output", "made.mp4", code=2)
    command = shlex.split(capsys.readouterr().err.splitlines()[-1])
    assert command[0] == "hsplat"
    run(*command[1:])
    run("assemble", "parts", "--output", "made.mp4")
    assert Path("made.mp4").read_bytes() == Path("whole.mp4").read_bytes()


@pytest.mark.parametrize(
    ("output", "schedule"), [("film.mp4", "{psnr: 20, probes: 16}"), ("{frame}.png", "{seconds: 1, probes: 16}")]
)
def test_what_was_put_together_is_up_to_date(output: str, schedule: str, capsys) -> None:
    """This holds for `assemble`, the scene and the sidecar, also where the parts are gone."""
    draw_parts("--set", f"error={schedule}")
    run("assemble", "parts", "--output", f"made/{output}")
    Path("parts").rename("before")
    before = modification_times(".")
    capsys.readouterr()
    name = "frames.json" if "png" in output else f"{output}.json"
    shutil.copytree("before", "parts", ignore=shutil.ignore_patterns("*.png"))
    assert main.run(["assemble", "parts", "--output", f"made/{output}"]) == 0
    assert capsys.readouterr().err == f"made/{output} is up to date; --force assembles it again\n"
    shutil.rmtree("parts")
    for scene in (["scene.yaml", "--set", f"error={schedule}", "--output", f"made/{output}"], [f"made/{name}"]):
        assert main.run(["render", *scene]) == 0
        assert capsys.readouterr().err == f"made/{output} is up to date; --force draws it again\n"
    assert modification_times(".") == before


def says_up_to_date(capsys: pytest.CaptureFixture[str], *arguments: str) -> bool:
    capsys.readouterr()
    assert main.run([*arguments]) == 0
    return "up to date" in capsys.readouterr().err


def test_a_part_that_was_drawn_again(parts: None, capsys: pytest.CaptureFixture[str]) -> None:
    """Frames of the same fingerprint differ where they depend on the clock."""
    command = ("assemble", "parts", "--output", "film.mp4")
    run(*command)
    other = encode_png(np.zeros((32, 32, 3), np.uint8))
    Path("parts/0001.png").write_bytes(other)
    edit_sidecar("parts/frames.0-2.json", lambda data: data["frames"][1].update(digest=bytes_digest(other)))
    before = Path("film.mp4").read_bytes()
    assert not says_up_to_date(capsys, *command)
    assert Path("film.mp4").read_bytes() != before
    assert says_up_to_date(capsys, *command)


def test_whether_a_film_exists_is_seen_under_the_lock(parts: None, monkeypatch: pytest.MonkeyPatch) -> None:
    run("assemble", "parts", "--output", "film.mp4")

    @contextlib.contextmanager
    def taken(*arguments: Any, **options: Any) -> Iterator[OutputWriter]:
        Path("film.mp4").unlink()
        with open_output(*arguments, **options) as output:
            yield output

    monkeypatch.setattr("renderer.job.assemble.assembly.open_output", taken)
    run("assemble", "parts", "--output", "film.mp4")
    assert Path("film.mp4").exists()


@pytest.mark.parametrize(("output", "is_same"), [("film.mp4", False), ("{frame}.png", True)])
def test_another_encoder(parts: None, output: str, is_same: bool, monkeypatch, capsys) -> None:
    """It makes another film of the same pictures, which is up to date for itself and not for the scene."""
    command = ("assemble", "parts", "--output", f"made/{output}")
    run(*command)
    other = package_versions() | {"imageio-ffmpeg": "another"}
    with monkeypatch.context() as patch:
        patch.setattr("renderer.job.assemble.merged_record.package_versions", lambda: other)
        assert says_up_to_date(capsys, *command) == is_same
        assert says_up_to_date(capsys, *command)
    assert says_up_to_date(capsys, "render", "scene.yaml", "--output", f"made/{output}") == is_same


@pytest.mark.parametrize(
    "edit",
    [
        lambda data: data.pop("fingerprint"),
        lambda data: data["fingerprint"].update(frames_digest="0" * 32),
        lambda data: data["fingerprint"]["depends_on"].update(device="another"),
    ],
)
def test_parts_without_the_same_fingerprint(parts: None, edit: Callable[[dict[str, Any]], Any]) -> None:
    """Their film is like any other, but it is never known to be up to date."""
    edit_sidecar("parts/frames.0-2.json", edit)
    run("assemble", "parts", "--output", "film.mp4")
    assert "fingerprint" not in sidecar("film.mp4.json")


def test_some_frames_of_parts_that_met_a_goal_together() -> None:
    """Whether these alone meet it is unknown. The measurement of each part is recorded."""
    draw_parts("--set", "error={psnr: 20, probes: 16}", ranges=("0:3", "3:7"))
    run("assemble", "parts", "--output", "film.mp4", "--frames", "3:7")
    assert "fingerprint" in sidecar("film.mp4.json")
    run("assemble", "parts", "--output", "film.mp4", "--frames", "2:7")
    assert [part["measured"]["worst"] >= 20 for part in sidecar("film.mp4.json")["parts"]] == [True, True]
    assert "fingerprint" not in sidecar("film.mp4.json")
