"""MP4 and GIF have the metadata that players need, the right colours, and the same bytes on every run."""

import re
import struct
import subprocess
from pathlib import Path

import imageio.v3 as iio
import imageio_ffmpeg
import numpy as np
import numpy.typing as npt
import pytest
from png_files import open_film

from renderer.film import film_notes
from renderer.scene import OutputSpec

WIDTH, HEIGHT, NUM_FRAMES = 160, 64, 12
SATURATED = [
    (255, 0, 0), (0, 255, 0), (0, 0, 255), (255, 255, 0), (0, 255, 255),
    (255, 0, 255), (255, 255, 255), (0, 0, 0), (128, 128, 128), (200, 30, 90),
]  # fmt: skip
Pictures = npt.NDArray[np.uint8]


def patches() -> Pictures:
    """[h, w, 3]: ten patches, 16 pixels wide."""
    return np.repeat(np.array(SATURATED, np.uint8), 16, axis=0)[None].repeat(HEIGHT, axis=0)


def moving() -> Pictures:
    """[frame, h, w, 3]: a disc with a soft edge that wanders over a gradient."""
    y, x = np.mgrid[:HEIGHT, :WIDTH]
    frames = []
    for frame in range(NUM_FRAMES):
        disc = np.clip(20 - np.hypot(x - 20 - 10 * frame, y - 32), 0, 1)
        frames.append(np.stack([255 * disc, x * 1.0, 3 * y + 50 * disc], axis=2))
    return np.array(frames).astype(np.uint8)


def write(path: Path, pictures: Pictures, frames_per_second: float = 30, quality: float = 8) -> Path:
    height, width = pictures.shape[1:3]
    output = OutputSpec(path, size=(width, height), frames_per_second=frames_per_second, quality=quality)
    with open_film(output) as write_frame:
        for frame, pixels in enumerate(pictures):
            write_frame(frame, pixels)
    assert path.is_file()
    assert list(path.parent.glob(".*")) == []
    return path


def ffmpeg(*arguments: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run([imageio_ffmpeg.get_ffmpeg_exe(), *arguments], capture_output=True, check=False)


def description(path: Path) -> str:
    return ffmpeg("-hide_banner", "-i", str(path)).stderr.decode()


def decoded(path: Path, pixel_format: str = "rgb24") -> Pictures:
    raw = ffmpeg("-v", "error", "-i", str(path), "-f", "rawvideo", "-pix_fmt", pixel_format, "-").stdout
    return np.frombuffer(raw, np.uint8)


def shown_by_gif(path: Path) -> Pictures:
    """[frame, h, w, 3]: what a player shows."""
    return iio.imread(path, index=None, mode="RGB")


def boxes(data: bytes) -> list[str]:
    """The names of the boxes at the top level of an MP4 file."""
    names, position = [], 0
    while position < len(data):
        size, name = struct.unpack_from(">I4s", data, position)
        names.append(name.decode())
        position += size
    return names


def gif_delays(data: bytes) -> list[int]:
    """The delay of each graphic control extension, in hundredths of a second."""
    return [int.from_bytes(delay, "little") for delay in re.findall(rb"\x21\xf9\x04.(..).\x00[\x2c\x21]", data, re.S)]


def test_an_mp4_says_what_players_need(tmp_path: Path) -> None:
    path, again = (write(tmp_path / f"{name}.mp4", moving()) for name in ("a", "b"))
    assert path.read_bytes() == again.read_bytes()
    text = description(path)
    # One `bt709` stands for matrix, primaries and transfer when all three are.
    assert "h264 (High)" in text
    assert "yuv420p(tv, bt709, progressive)" in text
    assert f"{WIDTH}x{HEIGHT}" in text
    assert "30 fps, 30 tbr" in text
    assert "creation_time" not in text
    assert boxes(path.read_bytes())[:2] == ["ftyp", "moov"]  # the index first: plays while it loads
    assert len(decoded(path)) == NUM_FRAMES * HEIGHT * WIDTH * 3


def test_colours_are_converted_with_the_matrix_that_the_tags_name(tmp_path: Path) -> None:
    path = write(tmp_path / "film.mp4", np.stack([patches()] * 3), quality=10)
    planes = decoded(path, "yuv420p").reshape(3, -1)[1]
    luma, chroma = np.split(planes, [HEIGHT * WIDTH])
    centres = np.arange(8, WIDTH, 16)
    y = luma.reshape(HEIGHT, WIDTH)[HEIGHT // 2, centres]
    cb, cr = chroma.reshape(2, HEIGHT // 2, WIDTH // 2)[:, HEIGHT // 4, centres // 2]
    # ITU-R BT.709, items 3.2 to 3.4 and 4.6, limited range.
    red, green, blue = np.array(SATURATED).T / 255
    light = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    expected = [16 + 219 * light, 128 + 224 * (blue - light) / 1.8556, 128 + 224 * (red - light) / 1.5748]
    # Half a step of rounding and one of compression; BT.601's matrix is off by up to 28.
    np.testing.assert_allclose([y, cb, cr], expected, rtol=0, atol=1.5)
    shown = decoded(path).reshape(3, HEIGHT, WIDTH, 3)[1, HEIGHT // 2, centres]
    # A chroma step is up to 2.1 steps of blue or red.
    np.testing.assert_allclose(shown.astype(float), SATURATED, rtol=0, atol=4)


@pytest.mark.parametrize("axis", [0, 1])
def test_chroma_lies_where_h264_expects_it(tmp_path: Path, axis: int) -> None:
    ramp = np.zeros((1, 256, 256, 3), np.uint8)
    ramp[0, ..., 2] = np.arange(256)[:, None] if axis == 0 else np.arange(256)
    planes = decoded(write(tmp_path / "film.mp4", ramp, quality=10), "yuv420p")
    cb = planes[256 * 256 : 256 * 256 * 5 // 4].reshape(128, 128).mean(axis=1 - axis)
    blue = (cb - 128) / 224 * 1.8556 / (1 - 0.0722) * 255
    # Sample i stands for the blue of column 2 i (left) and of row 2 i + 1/2 (between the rows): H.264, figure 6-1.
    offset = np.mean((blue - 2 * np.arange(128))[8:-8])
    assert offset == pytest.approx(0.5 if axis == 0 else 0, abs=0.15)


def test_more_quality_is_a_larger_file_and_a_smaller_error(tmp_path: Path) -> None:
    pictures = moving() ^ np.random.default_rng(0).integers(0, 8, (NUM_FRAMES, HEIGHT, WIDTH, 3), dtype=np.uint8)
    files = [write(tmp_path / f"{quality}.mp4", pictures, quality=quality) for quality in (0, 5, 8, 10)]
    sizes = [file.stat().st_size for file in files]
    errors = [np.mean((decoded(file).reshape(pictures.shape) - pictures.astype(float)) ** 2) for file in files]
    assert sizes == sorted(sizes)
    assert errors == sorted(errors, reverse=True)
    assert all("h264 (High)" in description(file) for file in files)


@pytest.mark.parametrize(
    ("asked", "shown"), [(12.5, "12.50 fps"), (29.97, "29.97 fps"), (24000 / 1001, "23.98 fps"), (1, "1 fps")]
)
def test_an_mp4_keeps_its_rate(tmp_path: Path, asked: float, shown: str) -> None:
    assert f" {shown}," in description(write(tmp_path / "film.mp4", moving()[:3], asked))


def test_one_frame_is_a_film(tmp_path: Path) -> None:
    picture = moving()[:1]
    assert decoded(write(tmp_path / "film.mp4", picture)).size == picture.size
    gif = write(tmp_path / "film.gif", picture)
    assert shown_by_gif(gif).shape == picture.shape
    assert gif_delays(gif.read_bytes()) == [3]


@pytest.mark.parametrize(
    ("frames_per_second", "delay"), [(30, 3), (25, 4), (24, 4), (1000, 2), (40, 3), (1, 100), (0.001, 65535)]
)
def test_gif_delay_is_the_nearest_that_players_honour(tmp_path: Path, frames_per_second: float, delay: int) -> None:
    gif = write(tmp_path / "film.gif", moving()[:1], frames_per_second)
    assert gif_delays(gif.read_bytes()) == [delay]


def test_a_gif_loops_at_the_rate_that_its_note_says(tmp_path: Path) -> None:
    output = OutputSpec(tmp_path / "film.gif", frames_per_second=30)
    assert film_notes(output) == [
        "a GIF shows each frame for whole hundredths of a second: 33.33 frames per second, not 30"
    ]
    data = write(output.file, moving()).read_bytes()
    assert write(tmp_path / "again.gif", moving()).read_bytes() == data
    assert gif_delays(data) == [3] * NUM_FRAMES
    assert b"NETSCAPE2.0\x03\x01\x00\x00\x00" in data  # loops for ever
    assert film_notes(OutputSpec(output.file, frames_per_second=25)) == []
    assert film_notes(OutputSpec(tmp_path / "film.mp4", frames_per_second=30)) == []


def test_a_gif_shows_the_colours(tmp_path: Path) -> None:
    pictures = moving()
    error = shown_by_gif(write(tmp_path / "film.gif", pictures)) - pictures.astype(float)
    # Thousands of shades in 256 colours, root mean square in steps: a pixel was seen to be off by 4.9, and the mean
    # of 8 x 8, which dithering keeps, by 1.6.
    tiles = error.reshape(NUM_FRAMES, HEIGHT // 8, 8, WIDTH // 8, 8, 3).mean(axis=(2, 4))
    assert np.sqrt(np.mean(error**2)) < 6
    assert np.sqrt(np.mean(tiles**2)) < 2
