"""PNG frames: exact, straight alpha, each one whole or absent."""

import struct
import zlib
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import numpy.typing as npt
import pytest

from renderer.errors import InputError, RenderError
from renderer.film import encode_png, frame_path, open_film
from renderer.scene import OutputSpec


def noise(*shape: int) -> npt.NDArray[np.uint8]:
    return np.random.default_rng(1).integers(0, 256, shape, dtype=np.uint8)


def chunks(data: bytes) -> dict[bytes, bytes]:
    found, position = {}, 8
    while position < len(data):
        (length,) = struct.unpack_from(">I", data, position)
        name, content = data[position + 4 : position + 8], data[position + 8 : position + 8 + length]
        assert struct.unpack_from(">I", data, position + 8 + length) == (zlib.crc32(name + content),)
        found[name] = content
        position += 12 + length
    return found


@pytest.mark.parametrize("shape", [(1, 1, 3), (7, 5, 3), (7, 5, 4), (64, 33, 4)])
def test_pictures_come_back_exactly(shape: tuple[int, int, int]) -> None:
    image = noise(*shape)
    np.testing.assert_array_equal(iio.imread(encode_png(image), extension=".png"), image)


def test_no_chunk_says_anything_about_colour() -> None:
    assert list(chunks(encode_png(noise(4, 4, 3)))) == [b"IHDR", b"IDAT", b"IEND"]


def test_all_frames_get_their_names_together(tmp_path: Path) -> None:
    output = OutputSpec(tmp_path / "new" / "folder" / "{frame:04}.png", size=(6, 4))
    images = noise(3, 4, 6, 3)
    frames = [2, 5, 11]
    paths = [tmp_path / "new" / "folder" / name for name in ("0002.png", "0005.png", "0011.png")]
    with open_film(output, frames) as film:
        for frame, image in zip(frames, images, strict=True):
            film.write(frame, image)
            assert not any(path.exists() for path in paths)
    assert sorted(paths[0].parent.iterdir()) == paths
    for path, image in zip(paths, images, strict=True):
        np.testing.assert_array_equal(iio.imread(path), image)


def test_transparent_frames_have_four_channels(tmp_path: Path) -> None:
    image = noise(4, 6, 4)
    with open_film(OutputSpec(tmp_path / "{frame}.png", size=(6, 4), background=None), [0]) as film:
        film.write(0, image)
    np.testing.assert_array_equal(iio.imread(tmp_path / "0.png"), image)


@pytest.mark.parametrize("stop", [ValueError, KeyboardInterrupt])
def test_nothing_is_left_when_the_block_is(tmp_path: Path, stop: type[BaseException]) -> None:
    def leave() -> None:
        with open_film(OutputSpec(tmp_path / "{frame}.png", size=(6, 4)), [0, 1]) as film:
            film.write(0, noise(4, 6, 3))
            raise stop

    with pytest.raises(stop):
        leave()
    assert not list(tmp_path.iterdir())


def test_only_the_frame_field_is_replaced() -> None:
    assert frame_path(Path("a{b}/{frame:03}/{frame}.png"), 7) == Path("a{b}/007/7.png")


@pytest.mark.parametrize("field", ["{frame:zz}", "{frame:400000}", "{frame:4}", "{frame!r}", "{frame:}"])
def test_a_format_that_is_not_legal_is_part_of_the_name(field: str) -> None:
    assert frame_path(Path(f"{field}.png"), 7) == Path(f"{field}.png")


def test_a_folder_under_the_name_of_a_frame(tmp_path: Path) -> None:
    (tmp_path / "1.png").mkdir()
    with pytest.raises(InputError, match="is a folder"), open_film(OutputSpec(tmp_path / "{frame}.png"), [1]):
        pytest.fail("found out too late")


def test_a_full_disk_leaves_no_part_of_a_frame(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(path: Path, content: bytes) -> int:
        with path.open("wb") as stream:
            stream.write(content[:5])
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(Path, "write_bytes", full)
    with (
        pytest.raises(RenderError, match="disk is full"),
        open_film(OutputSpec(tmp_path / "{frame}.png", size=(6, 4)), [0]) as film,
    ):
        film.write(0, noise(4, 6, 3))
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("frame", "shape", "dtype"),
    [(1, (4, 6, 3), np.uint8), (0, (6, 4, 3), np.uint8), (0, (4, 6, 4), np.uint8), (0, (4, 6, 3), np.float32)],
)
def test_a_frame_that_does_not_fit_is_a_fault_of_the_program(
    tmp_path: Path, frame: int, shape: tuple[int, ...], dtype: type
) -> None:
    with pytest.raises(AssertionError), open_film(OutputSpec(tmp_path / "{frame}.png", size=(6, 4)), [0, 1]) as film:
        film.write(frame, np.zeros(shape, dtype))


def test_missing_frames_are_a_fault_of_the_program(tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="missing"), open_film(OutputSpec(tmp_path / "{frame}.png"), [0]):
        pass
