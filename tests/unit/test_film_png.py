"""PNG frames are exact and have straight alpha, and all get their names together."""

from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from png_files import noise, open_film

from renderer.film import encode_png, frame_path, png_chunks
from renderer.scene import OutputSpec


def test_no_chunk_describes_colour() -> None:
    assert [name for name, _ in png_chunks(encode_png(noise(1, 4, 4)))] == [b"IHDR", b"IDAT", b"IEND"]


def test_all_frames_get_their_names_together(tmp_path: Path) -> None:
    output = OutputSpec(tmp_path / "new" / "folder" / "{frame:04}.png", size=(6, 4), background=None)
    images = [noise(seed, 4, 6, 4) for seed in range(3)]
    frames = [2, 5, 11]
    paths = [tmp_path / "new" / "folder" / name for name in ("0002.png", "0005.png", "0011.png")]
    with open_film(output) as write:
        for frame, image in zip(frames, images, strict=True):
            write(frame, image)
            assert not any(path.exists() for path in paths)
    assert sorted(paths[0].parent.iterdir()) == paths
    for path, image in zip(paths, images, strict=True):
        np.testing.assert_array_equal(iio.imread(path), image)


def test_only_the_frame_field_is_replaced() -> None:
    assert frame_path(Path("a{b}/{frame:03}/{frame}.png"), 7) == Path("a{b}/007/7.png")


@pytest.mark.parametrize("field", ["{frame:zz}", "{frame:400000}", "{frame:4}", "{frame!r}", "{frame:}"])
def test_a_format_that_is_not_legal_is_part_of_the_name(field: str) -> None:
    assert frame_path(Path(f"{field}.png"), 7) == Path(f"{field}.png")
