"""Messages about outputs that cannot be written."""

import errno
import os
from pathlib import Path

import numpy as np
import pytest
from png_files import open_film

from renderer.errors import HsplatError
from renderer.film import quantize, require_writable, require_writable_dry_run, translate_os_errors
from renderer.scene import OutputSpec


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (errno.ENOSPC, "out/film.mp4: the disk is full\n  hint: free some space, or write to another disk"),
        (errno.EACCES, "out/film.mp4: no permission to write here\n  hint: choose another folder for the output"),
        (errno.EISDIR, "out/film.mp4: the output is a folder\n  expected: the name of a file"),
        (errno.ENOTDIR, "out/film.mp4: the output folder is a file\n  got: out"),
        (errno.EIO, "out/film.mp4: the output cannot be written\n  got: Input/output error"),
    ],
)
def test_what_the_system_refuses(number: int, text: str) -> None:
    with pytest.raises(HsplatError) as caught, translate_os_errors(Path("out/film.mp4")):
        raise OSError(number, os.strerror(number))
    assert str(caught.value) == text


def test_the_file_that_stands_for_a_folder_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    path = tmp_path / "file" / "deeper" / "film.mp4"
    with pytest.raises(HsplatError) as caught:
        require_writable(path)
    assert str(caught.value) == f"{path}: the output folder is a file\n  got: {tmp_path / 'file'}"


def test_ffmpeg_is_not_there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent() -> str:
        raise RuntimeError("No ffmpeg exe could be found.")

    monkeypatch.setattr("imageio_ffmpeg.get_ffmpeg_exe", absent)
    path = tmp_path / "film.mp4"
    with pytest.raises(HsplatError) as caught, open_film(OutputSpec(path)):
        pytest.fail("found out too late")
    assert str(caught.value) == (
        f"{path}: ffmpeg is missing\n"
        "  hint: install imageio-ffmpeg from a wheel, which contains it, or set IMAGEIO_FFMPEG_EXE to its path"
    )


def test_pixels_that_are_not_numbers() -> None:
    image = np.zeros((4, 5, 4), np.float32)
    image[2, 3:, 1] = np.nan
    with pytest.raises(HsplatError) as caught:
        quantize(image, None)
    assert str(caught.value) == (
        "the picture has pixels that are not finite numbers\n"
        "  got: 2 of 20 pixels, the first at row 2, column 3: [0.0, nan, 0.0, 0.0]\n"
        "  hint: this is a bug in hsplat or in the graphics driver; please report it with the scene file"
    )


def test_a_file_of_somebody_else_in_a_sticky_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As in /tmp, where a rename would fail when all frames are drawn."""
    file = tmp_path / "film.mp4"
    file.touch()
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    for check in (require_writable, require_writable_dry_run):
        check(file)
        tmp_path.chmod(0o1777)
        with pytest.raises(HsplatError, match="no permission to write here"):
            check(file)
        check(tmp_path / "another.mp4")
        tmp_path.chmod(0o777)
