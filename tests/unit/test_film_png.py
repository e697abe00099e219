"""PNG frames are exact and have straight alpha, and all get their names together."""

import struct
import zlib
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import numpy.typing as npt
import pytest

from renderer.film import Picture, encode_png, frame_path, open_film
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
    with open_film(output, frames) as write:
        for frame, image in zip(frames, images, strict=True):
            write(frame, Picture(image))
            assert not any(path.exists() for path in paths)
    assert sorted(paths[0].parent.iterdir()) == paths
    for path, image in zip(paths, images, strict=True):
        np.testing.assert_array_equal(iio.imread(path), image)


def test_transparent_frames_have_four_channels(tmp_path: Path) -> None:
    image = noise(4, 6, 4)
    with open_film(OutputSpec(tmp_path / "{frame}.png", size=(6, 4), background=None), [0]) as write:
        write(0, Picture(image))
    np.testing.assert_array_equal(iio.imread(tmp_path / "0.png"), image)


def test_only_the_frame_field_is_replaced() -> None:
    assert frame_path(Path("a{b}/{frame:03}/{frame}.png"), 7) == Path("a{b}/007/7.png")


@pytest.mark.parametrize("field", ["{frame:zz}", "{frame:400000}", "{frame:4}", "{frame!r}", "{frame:}"])
def test_a_format_that_is_not_legal_is_part_of_the_name(field: str) -> None:
    assert frame_path(Path(f"{field}.png"), 7) == Path(f"{field}.png")
