"""What a user reads about a sidecar from which a film cannot be made again, from `check` and `render` alike."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hsplat_cli import main

Edit = Callable[[dict[str, Any]], object]

CASES: dict[str, tuple[Edit, list[str], str]] = {
    "a wrong value": (
        lambda data: data["scene"]["camera"]["path"].update(frames="six"),
        [],
        """\
film.mp4.json: scene.camera.path.frames: not a whole number
  got: 'six'
  expected: a whole number from 1 to 1000000
""",
    ),
    "a tolerance for no frame": (
        lambda data: data["scene"]["error"]["tolerance"].update({"9": 0.1}),
        [],
        """\
film.mp4.json: scene.error.tolerance.9: after the last frame
  got: 9
  expected: a frame from 0 to 5
""",
    ),
    "no fingerprint": (
        lambda data: data["volume"].update(fingerprint="\x1b[31m"),
        [],
        """\
film.mp4.json: volume.fingerprint: not a fingerprint
  got: '\\x1b[31m'
  expected: 32 hexadecimal digits
""",
    ),
    "no scene": (
        lambda data: data.update(scene=[1]),
        [],
        """\
film.mp4.json: scene: not a mapping
  got: [1]
  expected: a mapping
""",
    ),
    "several mistakes": (
        lambda data: (
            data.update(gl=3, frames=[], versions=None, schedule={"asked": {"measure": 3}}),
            data["volume"].pop("fingerprint"),
            data["scene"]["output"].update(size=[3, 3]),
        ),
        ["--set", "camera.near=-1"],
        """\
film.mp4.json: volume.fingerprint: missing
  expected: 32 hexadecimal digits
film.mp4.json: gl: not text
  got: 3
  expected: text
film.mp4.json: versions: no value
  expected: a mapping
film.mp4.json: schedule.asked.measure: unknown value
  got: 3
  expected: optical or rms
film.mp4.json: frames: empty
  got: []
  expected: the records of the frames, each with its number as frame
film.mp4.json: scene.output.size: odd sizes cannot be encoded as MP4
  got: [3, 3]
  expected: even numbers
  hint: the nearest is [4, 4]
--set camera.near=-1: camera.near: out of range
  got: -1
  expected: a number from 0 to 1e+30
""",
    ),
    "a frame without a number": (
        lambda data: data["frames"][2].pop("frame"),
        [],
        """\
film.mp4.json: frames.2.frame: missing
  expected: a whole number from 0 to 999999
""",
    ),
    "no record of a frame": (
        lambda data: data["frames"].insert(1, 7),
        [],
        """\
film.mp4.json: frames.1: not a mapping
  got: 7
  expected: a mapping with frame
""",
    ),
    "frames out of order": (
        lambda data: data["frames"].reverse(),
        [],
        """\
film.mp4.json: frames.1.frame: frames out of order
  got: 4 after 5
  expected: frames in ascending order, each once
""",
    ),
    "a frame twice": (
        lambda data: data["frames"].insert(1, data["frames"][0]),
        [],
        """\
film.mp4.json: frames.1.frame: frames out of order
  got: 0 after 0
  expected: frames in ascending order, each once
""",
    ),
    "a frame after the path": (
        lambda data: data["frames"].append({"frame": 6}),
        [],
        """\
film.mp4.json: frames.6.frame: after the last frame
  got: 6
  expected: a frame from 0 to 5
""",
    ),
    "endless levels": (
        lambda data: data["schedule"].update(passes=json.loads("[" * 90 + "]" * 90)),
        [],
        """\
film.mp4.json: schedule: too many levels
  expected: at most 10
""",
    ),
    "a second schedule": (
        lambda data: None,
        ["--set", "error.splats=1000"],
        """\
--set error.splats=1000: error.splats: a second schedule beside tolerance
  expected: one of tolerance, splats, seconds, psnr or rmse
  hint: leave one out, as --set error.tolerance=null does
""",
    ),
    "a film in its place": (
        lambda data: None,
        ["--set", "error.tolerance=0.2"],
        """\
film.mp4.json: this would overwrite the recorded film
  hint: --output names another file
""",
    ),
    "a film of another volume in its place": (
        lambda data: None,
        ["--set", "volume.procedural.shape=[8, 8, 9]"],
        """\
film.mp4.json: this would overwrite the recorded film
  hint: --output names another file
""",
    ),
    "a part in its place": (
        lambda data: None,
        ["--frames", "1:3"],
        """\
film.mp4.json: this would overwrite the recorded film
  hint: --output names another file
""",
    ),
    "a frame that is not there": (
        lambda data: (data["frames"].__delitem__(slice(1, None, 2)), data["schedule"].update(asked={"splats": 9})),
        ["--frames", "2:4", "--output", "part.mp4"],
        """\
--frames: frame 3 is not in the film
  got: '2:4'
  expected: frames of 0:5:2
""",
    ),
    "a frame that was left out": (
        lambda data: (data["frames"].pop(2), data["schedule"].update(asked={"splats": 9})),
        ["--frames", "2", "--output", "part.mp4"],
        """\
--frames: frame 2 is not in the film
  got: '2'
  expected: frames of [0, 1, 3, 4, 5]
""",
    ),
    "a still of several frames": (
        lambda data: None,
        ["--frames", "2:4", "--output", "still.png"],
        """\
--output still.png: output.file: frames need a number in their names
  got: 'still.png'
  expected: a .mp4 or .gif, frames such as frames/{frame:04}.png or, for one frame (--frames 7), still.png
  hint: write still-{frame:04}.png
""",
    ),
    "a volume that is gone": (
        lambda data: data["scene"].update(volume={"file": "/nowhere/scan.npy"}),
        [],
        """\
film.mp4.json: scene.volume.file: no such file
  got: /nowhere/scan.npy
  expected: an NRRD, MetaImage, NIfTI, TIFF or .npy file, or a folder of DICOM or TIFF slices
  hint: if it was moved, --volume names it
""",
    ),
    "a raw volume that is gone": (
        lambda data: data["scene"].update(
            volume={"raw": {"file": "/nowhere/scan.raw", "shape": [1, 1, 1], "dtype": "uint8"}}
        ),
        [],
        """\
film.mp4.json: scene.volume.raw.file: no such file
  got: /nowhere/scan.raw
  expected: a file of voxels without a header
  hint: if it was moved, --set volume.raw.file=FILE names it
""",
    ),
}

NOT_JSON = {
    "cut off": (
        b'{\n  "scene": {\n    "version": 1,\n    "volu',
        """\
film.mp4.json:4:5: not valid JSON
    | "volu
    | ^
  hint: a sidecar is written as a whole: this one was cut off, or changed since
""",
    ),
    "changed by hand": (
        b'{"scene": {"version": 1},}',
        None,  # the column depends on the version of Python
    ),
    "a key twice": (
        b'{"scene": {"camera": {"path": {"frames": 6, "frames": 7}}}, "frames": [{}, {"frame": 0, "frame": 1}]}',
        """\
film.mp4.json: scene.camera.path.frames: the same key twice
film.mp4.json: frames.1.frame: the same key twice
""",
    ),
    "numbers that are none": (
        b'{"scene": {"camera": {"near": NaN, "distance": -Infinity}}, "frames": [{"frame": 1e999}], "n": '
        + b"9" * 5000
        + b"}",
        f"""\
film.mp4.json: scene.camera.near: not a finite number
  got: NaN
film.mp4.json: scene.camera.distance: not a finite number
  got: -Infinity
film.mp4.json: frames.0.frame: not a finite number
  got: '1e999'
film.mp4.json: n: not a finite number
  got: '{"9" * 56}...
""",
    ),
    "endless levels": (
        b'{"scene": ' + b"[" * 200_000,
        "film.mp4.json: not valid JSON: too many levels\n",
    ),
    "other bytes": (
        b'{"scene": {\n"output": "\xff"}}',
        "film.mp4.json:2: not a text file in UTF-8\n  got: the byte 0xff\n  hint: save it in UTF-8\n",
    ),
}  # fmt: skip


@pytest.fixture
def sidecar(scene_folder: Path) -> Path:
    """That of a small film in the current folder, whose other files are those of `scene_folder`."""
    small = ["camera.path.frames=6", "output.size=[32, 32]", "volume.procedural.shape=[8, 8, 8]"]
    small += ["output.file=film.mp4", "error.tolerance={0: 0.5, 5: 0.1}"]
    options = [word for change in small for word in ("--set", change)]
    assert main.run(["render", "scene.yaml", "--quiet", *options]) == 0
    return scene_folder / "film.mp4.json"


def refused(capsys: pytest.CaptureFixture[str], command: str, *arguments: str) -> str:
    """What is said, by a command that changes no file."""
    before = {path: path.read_bytes() for path in Path.cwd().rglob("*") if path.is_file()}
    capsys.readouterr()
    assert main.run([command, "film.mp4.json", *arguments]) == 2
    assert {path: path.read_bytes() for path in Path.cwd().rglob("*") if path.is_file()} == before
    said = capsys.readouterr()
    assert said.out == ""
    return said.err


@pytest.mark.parametrize("name", CASES)
def test_check_and_render_refuse_alike(name: str, sidecar: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edit, arguments, message = CASES[name]
    data = json.loads(sidecar.read_text(encoding="utf-8"))
    edit(data)
    sidecar.write_text(json.dumps(data), encoding="utf-8")
    assert refused(capsys, "check", *arguments) == message
    assert refused(capsys, "render", *arguments) == message


@pytest.mark.parametrize("name", NOT_JSON)
def test_what_is_no_json(name: str, scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    content, message = NOT_JSON[name]
    (scene_folder / "film.mp4.json").write_bytes(content)
    text = refused(capsys, "render")
    assert text == message or (message is None and text.startswith("film.mp4.json:1:2"))


def test_another_volume(sidecar: Path, scene_folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Which only its voxels show: `check` reads none."""
    np.save("other.npy", np.zeros((8, 8, 8), np.uint8))
    fingerprint = json.loads(sidecar.read_text(encoding="utf-8"))["volume"]["fingerprint"]
    assert main.run(["check", "film.mp4.json", "--volume", "other.npy"]) == 0
    text = refused(capsys, "render", "--volume", "other.npy", "--quiet")
    first, got, *rest = text.replace(str(scene_folder), "/scans").splitlines()
    assert first == "film.mp4.json: volume.fingerprint: the film was made from another volume"
    assert got.startswith("  got: the fingerprint ")
    assert got.endswith(" of /scans/other.npy")
    assert rest == [
        f"  expected: {fingerprint}",
        "  hint: if the volume was moved, name it with --volume; draw another volume with another scene",
    ]
