"""The limits of a frame come from its level, the file beside the goldens and the command line."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable, Iterable
from pathlib import Path

import click
import pytest
from hypothesis import given, strategies as st

from hsplat_cli.commands.compare import compare
from hsplat_cli.compare import COMPARISON_METRICS, STRICTNESSES, Rules, load_rules
from renderer.errors import InputError, SceneError

SAME_MACHINE, CROSS_DRIVER = STRICTNESSES["same-machine"].limits, STRICTNESSES["cross-driver"].limits


def write(folder: Path, text: str) -> Path:
    (folder / "compare.yaml").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("level", STRICTNESSES)
def test_a_level_comes_from_the_option_or_the_file(tmp_path: Path, level: str) -> None:
    assert load_rules(tmp_path, level).limits_for("any.png") == STRICTNESSES[level].limits
    write(tmp_path, f"level: {level}")
    assert load_rules(tmp_path).limits_for("any.png") == STRICTNESSES[level].limits
    assert load_rules(tmp_path, "exact").limits_for("any.png") == STRICTNESSES["exact"].limits


def test_options_override_frames_which_override_the_file_and_its_level(tmp_path: Path) -> None:
    write(
        tmp_path,
        "level: cross-driver\n"
        "limits: {largest: 5, p99: 2, flip: 0.5}\n"
        "frames:\n  frame-0007.png: {largest: 8, ssim: 0.9, flip: none}\n",
    )
    plain, seven = {**CROSS_DRIVER, "largest": 5, "p99": 2, "flip": 0.5}, {**CROSS_DRIVER, "largest": 8, "p99": 2}
    del seven["flip"]
    rules = load_rules(tmp_path)
    assert rules.level == "cross-driver"
    assert rules.limits_for("frame-0006.png") == plain
    assert rules.limits_for("frame-0007.png") == {**seven, "ssim": 0.9}
    rules = load_rules(tmp_path, overrides=["largest=20", "densest=none", "largest = 30 ", "flip=1e-2"])
    for limits in (plain, seven):
        limits.update(largest=30, flip=0.01)
        del limits["densest"]
    assert rules.limits_for("frame-0006.png") == plain
    assert rules.limits_for("frame-0007.png") == {**seven, "ssim": 0.9}


def test_a_level_on_the_command_line_replaces_the_file(tmp_path: Path) -> None:
    write(tmp_path, "limits: {largest: 200, p99: none}\nframes: {a.png: {ssim: 0.9}}\n")
    rules = load_rules(tmp_path, "exact")
    assert rules.limits_for("a.png") == rules.limits_for("b.png") == STRICTNESSES["exact"].limits
    assert rules.other_limits == []
    assert rules.notes == [f"the level exact replaces the limits of {tmp_path / 'compare.yaml'}"]
    rules = load_rules(tmp_path, "exact", ["largest=4"])
    assert rules.limits_for("a.png") == {"largest": 4}
    assert rules.other_limits == ["largest 4 by option"]
    write(tmp_path, "level: cross-driver")
    assert list(load_rules(tmp_path, "exact").notes) == []


def test_limits_that_differ_from_the_level_are_listed(tmp_path: Path) -> None:
    write(
        tmp_path,
        "level: cross-driver\n"
        "limits: {largest: 200, p99: none, flip: 0.012, ssim: none, densest: 3}\n"
        "frames: {a.png: {largest: 8}, b.png: {largest: 200}}\n",
    )
    file = tmp_path / "compare.yaml"
    assert load_rules(tmp_path).other_limits == [
        f"largest 200, p99 none, densest 3 by {file}",
        f"limits of 1 frame by {file}",
    ]
    assert load_rules(tmp_path, overrides=["largest=5", "p99=0.12345678", "densest=none"]).other_limits == [
        "p99 0.12345678, densest none by option"
    ]
    assert Rules().other_limits == []


@given(st.dictionaries(st.sampled_from(list(COMPARISON_METRICS)), st.one_of(st.none(), st.floats(0, 1)), max_size=6))
def test_limits_are_in_the_order_of_the_metrics(changes: dict[str, float | None]) -> None:
    names = list(Rules(limits=changes).limits_for(""))
    assert names == [name for name in COMPARISON_METRICS if name in names]


@pytest.mark.parametrize(("name", "words"), [("level", STRICTNESSES), ("limits", COMPARISON_METRICS)])
def test_the_help_names_all_levels_and_metrics(name: str, words: Iterable[str]) -> None:
    (option,) = [option for option in compare.params if option.name == name]
    assert isinstance(option, click.Option)
    assert [word for word in words if word not in str(option.help)] == []


def test_the_file_is_read_from_the_folder_of_the_goldens(tmp_path: Path) -> None:
    for text in ("", "# nothing\n", "{}"):
        assert load_rules(write(tmp_path, text)).limits_for("") == SAME_MACHINE
    write(tmp_path, "level: exact")
    for name in ("frame-0000.png", "frame-{frame:04}.png", "film.mp4"):
        assert load_rules(tmp_path / name).level == "exact"


def test_limits_of_unknown_frames_are_refused(tmp_path: Path) -> None:
    write(tmp_path, "frames:\n  a.png: {largest: 2}\n  b.png: {largest: 2}\n  frame 3: {largest: 2}\n")
    (tmp_path / "b.png").touch()  # a golden of which only another one is compared
    rules = load_rules(tmp_path)
    rules.require_frames(["a.png", "frame 3"])
    with pytest.raises(SceneError) as caught:
        rules.require_frames(["c.png"])
    assert [(problem.got, problem.location) for problem in caught.value.problems] == [
        ("'a.png'", f"{tmp_path / 'compare.yaml'}:2:3"),
        ("'frame 3'", f"{tmp_path / 'compare.yaml'}:4:3"),
    ]


def test_packages_of_limits_for_some_frames_are_required(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write(tmp_path, "level: exact\nframes: {a.png: {ssim: 0.9}}\n")
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    assert load_rules(tmp_path, "exact").limits_for("a.png") == STRICTNESSES["exact"].limits
    with pytest.raises(InputError, match="the package skimage is not installed"):
        load_rules(tmp_path)


@pytest.mark.parametrize("where", ["limits", "frames", "overrides"])
def test_every_frame_has_a_limit(tmp_path: Path, where: str) -> None:
    none = dict.fromkeys(SAME_MACHINE, "none")
    flow = "{" + ", ".join(f"{name}: none" for name in none) + "}"
    if where != "overrides":
        write(tmp_path, f"limits: {flow}" if where == "limits" else f"frames: {{a.png: {flow}}}")
    overrides = [f"{name}=none" for name in none] if where == "overrides" else []
    with pytest.raises(InputError, match="no metric has a limit"):
        load_rules(tmp_path, overrides=overrides)
    rules = load_rules(tmp_path, overrides=[*overrides, "ssim=0.9"])
    assert rules.limits_for("a.png") == {"ssim": 0.9}


@pytest.mark.parametrize(
    "make",
    [Path.mkdir, lambda path: path.symlink_to("nowhere"), os.mkfifo, lambda path: path.write_bytes(b"level: \xff")],
    ids=["folder", "link", "pipe", "other"],
)
def test_an_unreadable_file_is_refused(tmp_path: Path, make: Callable[[Path], object]) -> None:
    make(tmp_path / "compare.yaml")
    with pytest.raises(InputError):
        load_rules(tmp_path)
