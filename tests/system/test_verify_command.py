"""Tests of `hsplat verify` on whole films, and on films that are spoiled in every way that it has to find."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from small_scene import edit_sidecar, small_scene

from hsplat_cli import main
from renderer.film import bytes_digest, file_digest

NUM_FRAMES = 9
NUM_PIXELS = 32 * 24
FILMS = {"film.mp4": "film.mp4.json", "film.gif": "film.gif.json", "still.png": "still.png.json"}
TEMPLATE, FRAMES = "frames/{frame:02}.png", "frames/frames.json"


def waves() -> Any:
    z, y, x = np.indices((20, 24, 24))
    return (127 + 60 * np.sin(x / 2) + 60 * np.cos(y / 3 + z / 4)).astype(np.uint8)


@pytest.fixture(scope="module")
def originals(module_folder: Path) -> Path:
    """Draw the films, of which each test has copies, and the volume, which stays in its place."""
    np.save("scan.npy", waves())
    scene = small_scene(frames=NUM_FRAMES, size="32, 24", volume="file: scan.npy")
    Path("scene.yaml").write_text(scene, encoding="utf-8")
    for film in (*FILMS, TEMPLATE):
        frames = ("--frames", "4") if film == "still.png" else ()
        assert main.run(["render", "scene.yaml", "--quiet", "--output", film, *frames]) == 0
    return module_folder


@pytest.fixture(autouse=True)
def films(originals: Path, folder: Path) -> Path:
    shutil.copytree(originals, folder, dirs_exist_ok=True)
    return folder


def files() -> dict[Path, bytes]:
    return {path: path.read_bytes() if path.is_file() else b"" for path in Path().rglob("*")}


def verify(*arguments: str, code: int) -> None:
    """Run the command, which writes nothing, and leaves no file or folder."""
    before = files()
    assert main.run(["verify", *arguments]) == code
    assert files() == before


def problems(film: str, capsys: pytest.CaptureFixture[str]) -> list[str]:
    """Return the first words of the problems of a film that has some, which few rays find."""
    capsys.readouterr()
    verify(film, "--precision", "3", "--json", "-", code=1)
    found = json.loads(capsys.readouterr().out)
    assert found["passes"] is False
    return [problem["what"] for problem in found["problems"]]


def replace_frame(number: int, content: bytes, *, with_digest: bool = True) -> None:
    Path(f"frames/{number:02}.png").write_bytes(content)
    if with_digest:
        edit_sidecar(FRAMES, lambda data: data["frames"][number].update(digest=bytes_digest(content)))


def swap_frames(one: int, two: int, *, with_digests: bool) -> None:
    contents = [Path(f"frames/{number:02}.png").read_bytes() for number in (one, two)]
    for number, content in zip((two, one), contents, strict=True):
        replace_frame(number, content, with_digest=with_digests)


# Films that are right


@pytest.mark.parametrize("film", [*FILMS, *FILMS.values(), TEMPLATE, FRAMES])
def test_a_film_that_is_right(film: str, capsys: pytest.CaptureFixture[str]) -> None:
    verify(film, "--precision", "3", code=0)
    out = capsys.readouterr().out
    num = "1 frame" if "still" in film else f"{NUM_FRAMES} frames"
    assert f": whole, {num}; of this volume; " in out.splitlines()[0]
    assert "; file PSNR " in out.splitlines()[0]


def test_nothing_is_printed_of_a_film_that_is_right(capsys: pytest.CaptureFixture[str]) -> None:
    verify("still.png", "--quiet", code=0)
    assert capsys.readouterr() == ("", "")


def test_the_result_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    verify("film.mp4", "--seed", "3", "--json", "-", code=0)
    printed = json.loads(capsys.readouterr().out)
    assert main.run(["verify", "film.mp4", "--seed", "3", "--json", "result.json", "--quiet"]) == 0
    assert json.loads(Path("result.json").read_text()) == printed
    assert printed["passes"] and printed["problems"] == []
    assert (printed["frames"], printed["measured_frames"]) == (NUM_FRAMES, NUM_FRAMES)
    accuracy = printed["accuracy"]
    assert accuracy["seed"] == 3 and accuracy["rays"] >= 64 * NUM_FRAMES
    assert not printed["is_precise"] or accuracy["interval"][1] - accuracy["interval"][0] <= 1.0


@pytest.mark.slow
def test_rays_are_added_until_the_film_is_known_well_enough(capsys: pytest.CaptureFixture[str]) -> None:
    rays = []
    for precision in ("30", "0.5", "0.01"):
        verify("film.mp4", "--precision", precision, "--json", "-", code=0)
        found = json.loads(capsys.readouterr().out)
        rays.append(found["accuracy"]["rays"])
        assert found["is_precise"] == (precision != "0.01")
    assert rays[0] == 64 * NUM_FRAMES < rays[1] < rays[2] == NUM_PIXELS * NUM_FRAMES
    assert f"{NUM_PIXELS} rays a frame, the most there are, do not reach 0.01 dB" in found["notes"]


def test_other_versions_are_a_note(capsys: pytest.CaptureFixture[str]) -> None:
    edit_sidecar("film.mp4.json", lambda data: data["versions"].update(numpy="0.1"))
    verify("film.mp4", code=0)
    assert "note: drawn by other versions than these: numpy " in capsys.readouterr().out


# Not whole


@pytest.mark.parametrize("film", ["film.mp4", "film.gif"])
@pytest.mark.parametrize("has_digest", [True, False])
def test_a_film_that_is_cut_off(film: str, has_digest: bool, capsys: pytest.CaptureFixture[str]) -> None:
    path = Path(film)
    path.write_bytes(path.read_bytes()[:-100])
    if has_digest:
        edit_sidecar(FILMS[film], lambda data: data.update(digest=file_digest(path)))
    found = problems(film, capsys)
    assert found[-1] in ("the film cannot be decoded", "a GIF file that is cut off, or followed by other data")
    assert found[:-1] == ([] if has_digest else ["not the file that its sidecar describes"])


def test_a_film_of_another_length_or_size(capsys: pytest.CaptureFixture[str]) -> None:
    for change, what in (
        (("--frames", "0:8"), "a film with fewer frames"),
        (("--set", "output.size=[24, 32]"), "a film of another size"),
    ):
        assert main.run(["render", "scene.yaml", "--quiet", "--output", "other.mp4", *change]) == 0
        shutil.copy("other.mp4", "film.mp4")
        edit_sidecar("film.mp4.json", lambda data: data.update(digest=file_digest(Path("film.mp4"))))
        assert problems("film.mp4", capsys) == [what]


# Other pictures


@pytest.mark.slow
def test_pictures_that_were_swapped(capsys: pytest.CaptureFixture[str]) -> None:
    """By their digests and, where these were swapped, too, by rays."""
    swap_frames(2, 6, with_digests=False)
    assert {f"not the picture of frame {k}" for k in (2, 6)} <= set(problems(FRAMES, capsys))
    swap_frames(2, 6, with_digests=False)
    verify(FRAMES, code=0)
    swap_frames(2, 6, with_digests=True)
    found = problems(FRAMES, capsys)
    assert found[-2:] == [f"frame {k} is not the picture that was recorded" for k in (2, 6)]
    edit_sidecar(FRAMES, lambda data: [data.pop("accuracy"), [frame.pop("accuracy") for frame in data["frames"]]])
    assert problems(FRAMES, capsys) == [f"frame {k} is far less exact than others" for k in (2, 6)]


@pytest.mark.parametrize("film", ["film.mp4", "film.gif", pytest.param(FRAMES, marks=pytest.mark.slow)])
def test_a_film_of_another_scene(film: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Its sidecar says another scene than that of its fingerprint; without a fingerprint, rays tell."""
    path = FILMS.get(film, film)

    def edit(data: dict[str, Any]) -> None:
        data["scene"]["transfer_function"]["points"][1].update(opacity=0.9, color="#ff0000")
        data["scene"]["transfer_function"]["points"][2].update(color="#00ff00")

    edit_sidecar(path, edit)
    found = problems(film, capsys)
    assert found[0] == "its scene is not the one that was drawn"
    assert found[1] == "far less exact than recorded"
    edit_sidecar(path, lambda data: data.pop("fingerprint"))
    assert problems(film, capsys)[0] == "far less exact than recorded"


# Not to be verified


def test_the_volume_and_its_fingerprint_replaced(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    """The film is not that of the volume which the sidecar names, as its fingerprint and rays tell."""
    np.save("other.npy", 255 - waves())
    assert main.run(["render", "scene.yaml", "--quiet", "--volume", "other.npy", "--output", "o/{frame}.png"]) == 0
    other = json.loads(Path("o/frames.json").read_text())

    def edit(data: dict[str, Any]) -> None:
        data["volume"] = other["volume"]
        data["scene"]["volume"]["file"] = str(folder / "other.npy")

    edit_sidecar(FRAMES, edit)
    assert problems(FRAMES, capsys)[:2] == ["its scene is not the one that was drawn", "far less exact than recorded"]
