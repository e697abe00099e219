"""A film is decoded to the pictures that were encoded, or refused, and ffmpeg ends with the block."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from png_files import smooth, write_film
from processes import MARK, marked, new_mark

from renderer.errors import HsplatError, InputError
from renderer.film import Pixels, count_film_frames, decode_film, decode_known_film
from renderer.scene import OutputSpec

SIZE, NUM_FRAMES = (48, 32), 6
COLORS = [(255, 0, 0), (0, 255, 0), (0, 0, 255), (200, 30, 90), (255, 255, 255), (128, 128, 128)]
both_formats = pytest.mark.parametrize("suffix", ["mp4", "gif"])


def pictures() -> list[Pixels]:
    return [smooth(0.3 * number, size=48)[:32] for number in range(NUM_FRAMES)]


@pytest.fixture(scope="module")
def films(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with six frames as film.mp4 and film.gif."""
    folder = tmp_path_factory.mktemp("films")
    for suffix in ("mp4", "gif"):
        write_film(folder / f"film.{suffix}", pictures())
    return folder


def decode(path: Path, size: tuple[int, int] = SIZE, num_frames: int = NUM_FRAMES) -> Pixels:
    """Return all frames, [frame, h, w, 3]."""
    with decode_known_film(OutputSpec(path, size), num_frames) as frames:
        return np.stack(list(frames))


def refusal(path: Path, size: tuple[int, int] = SIZE, num_frames: int = NUM_FRAMES) -> str:
    with pytest.raises(InputError) as caught:
        decode(path, size, num_frames)
    assert caught.value.where == str(path)
    return str(caught.value).removeprefix(f"{path}: ")


# Root mean square, in steps: seen at 3.4 and, for a GIF with its 256 colours, at 6.5. The next frame is at 12.
@pytest.mark.parametrize(("suffix", "largest"), [("mp4", 4), ("gif", 8)])
def test_all_frames_come_back_in_order(films: Path, suffix: str, largest: float) -> None:
    decoded = decode(films / f"film.{suffix}").astype(float)
    assert decoded.shape == (NUM_FRAMES, SIZE[1], SIZE[0], 3)
    errors = np.sqrt([[np.mean((ours - theirs) ** 2) for theirs in pictures()] for ours in decoded])
    np.testing.assert_array_equal(errors.argmin(axis=1), np.arange(NUM_FRAMES))
    assert errors.diagonal().max() < largest


@pytest.mark.parametrize(("suffix", "largest"), [("mp4", 2), ("gif", 0)])
def test_flat_colours_are_kept(tmp_path: Path, suffix: str, largest: int) -> None:
    """A step of 8-bit YCbCr in limited range is up to 2.1 steps of a channel (BT.709), rounded twice; the matrix of
    BT.601 would be more than ten steps off."""
    film = write_film(tmp_path / f"film.{suffix}", [np.full((32, 48, 3), color, np.uint8) for color in COLORS])
    assert np.abs(decode(film) - np.array(COLORS)[:, None, None]).max() <= largest


def test_greys_get_neither_darker_nor_brighter(tmp_path: Path) -> None:
    """ffmpeg's fast conversion, which other programs use, cuts off: all greys come back about one step darker."""
    greys = np.repeat(np.arange(4, 252, dtype=np.uint8), 3).reshape(62, 4, 1, 1, 3)
    film = write_film(tmp_path / "film.mp4", [np.tile(four, (1, 32, 48, 1))[0] for four in greys[:, :1]])
    errors = decode(film, num_frames=len(greys)) - greys[:, 0].astype(float)
    assert abs(errors.mean()) < 0.1


@pytest.mark.parametrize("axis", [0, 1])
def test_chroma_lies_where_it_was_put(tmp_path: Path, axis: int) -> None:
    """Read half a pixel off, the blue of a ramp would be 2 steps, half of its slope, too large or small."""
    ramp = np.zeros((32, 48, 3), np.uint8)
    ramp[..., 2] = 4 * np.expand_dims(np.arange(ramp.shape[axis]), 1 - axis)
    error = decode(write_film(tmp_path / "film.mp4", [ramp]), num_frames=1)[0] - ramp.astype(float)
    assert abs(error[8:-8, 8:-8, 2].mean()) < 0.5


def test_frames_of_a_gif_are_those_of_the_file_however_long_they_show(films: Path) -> None:
    content = (films / "film.gif").read_bytes()
    place = -1
    for delay in (0, 1, 500, 3, 65535, 7):  # of each frame's graphic control extension
        place = content.index(b"\x21\xf9\x04", place + 1)
        content = content[: place + 4] + delay.to_bytes(2, "little") + content[place + 6 :]
    path = films / "delays.gif"
    path.write_bytes(content)
    np.testing.assert_array_equal(decode(path), decode(films / "film.gif"))


@both_formats
@pytest.mark.parametrize("size", [(48, 30), (32, 48), (64, 32)])
def test_another_size_is_refused(films: Path, suffix: str, size: tuple[int, int]) -> None:
    assert refusal(films / f"film.{suffix}", size) == (
        f"a film of another size\n  got: 48 x 32 pixels\n  expected: {size[0]} x {size[1]} pixels"
    )


@both_formats
def test_another_number_of_frames_is_refused(films: Path, suffix: str) -> None:
    path = films / f"film.{suffix}"
    assert refusal(path, num_frames=5) == "a film with more frames\n  expected: 5 frames"
    assert refusal(path, num_frames=7) == "a film with fewer frames\n  got: 6 frames\n  expected: 7 frames"


@both_formats
def test_a_film_that_is_cut_off_is_refused(films: Path, tmp_path: Path, suffix: str) -> None:
    content = (films / f"film.{suffix}").read_bytes()
    path = tmp_path / f"cut.{suffix}"
    for length in {0, 1, 7, 13, 20, *range(30, len(content), 499), len(content) - 1}:
        path.write_bytes(content[:length])
        refusal(path)


def test_a_file_that_refers_to_others_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "list.mp4"
    path.write_bytes(b"\0\0\0\x08ftypffconcat version 1.0\nfile 'film.mp4'\n")
    assert refusal(path).startswith("the film cannot be decoded")


def test_a_pipe_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mp4")
    assert refusal(tmp_path / "pipe.mp4").startswith("not a file")


@both_formats
def test_huge_frames_are_refused(films: Path, suffix: str) -> None:
    path = films / f"film.{suffix}"
    assert count_film_frames(path, 64 * 32) == NUM_FRAMES  # whose rows have room for 64 pixels
    with pytest.raises(InputError, match="the film cannot be decoded"):
        count_film_frames(path, 48 * 32 - 1)


@pytest.mark.parametrize("name", ["a:b.mp4", "-ünï code.MP4", "100%d.gif"])
def test_names_are_only_names(tmp_path: Path, name: str) -> None:
    assert len(decode(write_film(tmp_path / name, pictures()))) == NUM_FRAMES


def test_ffmpeg_that_cannot_start_is_an_error(films: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(tmp_path))
    with pytest.raises(HsplatError, match="ffmpeg cannot be started"):
        decode(films / "film.mp4")


@both_formats
def test_ffmpeg_ends_with_the_block(films: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    mark = new_mark()
    monkeypatch.setenv(MARK, mark)
    with decode_film(films / f"film.{suffix}", 10**6) as frames:
        next(frames)
        assert len(marked(mark)) <= 1
    assert marked(mark) == set()
    output = OutputSpec(films / f"film.{suffix}", SIZE)
    with pytest.raises(ZeroDivisionError), decode_known_film(output, NUM_FRAMES) as frames:
        [1 / 0 for _ in frames]
    assert marked(mark) == set()
