"""The limits of a frame come from its level, the file beside the goldens and the command line."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from comparing import compare_files, write_pictures

from hsplat_cli.commands.compare import compare
from hsplat_cli.compare import COMPARISON_METRICS, STRICTNESSES
from renderer.errors import InputError, SceneError

SAME_MACHINE, CROSS_DRIVER = STRICTNESSES["same-machine"].limits, STRICTNESSES["cross-driver"].limits


FRAMES = dict.fromkeys(["a.png", "b.png"], np.full((16, 16, 3), 100, np.uint8))


@pytest.fixture
def goldens(tmp_path: Path) -> Path:
    """Return a folder of goldens, beside which frames/ has the same pictures."""
    write_pictures(tmp_path / "frames", FRAMES)
    return write_pictures(tmp_path / "goldens", FRAMES)


def write(folder: Path, text: str) -> None:
    (folder / "compare.yaml").write_text(text, encoding="utf-8")


def compared(goldens: Path, level: str | None = None, limits: Sequence[str] = ()) -> Any:
    return compare_files(goldens, goldens.with_name("frames"), level, limits)


def limits_of(comparison: Any) -> list[dict[str, float]]:
    return [outcome.limits for outcome in comparison.outcomes]


@pytest.mark.parametrize("level", STRICTNESSES)
def test_a_level_comes_from_the_option_or_the_file(goldens: Path, level: str) -> None:
    assert limits_of(compared(goldens, level)) == [STRICTNESSES[level].limits] * 2
    write(goldens, f"level: {level}")
    assert limits_of(compared(goldens)) == [STRICTNESSES[level].limits] * 2
    assert limits_of(compared(goldens, "exact")) == [STRICTNESSES["exact"].limits] * 2


def test_options_override_frames_which_override_the_file_and_its_level(goldens: Path) -> None:
    write(
        goldens,
        "level: cross-driver\n"
        "limits: {largest: 5, p99: 2, flip: 0.5}\n"
        "frames:\n  b.png: {largest: 8, ssim: 0.9, flip: none}\n",
    )
    plain, other = {**CROSS_DRIVER, "largest": 5, "p99": 2, "flip": 0.5}, {**CROSS_DRIVER, "largest": 8, "p99": 2}
    del other["flip"]
    comparison = compared(goldens)
    assert comparison.level == "cross-driver"
    assert limits_of(comparison) == [plain, {**other, "ssim": 0.9}]
    for limits in (plain, other):
        limits.update(largest=30, flip=0.01)
        del limits["densest"]
    comparison = compared(goldens, limits=["largest=20", "densest=none", "largest = 30 ", "flip=1e-2"])
    assert limits_of(comparison) == [plain, {**other, "ssim": 0.9}]


def test_a_level_on_the_command_line_replaces_the_file(goldens: Path) -> None:
    write(goldens, "limits: {largest: 200, p99: none}\nframes: {a.png: {ssim: 0.9}}\n")
    comparison = compared(goldens, "exact")
    assert limits_of(comparison) == [STRICTNESSES["exact"].limits] * 2
    assert comparison.other_limits == []
    assert comparison.notes == [f"the level exact replaces the limits of {goldens / 'compare.yaml'}"]
    comparison = compared(goldens, "exact", ["largest=4"])
    assert limits_of(comparison) == [{"largest": 4}] * 2
    assert comparison.other_limits == ["largest 4 by option"]
    write(goldens, "level: cross-driver")
    assert compared(goldens, "exact").notes == []


def test_limits_that_differ_from_the_level_are_listed(goldens: Path) -> None:
    assert compared(goldens).other_limits == []
    write(
        goldens,
        "level: cross-driver\n"
        "limits: {largest: 200, p99: none, flip: 0.012, ssim: none, densest: 3}\n"
        "frames: {a.png: {largest: 8}, b.png: {largest: 200}}\n",
    )
    file = goldens / "compare.yaml"
    assert compared(goldens).other_limits == [
        f"largest 200, p99 none, densest 3 by {file}",
        f"limits of 1 frame by {file}",
    ]
    assert compared(goldens, limits=["largest=5", "p99=0.12345678", "densest=none"]).other_limits == [
        "p99 0.12345678, densest none by option"
    ]


@pytest.mark.parametrize("order", [1, -1])
def test_limits_are_in_the_order_of_the_metrics(order: int, goldens: Path) -> None:
    write(goldens, "limits: {" + ", ".join(f"{name}: 0.5" for name in [*COMPARISON_METRICS][::order]) + "}")
    assert [list(limits) for limits in limits_of(compared(goldens))] == [list(COMPARISON_METRICS)] * 2


@pytest.mark.parametrize(("name", "words"), [("level", STRICTNESSES), ("limits", COMPARISON_METRICS)])
def test_the_help_names_all_levels_and_metrics(name: str, words: Iterable[str]) -> None:
    (option,) = [option for option in compare.params if option.name == name]
    assert isinstance(option, click.Option)
    assert [word for word in words if word not in str(option.help)] == []


@pytest.mark.parametrize("text", ["", "# nothing\n", "{}"])
def test_a_file_may_be_empty(text: str, goldens: Path) -> None:
    write(goldens, text)
    assert limits_of(compared(goldens)) == [SAME_MACHINE] * 2


@pytest.mark.parametrize("name", ["a.png", "{frame}.png"])
def test_the_file_is_read_from_the_folder_of_the_goldens(name: str, goldens: Path) -> None:
    write(goldens, "level: exact")
    for folder in (goldens, goldens.with_name("frames")):
        shutil.copy(folder / "a.png", folder / "1.png")
    assert compare_files(goldens / name, goldens.with_name("frames") / name).level == "exact"


def test_limits_of_unknown_frames_are_refused(goldens: Path) -> None:
    write(goldens, "frames:\n  a.png: {largest: 2}\n  c.png: {largest: 2}\n  frame 3: {largest: 2}\n")
    with pytest.raises(SceneError) as caught:
        compared(goldens)
    assert [(problem.got, problem.location) for problem in caught.value.problems] == [
        ("'c.png'", f"{goldens / 'compare.yaml'}:3:3"),
        ("'frame 3'", f"{goldens / 'compare.yaml'}:4:3"),
    ]


def test_limits_of_goldens_that_are_not_compared_are_no_mistake(goldens: Path) -> None:
    write(goldens, "frames: {b.png: {largest: 2}}")
    assert compare_files(goldens / "a.png", goldens.with_name("frames") / "a.png").passes


def test_packages_of_limits_for_some_frames_are_required(goldens: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(goldens, "level: exact\nframes: {a.png: {ssim: 0.9}}\n")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert limits_of(compared(goldens, "exact")) == [STRICTNESSES["exact"].limits] * 2
    with pytest.raises(InputError, match="the package skimage is not installed"):
        compared(goldens)


@pytest.mark.parametrize("where", ["limits", "frames", "options"])
def test_every_frame_has_a_limit(goldens: Path, where: str) -> None:
    none = dict.fromkeys(SAME_MACHINE, "none")
    flow = "{" + ", ".join(f"{name}: none" for name in none) + "}"
    if where != "options":
        write(goldens, f"limits: {flow}" if where == "limits" else f"frames: {{a.png: {flow}}}")
    options = [f"{name}=none" for name in none] if where == "options" else []
    with pytest.raises(InputError, match="no metric has a limit"):
        compared(goldens, limits=options)
    assert limits_of(compared(goldens, limits=[*options, "ssim=0.9"]))[0] == {"ssim": 0.9}


@pytest.mark.parametrize(
    "make",
    [Path.mkdir, lambda path: path.symlink_to("nowhere"), os.mkfifo, lambda path: path.write_bytes(b"level: \xff")],
    ids=["folder", "link", "pipe", "other"],
)
def test_an_unreadable_file_is_refused(goldens: Path, make: Callable[[Path], object]) -> None:
    make(goldens / "compare.yaml")
    with pytest.raises(InputError):
        compared(goldens)
