"""Which frames belong together, and that children end with the block."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, strategies as st
from png_files import noise, smooth, write_film, write_frames
from processes import MARK, marked, new_mark

from hsplat_cli.compare import film_decoder
from hsplat_cli.compare.file_pairs import frame_numbers, natural_sort_key, open_pairs
from hsplat_cli.compare.film_decoder import count_film_frames, decode_film
from renderer.errors import InputError
from renderer.film import encode_png

PICTURES = [noise(seed) for seed in range(3)]


def pairs_of(golden: Path, actual: Path) -> list[tuple[str, bool, bool, int | None]]:
    """Name, whether each side is there, and number."""
    with open_pairs(golden, actual) as pairs:
        found = [(pair.name, pair.golden is not None, pair.actual is not None, pair.number) for pair in pairs.read()]
        assert list(pairs.names) == [name for name, *_ in found]
        return found


def refused(golden: Path, actual: Path) -> str:
    with pytest.raises(InputError) as caught, open_pairs(golden, actual) as pairs:
        list(pairs.read())
    return caught.value.what


def test_two_pictures(tmp_path: Path) -> None:
    write_frames(tmp_path, PICTURES)
    (tmp_path / "frame-0001.png").rename(tmp_path / "Other.PNG")
    with open_pairs(tmp_path / "frame-0000.png", tmp_path / "Other.PNG") as pairs:
        (pair,) = pairs.read()
    assert pair.name == "frame-0000.png"
    np.testing.assert_array_equal(pair.golden, PICTURES[0])
    np.testing.assert_array_equal(pair.actual, PICTURES[1])


def test_folders_by_name(tmp_path: Path) -> None:
    golden, actual = write_frames(tmp_path / "golden", PICTURES), write_frames(tmp_path / "actual", PICTURES)
    (golden / "frame-0001.png").unlink()
    (actual / "frame-0002.png").unlink()
    (actual / "notes.txt").touch()
    (actual / ".frame-0000.png").write_bytes(b"left by a copy")
    (actual / "below").mkdir()
    assert pairs_of(golden, actual) == [
        ("frame-0000.png", True, True, 0),
        ("frame-0001.png", False, True, 1),
        ("frame-0002.png", True, False, 2),
    ]


def test_the_case_of_a_suffix(tmp_path: Path) -> None:
    for side in ("golden", "actual"):
        write_frames(tmp_path / side, PICTURES, "f{}.PNG")
    assert [name for name, *_ in pairs_of(tmp_path / "golden", tmp_path / "actual")] == ["f0.PNG", "f1.PNG", "f2.PNG"]


def test_templates_by_number(tmp_path: Path) -> None:
    golden = write_frames(tmp_path / "golden", PICTURES, "a-{}.png")
    actual = write_frames(tmp_path / "actual", PICTURES, "b-{:04}.png")
    (actual / "b-0000.png").rename(actual / "b-0012.png")
    (actual / "b-7.png").write_bytes(b"the template would have called it b-0007.png")
    assert pairs_of(golden / "a-{frame}.png", actual / "b-{frame:04}.png") == [
        ("a-0.png", True, False, 0),
        ("a-1.png", True, True, 1),
        ("a-2.png", True, True, 2),
        ("a-12.png", False, True, 12),
    ]


def notes_on(golden: Path, actual: Path) -> list[str]:
    with open_pairs(golden, actual) as pairs:
        return list(pairs.notes)


def test_pictures_that_are_skipped_in_folders(tmp_path: Path) -> None:
    golden, actual = write_frames(tmp_path / "golden", PICTURES), write_frames(tmp_path / "actual", PICTURES)
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


def test_pictures_that_are_skipped_by_templates(tmp_path: Path) -> None:
    golden, actual = write_frames(tmp_path / "golden", PICTURES), write_frames(tmp_path / "actual", PICTURES)
    for side in (golden, actual):
        (side / "frame-0002.png").rename(side / "frame-1000.png")
        (side / "still.png").touch()
    assert notes_on(golden / "frame-{frame:04}.png", actual / "frame-{frame:04}.png") == []
    assert notes_on(golden / "frame-{frame}.png", actual / "frame-{frame:04}.png") == [
        "not compared, because frame-{frame}.png has another number of digits: frame-0000.png, frame-0001.png"
    ]


def test_a_folder_and_a_template_by_name(tmp_path: Path) -> None:
    golden, actual = write_frames(tmp_path / "golden", PICTURES), write_frames(tmp_path / "actual", PICTURES)
    (golden / "still.png").write_bytes(encode_png(PICTURES[0]))
    found = pairs_of(golden, actual / "frame-{frame:04}.png")
    assert [(name, is_there) for name, _, is_there, _ in found] == [
        ("frame-0000.png", True),
        ("frame-0001.png", True),
        ("frame-0002.png", True),
        ("still.png", False),
    ]


def test_files_of_the_same_bytes_are_one_picture(tmp_path: Path) -> None:
    golden, actual = write_frames(tmp_path / "golden", PICTURES), write_frames(tmp_path / "actual", PICTURES)
    with open_pairs(golden, actual) as pairs:
        assert all(pair.golden is pair.actual for pair in pairs.read())


def test_files_that_are_cut_off_alike(tmp_path: Path) -> None:
    for side in ("golden", "actual"):
        folder = write_frames(tmp_path / side, PICTURES)
        content = (folder / "frame-0001.png").read_bytes()
        (folder / "frame-0001.png").write_bytes(content[:-20])
    assert refused(tmp_path / "golden", tmp_path / "actual") == "the PNG file is cut off"


def test_a_frame_on_one_side_only_must_be_readable(tmp_path: Path) -> None:
    golden, actual = write_frames(tmp_path / "golden", PICTURES), write_frames(tmp_path / "actual", PICTURES)
    (actual / "extra.png").write_bytes(b"no picture")
    assert refused(golden, actual) == "not a PNG file"


def test_odd_names(tmp_path: Path) -> None:
    names = ['a "b" & <c>.png', "new\nline.png", os.fsdecode(b"not-utf-8-\xff.png"), "\x01.png", "é.png", "{}.png"]
    for side in ("golden", "actual"):
        (tmp_path / side).mkdir()
        for name in names:
            (tmp_path / side / name).write_bytes(encode_png(PICTURES[0]))
    found = pairs_of(tmp_path / "golden", tmp_path / "actual")
    assert {name for name, *_ in found} == set(names)
    assert all(golden and actual for _, golden, actual, _ in found)


@pytest.mark.parametrize("side", ["golden", "actual"])
def test_a_folder_without_pictures(tmp_path: Path, side: str) -> None:
    write_frames(tmp_path / "golden", PICTURES)
    write_frames(tmp_path / "actual", PICTURES)
    for path in (tmp_path / side).iterdir():
        path.unlink()
    assert refused(tmp_path / "golden", tmp_path / "actual") == "no PNG files in this folder"


def test_nothing_in_common(tmp_path: Path) -> None:
    golden, actual = (
        write_frames(tmp_path / "a", PICTURES, "a-{}.png"),
        write_frames(tmp_path / "b", PICTURES, "b-{}.png"),
    )
    assert refused(golden, actual) == "no frame of ACTUAL has the name of a golden"
    assert refused(golden, actual / "b-{frame}.png") == "no frame of ACTUAL has the name of a golden"


def test_nothing_is_compared_with_itself(tmp_path: Path) -> None:
    folder = write_frames(tmp_path / "frames", PICTURES)
    (tmp_path / "link").symlink_to("frames")
    film = write_film(tmp_path / "film.mp4", [smooth()])
    for golden, actual in (
        (folder, folder),
        (folder, tmp_path / "link"),
        (folder, folder / "frame-{frame:04}.png"),
        (folder / "frame-0000.png", folder / ".." / "frames" / "frame-0000.png"),
        (film, film),
    ):
        assert refused(golden, actual) == "GOLDEN and ACTUAL are the same files"


def test_kinds_that_do_not_go_together(tmp_path: Path) -> None:
    folder = write_frames(tmp_path / "frames", PICTURES)
    for name in ("a.mp4", "a.gif", "a.txt"):
        (tmp_path / name).touch()
    picture = folder / "frame-0000.png"
    for golden, actual in ((folder, picture), (picture, tmp_path / "a.mp4"), (tmp_path / "a.gif", tmp_path / "a.mp4")):
        assert refused(golden, actual) == "GOLDEN and ACTUAL are of different kinds"
    assert refused(folder, tmp_path / "a.txt") == "cannot be compared"
    assert refused(folder, tmp_path / "absent") == "no such file or folder"
    for template in ("{frame:x}.png", "{frame}{frame}.png", "{frame}-{other}.png"):
        assert refused(folder, folder / template) == "not a valid template"
    assert refused(folder, tmp_path / "absent" / "{frame}.png").startswith("cannot be read")
    assert refused(folder, folder / "other-{frame}.png") == "no file matches this template"


def test_natural_order() -> None:
    names = ["b.png", "frame-10.png", "frame-2.png", "2.png", "10.png", "frame-02.png", "frame-.png", "frame-2b.png"]
    assert sorted(names, key=natural_sort_key) == [
        "2.png", "10.png", "b.png", "frame-02.png", "frame-2.png", "frame-2b.png", "frame-10.png", "frame-.png",
    ]  # fmt: skip


@given(st.permutations(["", "1", "01", "a1", "a01", "a2", "a10", "a10b", "a10-é", "-", "a"]))
def test_natural_order_is_an_order(names: list[str]) -> None:
    assert sorted(names, key=natural_sort_key) == ["", "01", "1", "-", "a", "a01", "a1", "a2", "a10", "a10-é", "a10b"]


@pytest.mark.parametrize(
    ("names", "numbers"),
    [
        (["frame-0007.png", "frame-0010.png"], [7, 10]),
        (["v2-frame9.png", "v2-frame10.png"], [9, 10]),
        (["front-2.png", "back-2.png"], []),
        (["1.png", "01.png"], []),
        (["1.png", "still.png"], []),
        (["still.png"], []),
    ],
)
def test_numbers_of_frames(names: list[str], numbers: list[int]) -> None:
    assert list(frame_numbers(names).values()) == numbers


# Films


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with six frames as film.mp4 and film.gif, and other.* whose fourth frame is another."""
    folder = tmp_path_factory.mktemp("films")
    pictures = [smooth(0.3 * number) for number in range(6)]
    others = [*pictures[:3], smooth(2.5), *pictures[4:]]
    for suffix in ("mp4", "gif"):
        write_film(folder / f"film.{suffix}", pictures)
        write_film(folder / f"other.{suffix}", others)
        write_film(folder / f"short.{suffix}", pictures[:5])
    return folder


@pytest.mark.parametrize("suffix", ["mp4", "gif"])
def test_films_by_index(films: Path, suffix: str) -> None:
    with open_pairs(films / f"film.{suffix}", films / f"other.{suffix}") as pairs:
        assert list(pairs.names) == [f"frame {number}" for number in range(6)]
        assert len(pairs.notes) == 2
        assert "not their timing" in pairs.notes[1]
        errors = []
        for number, pair in enumerate(pairs.read()):
            assert pair.number == number
            assert pair.golden is not None and pair.actual is not None
            assert pair.golden.shape == (32, 32, {"mp4": 3, "gif": 4}[suffix])
            errors.append(np.abs(pair.golden.astype(int) - pair.actual).mean())
    assert errors.index(max(errors)) == 3
    assert max(errors) > 5 * sorted(errors)[-2]


@pytest.mark.parametrize(("suffix", "largest"), [("mp4", 3), ("gif", 0)])
def test_colours_are_those_that_were_drawn(tmp_path: Path, suffix: str, largest: int) -> None:
    """Of even frames. A step of 8-bit YCbCr in limited range is up to 2.1 levels of a channel (BT.709), rounded twice;
    the matrix of BT.601 instead is more than ten levels off."""
    colors = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (200, 30, 90), (255, 255, 255), (128, 128, 128)]
    film = write_film(tmp_path / f"film.{suffix}", [np.full((32, 32, 3), color, np.uint8) for color in colors])
    with decode_film(film) as frames:
        for color, frame in zip(colors, frames, strict=True):
            assert np.abs(frame[..., :3].astype(int) - color).max() <= largest
            assert frame.shape[2] == 3 or (frame[..., 3] == 255).all()


@pytest.mark.parametrize("suffix", ["mp4", "gif"])
def test_films_of_different_numbers_of_frames(films: Path, suffix: str) -> None:
    assert refused(films / f"film.{suffix}", films / f"short.{suffix}") == "films with different numbers of frames"


@pytest.mark.parametrize("suffix", ["mp4", "gif"])
def test_a_film_that_is_cut_off_has_not_fewer_frames(films: Path, tmp_path: Path, suffix: str) -> None:
    content = (films / f"film.{suffix}").read_bytes()
    path = tmp_path / f"cut.{suffix}"
    for length in {0, 1, 7, 8, 13, 20, *range(30, len(content), 211), len(content) - 1}:
        path.write_bytes(content[:length])
        with pytest.raises(InputError):
            count_film_frames(path)


def test_a_film_that_is_damaged(films: Path, tmp_path: Path) -> None:
    content = bytearray((films / "film.mp4").read_bytes())
    place = content.index(b"mdat") + 800
    content[place : place + 40] = bytes(40)
    path = tmp_path / "damaged.mp4"
    path.write_bytes(content)
    with pytest.raises(InputError, match="the film cannot be decoded"):
        count_film_frames(path)


def test_a_film_that_is_something_else(films: Path, tmp_path: Path) -> None:
    for name, content in (("a.mp4", b"#EXTM3U\nfile:///etc/passwd\n"), ("a.gif", (films / "film.mp4").read_bytes())):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(InputError, match=r": not an? (MP4|GIF) file$"):
            count_film_frames(tmp_path / name)


@pytest.mark.parametrize("suffix", ["mp4", "gif"])
def test_a_film_of_huge_frames(films: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    monkeypatch.setattr(film_decoder, "MAX_PIXELS", 32 * 32 - 1)
    with pytest.raises(InputError, match="the film cannot be decoded"):
        count_film_frames(films / f"film.{suffix}")


def test_what_is_no_film_decoder(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mp4")
    (tmp_path / "folder.mp4").mkdir()
    for name in ("pipe", "folder"):
        with pytest.raises(InputError, match="not a file"):
            count_film_frames(tmp_path / f"{name}.mp4")


def test_no_child_is_left(films: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mark = new_mark()
    monkeypatch.setenv(MARK, mark)
    with open_pairs(films / "film.mp4", films / "other.mp4") as pairs:
        next(pairs.read())
        assert len(marked(mark)) <= 2
    assert marked(mark) == set()
    with pytest.raises(ZeroDivisionError), open_pairs(films / "film.gif", films / "other.gif") as pairs:
        [1 / 0 for _ in pairs.read()]
    assert marked(mark) == set()
