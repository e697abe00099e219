"""What a user reads about goldens: what an update changes, why one is refused, what golden.json should be."""

from __future__ import annotations

import json
import os
import pty
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hsplat_cli import main
from hsplat_cli.compare.golden.provenance import Golden, Provenance
from hsplat_cli.compare.golden.update_plan import GoldenChange, GoldenUpdate, describe_update
from renderer.film import encode_png
from renderer.study import COMPARISON_METRICS

FORMAT = "hsplat golden 1"
DIGEST = "0" * 32
ORIGIN: dict[str, Any] = {
    "volume": {"name": "engine_block", "fingerprint": DIGEST, "shape": [8, 8, 8], "dtype": "uint8"},
    "gl": "llvmpipe",
    "scene": {"error": {"tolerance": 0.1}},
    "versions": {"numpy": "2.1.0"},
}
PROVENANCE: dict[str, Any] = {
    "format": FORMAT,
    **ORIGIN,
    "frames": [{"frame": number, "file": f"frame-000{number}.png", "digest": DIGEST} for number in range(2)],
}
SMALL = [
    "--set", "camera.path.frames=2", "--set", "output.size=[32, 32]", "--set", "volume.procedural.shape=[8, 8, 8]",
]  # fmt: skip


class Command:
    """Runs `hsplat golden` on a small variant of the scene."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *arguments: str, scene: str = "scene.yaml") -> tuple[int, str, str]:
        """Exit code and what was said, but for the progress."""
        code = main.run(["golden", scene, "goldens", *SMALL, *arguments])
        captured = self._capsys.readouterr()
        lines = captured.err.splitlines(keepends=True)
        return code, captured.out, "".join(line for line in lines if "frames/s" not in line and "compiling" not in line)


@pytest.fixture
def golden(scene_folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Command:
    monkeypatch.delenv("CI", raising=False)
    return Command(capsys)


@pytest.fixture
def keep(scene_folder: Path) -> Callable[..., None]:
    """Write the folder of goldens, without a picture; values are of golden.json."""

    def write(**values: Any) -> None:
        Path("goldens").mkdir(exist_ok=True)
        Path("goldens/golden.json").write_text(json.dumps(PROVENANCE | values), encoding="utf-8")

    return write


def provenance(*frames: int, **origin: Any) -> Provenance:
    return Provenance({**ORIGIN, **origin}, tuple(Golden(frame, f"frame-{frame:04}.png", DIGEST) for frame in frames))


def figures(largest: float, densest: float, p99: float, bias: float) -> Mapping[str, float]:
    return {"largest": largest, "densest": densest, "p99": p99, "bias": bias}


def test_what_an_update_changes() -> None:
    plan = GoldenUpdate(
        before=provenance(0, 1, 2, 3, 7, 8),
        after=provenance(0, 1, 2, 3, 4, 8, gl="softpipe", versions={"numpy": "2.2.0"}),
        changes=(
            GoldenChange("frame-0004.png", Path(), "is new"),
            GoldenChange("frame-0003.png", Path(), "changes from 32 x 32 RGB to 36 x 32 RGBA"),
            GoldenChange("frame-0001.png", Path(), figures=figures(41, 9.3084, 12, 1.25)),
            GoldenChange("frame-0000.png", Path(), figures=figures(1, 0.0052, 0, 0.00031)),
        ),
        removed=(Golden(7, "frame-0007.png", DIGEST),),
        unrequested=(Golden(8, "frame-0008.png", DIGEST),),
    )
    assert "\n".join(describe_update(plan)) == (
        f"""\
4 of 5 frames change:
  frame-0004.png is new
  frame-0003.png changes from 32 x 32 RGB to 36 x 32 RGBA
  levels, worst first   largest   densest       p99      bias
  frame-0001.png             41      9.31        12      1.25
  frame-0000.png              1    0.0052         0   0.00031
  largest: {COMPARISON_METRICS["largest"].label}
  densest: {COMPARISON_METRICS["densest"].label}
  p99: {COMPARISON_METRICS["p99"].label}
  bias: {COMPARISON_METRICS["bias"].label}
to be removed, because not requested: frame-0007.png
not requested, and kept (--prune removes them): frame-0008.png
changed since they were rendered: gl was 'llvmpipe'; versions.numpy was '2.1.0'"""
    )


@pytest.mark.parametrize(
    ("after", "removed", "text"),
    [
        (provenance(0, versions={}), (), "no pixel of 1 frame changes\nchanged since they were rendered: "
         "versions.numpy was '2.1.0'"),
        (provenance(0, 1), (), "no pixel of 2 frames changes\n"
         "golden.json changes: the files differ from those it lists"),
        (provenance(0), provenance(*range(1, 8)).goldens, "no pixel of 1 frame changes\n"
         "to be removed, because not requested: frame-0001.png, frame-0002.png, frame-0003.png, frame-0004.png, "
         "frame-0005.png and 2 more"),
    ],
)  # fmt: skip
def test_an_update_without_pixels(after: Provenance, removed: tuple[Golden, ...], text: str) -> None:
    plan = GoldenUpdate(provenance(0), after, (), removed, ())
    assert "\n".join(describe_update(plan)) == text


def test_a_life_of_goldens(golden: Command, monkeypatch: pytest.MonkeyPatch) -> None:
    assert golden() == (0, "goldens: 2 goldens\norigin: goldens/golden.json\n", "")
    assert golden() == (
        2,
        "",
        "goldens: the folder has goldens\n"
        "  got: 2 frames\n"
        "  hint: --update shows what has changed and overwrites them; `hsplat compare SCENE FOLDER` compares\n",
    )
    assert golden("--update") == (0, "goldens: nothing changes\n", "")
    dark = np.zeros((32, 32, 3), np.uint8)
    Path("goldens/frame-0001.png").write_bytes(encode_png(dark))
    changed = "1 of 2 frames changes:\n  levels, worst first   largest   densest       p99      bias\n  frame-0001.png"
    with open(os.devnull, encoding="utf-8") as nothing:
        monkeypatch.setattr(sys, "stdin", nothing)
        code, out, err = golden("--update")
    assert (code, out.startswith(changed)) == (2, True)
    assert err == (
        "--update: goldens are not overwritten without a question, and nobody can answer\n"
        "  got: the standard input is not a terminal\n"
        "  hint: --yes overwrites them without one\n"
    )
    monkeypatch.setenv("CI", "true")
    assert golden("--update")[2] == err.replace("the standard input is not a terminal", "CI is set in the environment")
    code, out, err = golden("--update", "--yes")
    assert (code, out.startswith(changed), err) == (0, True, "")
    assert out.endswith("\ngoldens: 1 of 2 goldens written\norigin: goldens/golden.json\n")


@pytest.mark.parametrize(("answer", "code", "end"), [("y", 0, "golden.json\n"), ("n", 1, "nothing was written\n")])
def test_the_question(golden: Command, answer: str, code: int, end: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert golden()[0] == 0
    keyboard, terminal = pty.openpty()
    with open(keyboard, "w", encoding="utf-8") as keys, open(terminal, encoding="utf-8") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        keys.write(f"{answer}\n")
        keys.flush()
        found, out, _ = golden("--update", "--set", "transfer_function.points.2.color=red")
    assert found == code
    assert "\nOverwrite the goldens? [y/N]: " in out
    assert out.endswith(end)


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--yes"], "--yes: of no use without --update\n"),
        (["--prune"], "--prune: of no use without --update\n"),
        (
            ["--date", "a\nb"],
            "--date: not a date that can be recorded\n  got: 'a\\nb'\n"
            "  expected: one line of at most 200 characters, such as 2026-11-21\n",
        ),
        (
            ["--frames", "9"],
            "--frames: no frame is in this range\n  got: '9'\n"
            "  expected: A:B or A:B:STEP or one number; this path has the frames 0 to 1\n",
        ),
        (
            ["--set", "error={seconds: 1}"],
            "scene.yaml: error.seconds: frames within a time budget differ from run to run, and cannot be golden\n"
            "  hint: render a film, and give the JSON file beside it in place of the scene: it has tolerances\n",
        ),
        (
            ["--set", "error={psnr: 30}"],
            "scene.yaml: error.psnr: frames for an accuracy depend on the other frames, and cannot be"
            " golden\n"
            "  hint: render a film, and give the JSON file beside it in place of the scene: it has tolerances\n",
        ),
    ],
)
def test_options_that_cannot_be(golden: Command, options: list[str], text: str) -> None:
    assert golden(*options) == (2, "", text)
    assert not Path("goldens").exists()


def test_an_update_of_some_frames_of_another_scene(golden: Command) -> None:
    assert golden("--quiet")[0] == 0
    assert golden("--update", "--yes", "--quiet", "--frames", "0", "--set", "error.tolerance=0.2") == (
        2,
        "",
        "goldens: goldens of another origin would stay, and golden.json has one origin for all\n"
        "  got: scene.error.tolerance was 0.1\n"
        "  hint: update all frames, or remove the others by --prune: frame-0001.png\n",
    )


def test_a_file_of_somebody_else(golden: Command, scene_folder: Path) -> None:
    Path("goldens").mkdir()
    for number in range(2):
        Path(f"goldens/frame-000{number}.png").touch()
    assert golden() == (
        2,
        "",
        "goldens/frame-0000.png: a golden would overwrite a file that golden.json does not list\n"
        "  got: 2 such files\n  hint: move it elsewhere, or choose another folder\n",
    )


def test_a_folder_that_is_a_file(golden: Command) -> None:
    Path("goldens").touch()
    assert golden() == (2, "", "goldens/golden.json: the output folder is a file\n  got: goldens\n")


REFUSED: list[tuple[dict[str, Any], str]] = [
    (
        {"format": "hsplat golden 2"},
        "goldens/golden.json: not a record of goldens that this version of hsplat can read\n"
        "  got: format 'hsplat golden 2'\n  expected: format 'hsplat golden 1'\n"
        "  hint: `hsplat golden SCENE FOLDER` writes it; give it a folder without one\n",
    ),
    (
        {"gl": "\x1b[2J", "frames": []},
        "goldens/golden.json: gl: not a line of text\n  got: '\\x1b[2J'\n"
        "  expected: one line of at most 200 characters\n"
        "goldens/golden.json: frames: no golden frames\n  got: []\n"
        "  expected: a list of frames, each with frame, file and digest\n",
    ),
    (
        {"frames": [{"frame": 3, "file": "../x.png", "digest": DIGEST}]},
        "goldens/golden.json: frames.0.file: not the file of this frame\n  got: '../x.png'\n"
        "  expected: frame-0003.png\n",
    ),
    (
        {"frames": [{"frame": 3, "file": "frame-0003.png", "digest": "?"}]},
        "goldens/golden.json: frames.0.digest: not a digest\n  got: '?'\n  expected: 32 hexadecimal digits\n",
    ),
    (
        {"frames": PROVENANCE["frames"][::-1]},
        "goldens/golden.json: frames.1.frame: frames out of order\n  got: 0 after 1\n"
        "  expected: frames in ascending order, each once\n",
    ),
    (
        {"x" * 2**20: 1},
        f"goldens/golden.json: '{'x' * 56}...: unknown key\n"
        "  expected: format, volume, gl, scene, versions or frames\n",
    ),
    (
        {"volume": {"name": "a"}},
        "goldens/golden.json: volume.fingerprint: missing\n  expected: 32 hexadecimal digits\n"
        "goldens/golden.json: volume.shape: missing\n  expected: three numbers of voxels\n"
        "goldens/golden.json: volume.dtype: missing\n  expected: one line of at most 200 characters\n",
    ),
]


@pytest.mark.parametrize(("values", "text"), REFUSED)
@pytest.mark.parametrize("command", ["golden", "compare"])
def test_a_golden_json_that_is_wrong(
    keep: Callable[..., None], command: str, values: dict[str, Any], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    keep(**values)
    assert main.run([command, "scene.yaml", "goldens"]) == 2
    assert capsys.readouterr() == ("", text)


def test_a_golden_json_that_was_cut_off(keep: Callable[..., None], capsys: pytest.CaptureFixture[str]) -> None:
    keep()
    Path("goldens/golden.json").write_text('{"format": "hsplat golden 1",\n  "frames": [', encoding="utf-8")
    assert main.run(["compare", "scene.yaml", "goldens"]) == 2
    assert capsys.readouterr().err == (
        'goldens/golden.json:2:14: not valid JSON\n    | "frames": [\n    |            ^\n'
        "  hint: golden.json is written as a whole: this one was cut off, or changed since\n"
    )


COMPARE: list[tuple[list[str], str]] = [
    (
        ["nowhere"],
        "nowhere: no such folder\n  hint: `hsplat golden SCENE nowhere` renders goldens and records their origin\n",
    ),
    (
        ["scan.nrrd"],
        "scan.nrrd: not a folder of goldens\n"
        "  hint: `hsplat golden SCENE scan.nrrd` renders goldens and records their origin\n",
    ),
    (
        ["frames"],
        "frames: no golden.json in this folder\n  got: 2 PNG files\n"
        "  hint: `hsplat golden SCENE frames` renders goldens and records their origin; a folder of frames is compared"
        " with another folder\n",
    ),
    (
        ["goldens", "--frames", "5"],
        "--frames: no goldens of these frames\n  got: 5\n  expected: frames listed in goldens/golden.json: 0, 1\n",
    ),
    (
        ["goldens", "--json", "goldens/golden.json"],
        "--json goldens/golden.json: a report would overwrite an input of the comparison\n",
    ),
]


@pytest.mark.parametrize(("arguments", "text"), COMPARE)
def test_what_cannot_be_compared(
    keep: Callable[..., None], arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    keep()
    Path("frames").mkdir()
    for name in ("a.png", "b.png", "c.txt"):
        (Path("frames") / name).touch()
    assert main.run(["compare", "scene.yaml", *arguments]) == 2
    assert capsys.readouterr() == ("", text)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (
            ["goldens", "scene.yaml"],
            "scene.yaml: the scene must come first, then the folder of its goldens\n"
            "  hint: hsplat compare scene.yaml goldens\n",
        ),
        (
            ["frames", "frames2", "--set", "a=1", "--workers", "2"],
            "--set: has no use unless a scene is drawn\n  got: frames and frames2\n",
        ),
    ],
)
def test_scenes_that_are_not_in_their_place(
    scene_folder: Path, arguments: list[str], text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.run(["compare", *arguments]) == 2
    assert capsys.readouterr() == ("", text)


def test_goldens_that_golden_json_has_lost(keep: Callable[..., None], capsys: pytest.CaptureFixture[str]) -> None:
    keep()
    for number in range(1, 6):
        Path(f"goldens/frame-000{number}.png").touch()
    assert main.run(["compare", "scene.yaml", "goldens"]) == 2
    assert capsys.readouterr().err == (
        "goldens: golden.json does not list all goldens in this folder\n"
        "  got: frame-0002.png, frame-0003.png, frame-0004.png and 1 more\n"
        "  hint: restore golden.json, or move pictures that are not golden elsewhere\n"
    )


def test_a_scene_that_has_none_of_the_frames(keep: Callable[..., None], capsys: pytest.CaptureFixture[str]) -> None:
    keep(frames=[{"frame": 200, "file": "frame-0200.png", "digest": DIGEST}])
    assert main.run(["compare", "scene.yaml", "goldens"]) == 2
    assert capsys.readouterr().err == (
        "scene.yaml: the scene has none of the frames that have goldens\n"
        "  got: 120 frames up to frame 119\n"
        "  expected: frame 200 or others listed in goldens/golden.json\n"
    )
