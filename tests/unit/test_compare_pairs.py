"""Frames are paired by name, number or index, and child processes end with the block."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from comparing import compare_files
from hypothesis import given, strategies as st
from png_files import noise, smooth, write_film, write_frames

from renderer.errors import InputError
from renderer.film import encode_png
from renderer.readers import natural_sort_key

PICTURES = [noise(seed) for seed in range(3)]


@pytest.fixture
def golden(tmp_path: Path) -> Path:
    return write_frames(tmp_path / "golden", PICTURES)


@pytest.fixture
def actual(tmp_path: Path) -> Path:
    return write_frames(tmp_path / "actual", PICTURES)


def pairs_of(golden: Path, actual: Path) -> list[tuple[str, bool, bool]]:
    """Return the name of each pair, and whether each side has it."""
    frames = compare_files(golden, actual).frames
    return [(each.name, each.status != "new", each.status != "missing") for each in frames]


def notes_on(golden: Path, actual: Path) -> list[str]:
    return list(compare_files(golden, actual).notes)


def problem(golden: Path, actual: Path) -> str:
    with pytest.raises(InputError) as caught:
        compare_files(golden, actual)
    return caught.value.summary


def test_two_pictures_are_a_pair_under_the_name_of_the_golden(golden: Path) -> None:
    other = (golden / "frame-0001.png").rename(golden / "Other.PNG")
    (frame,) = compare_files(golden / "frame-0000.png", other).frames
    assert frame.name == "frame-0000.png"
    assert frame.largest == pytest.approx(np.abs(PICTURES[1].astype(int) - PICTURES[0]).max())


def test_files_in_folders_are_paired_by_name(golden: Path, actual: Path) -> None:
    (golden / "frame-0001.png").unlink()
    (actual / "frame-0002.png").unlink()
    (actual / "notes.txt").touch()
    (actual / ".frame-0000.png").write_bytes(b"left by a copy")
    (actual / "below").mkdir()
    sides = {"frame-0000.png": (True, True), "frame-0001.png": (False, True), "frame-0002.png": (True, False)}
    assert pairs_of(golden, actual) == [(name, *each) for name, each in sides.items()]


def test_files_of_templates_are_paired_by_number(tmp_path: Path) -> None:
    golden = write_frames(tmp_path / "golden", PICTURES, "a-{}.PNG")
    actual = write_frames(tmp_path / "actual", PICTURES, "b-{:04}.png")
    (actual / "b-0000.png").rename(actual / "b-0012.png")
    (actual / "b-7.png").write_bytes(b"the template would have called it b-0007.png")
    assert pairs_of(golden / "a-{frame}.PNG", actual / "b-{frame:04}.png") == [
        ("a-0.PNG", True, False),
        ("a-1.PNG", True, True),
        ("a-2.PNG", True, True),
        ("a-12.PNG", False, True),
    ]


def test_a_folder_and_a_template_are_paired_by_name(golden: Path, actual: Path) -> None:
    (golden / "still.png").write_bytes(encode_png(PICTURES[0]))
    found = pairs_of(golden, actual / "frame-{frame:04}.png")
    names = ["frame-0000.png", "frame-0001.png", "frame-0002.png", "still.png"]
    assert found == [(name, True, name != "still.png") for name in names]


def test_notes_name_pictures_that_are_ignored_in_folders(golden: Path, actual: Path) -> None:
    (golden / "notes.txt").touch()
    (golden / ".frame-0003.jpg").touch()
    (golden / "empty").mkdir()
    assert notes_on(golden, actual) == []
    for number in range(4):
        (golden / f"frame-{number}.JPG").touch()
    write_frames(actual / "below", PICTURES[:1])
    assert notes_on(golden, actual) == [
        f"not compared, because they are not PNG files: frame-0.JPG, frame-1.JPG, frame-2.JPG and 1 more in {golden}",
        f"not compared, because subfolders are ignored: PNG files in below in {actual}",
    ]


def test_notes_name_pictures_that_templates_ignore(golden: Path, actual: Path) -> None:
    for side in (golden, actual):
        (side / "frame-0002.png").rename(side / "frame-1000.png")
        (side / "still.png").touch()
    assert notes_on(golden / "frame-{frame:04}.png", actual / "frame-{frame:04}.png") == []
    assert notes_on(golden / "frame-{frame}.png", actual / "frame-{frame:04}.png") == [
        "not compared, because frame-{frame}.png has another number of digits: frame-0000.png, frame-0001.png"
    ]


def test_damage_is_found_in_equal_files_and_in_frames_of_one_side(golden: Path, actual: Path) -> None:
    extra = actual / "extra.png"
    extra.write_bytes(b"no picture")
    assert problem(golden, actual) == "not a PNG file"
    extra.unlink()
    for side in (golden, actual):
        content = (side / "frame-0001.png").read_bytes()
        (side / "frame-0001.png").write_bytes(content[:-20])
    assert problem(golden, actual) == "the PNG file is cut off"


@given(st.permutations(["", "1", "01", "a1", "a01", "a2", "a10", "a10b", "a10-é", "-", "a"]))
def test_frames_are_in_natural_order(names: list[str]) -> None:
    assert sorted(names, key=natural_sort_key) == ["", "01", "1", "-", "a", "a01", "a1", "a2", "a10", "a10-é", "a10b"]


# Films


both_formats = pytest.mark.parametrize("suffix", ["mp4", "gif"])


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with six frames as film.mp4 and film.gif, and other.* whose fourth frame differs."""
    folder = tmp_path_factory.mktemp("films")
    pictures = [smooth(0.3 * number) for number in range(6)]
    others = [*pictures[:3], smooth(2.5), *pictures[4:]]
    for suffix in ("mp4", "gif"):
        write_film(folder / f"film.{suffix}", pictures)
        write_film(folder / f"other.{suffix}", others)
    return folder


@both_formats
def test_films_are_paired_by_index(films: Path, suffix: str) -> None:
    frames = compare_files(films / f"film.{suffix}", films / f"other.{suffix}").frames
    assert [(frame.name, frame.frame) for frame in frames] == [(f"frame {number}", number) for number in range(6)]
    errors = [frame.largest or 0 for frame in frames]
    assert errors.index(max(errors)) == 3
    assert max(errors) > 5 * sorted(errors)[-2]
