"""What `hsplat golden` prints, and what `hsplat compare` prints about goldens that it cannot use."""

from __future__ import annotations

import pty
import sys
from pathlib import Path

import pytest

from hsplat_cli import main
from hsplat_cli.compare.golden.provenance import Golden, Provenance
from hsplat_cli.compare.golden.update import GoldenUpdate, describe_update
from hsplat_cli.compare.outcome import Outcome
from tests.messages.conftest import small_scene
from tests.support.transcripts import Case, cases

DIGEST = "0" * 32
GOLDEN_JSON = f"""\
{{
  "format": "hsplat golden 2",
  "volume": {{
    "name": "engine_block",
    "fingerprint": "{DIGEST}",
    "shape": [8, 8, 8],
    "dtype": "uint8"
  }},
  "device": "llvmpipe",
  "scene": {{"error": {{"tolerance": 0.1}}}},
  "versions": {{"numpy": "2.1.0"}},
  "frames": [
    {{"frame": 0, "file": "frame-0000.png", "digest": "{DIGEST}"}},
    {{"frame": 1, "file": "frame-0001.png", "digest": "{DIGEST}"}}
  ]
}}
"""


@pytest.fixture(autouse=True)
def folder(scene_folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Add goldens without pictures, and frames without a record, to the folder of a small scene."""
    Path("scene.yaml").write_text(small_scene(2), "utf-8")
    for name in ("goldens", "frames", "cut"):
        Path(name).mkdir()
    Path("goldens/golden.json").write_text(GOLDEN_JSON, "utf-8")
    for name in ("frame-0000.png", "frame-0001.png", "notes.txt"):
        Path("frames", name).touch()
    monkeypatch.setenv("CI", "true")


@cases("golden.txt")
def test_messages(case: Case, capsys: pytest.CaptureFixture[str]) -> None:
    case.check(capsys)


@pytest.mark.parametrize(("answer", "code", "end"), [("y", 0, "golden.json\n"), ("n", 1, "nothing was written\n")])
def test_the_question_is_asked_at_a_terminal(
    answer: str, code: int, end: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("CI")
    assert main.run(["golden", "scene.yaml", "new", "--quiet"]) == 0
    keyboard, terminal = pty.openpty()
    with open(keyboard, "w", encoding="utf-8") as keys, open(terminal, encoding="utf-8") as stdin:
        monkeypatch.setattr(sys, "stdin", stdin)
        keys.write(f"{answer}\n")
        keys.flush()
        found = main.run(["golden", "scene.yaml", "new", "--update", "--set", "transfer_function.points.2.color=red"])
    assert found == code
    out = capsys.readouterr().out
    assert "\nOverwrite the goldens? [y/N]: " in out
    assert out.endswith(end)


def provenance(*frames: int, device: str = "llvmpipe", numpy: str = "2.1.0") -> Provenance:
    origin = {"volume": {}, "device": device, "scene": {}, "versions": {"numpy": numpy}}
    return Provenance(origin, tuple(Golden(frame, f"frame-{frame:04}.png", DIGEST) for frame in frames))


def change(frame: int, why: str = "", *values: float) -> Outcome:
    figures = dict(zip(("largest", "densest", "p99", "bias"), values, strict=True)) if values else {}
    return Outcome(f"frame-{frame:04}.png", "different", why, figures=figures)


def test_an_update_lists_its_changes() -> None:
    plan = GoldenUpdate(
        before=provenance(0, 1, 2, 3, 7, 8),
        after=provenance(0, 1, 2, 3, 4, 8, device="softpipe", numpy="2.2.0"),
        changes=[
            change(4, "is new"),
            change(3, "36 x 32 pixels, the golden has 32 x 32"),
            change(1, "", 41, 9.3084, 12, 1.25),
            change(0, "", 1, 0.0052, 0, 0.00031),
        ],
        sources={},
        removed=provenance(7).goldens,
        unrequested=provenance(8).goldens,
    )
    assert "\n".join(describe_update(plan)) == (
        """\
4 of 5 frames change:
  frame-0004.png: is new
  frame-0003.png: 36 x 32 pixels, the golden has 32 x 32
  steps, worst first   largest   densest       p99      bias
  frame-0001.png            41      9.31        12      1.25
  frame-0000.png             1    0.0052         0   0.00031
  largest: largest error of a channel
  densest: mean error of a channel in the densest window of 8 x 8 pixels
  p99: 99th percentile of the pixels' largest errors
  bias: mean signed error of the most shifted channel
to be removed, because not requested: frame-0007.png
not requested, and kept (--prune removes them): frame-0008.png
changed since they were rendered: device was 'llvmpipe'; versions.numpy was '2.1.0'"""
    )


@pytest.mark.parametrize(
    ("before", "after", "removed", "text"),
    [
        (provenance(0), provenance(1), (), "golden.json changes: the files differ from those it lists"),
        (
            provenance(*range(8), numpy="3"),
            provenance(0),
            provenance(*range(1, 8)).goldens,
            "to be removed, because not requested: frame-0001.png, frame-0002.png, frame-0003.png, frame-0004.png, "
            "frame-0005.png and 2 more\nchanged since they were rendered: versions.numpy was '3'",
        ),
    ],
)
def test_an_update_without_pixels_says_what_changes(
    before: Provenance, after: Provenance, removed: tuple[Golden, ...], text: str
) -> None:
    plan = GoldenUpdate(before, after, (), {}, removed, ())
    assert "\n".join(describe_update(plan)) == f"no pixel of 1 frame changes\n{text}"
