"""A failure to write gives a clear error, and leaves no incomplete film, temporary file or ffmpeg."""

import errno
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from png_files import open_film

from renderer.errors import RenderError
from renderer.film import open_encoder, require_encoder, staged_files, write_staged
from renderer.scene import OutputSpec

PICTURE = np.zeros((64, 64, 3), np.uint8)
FAILED = "film.mp4: ffmpeg could not complete the film\n  got: "


def write_film(path: Path, num_frames: int = 3, stop: BaseException | None = None) -> None:
    with open_film(OutputSpec(path, size=(64, 64))) as write:
        for frame in range(num_frames):
            write(frame, PICTURE)
            if stop:
                raise stop


def assert_no_child_process() -> None:
    """Neither one that runs nor one that nobody has waited for; Python's own, which another test may start, stays."""
    children = Path(f"/proc/self/task/{os.getpid()}/children").read_text(encoding="ascii").split()
    assert [pid for pid in children if b"resource_tracker" not in Path(f"/proc/{pid}/cmdline").read_bytes()] == []


@pytest.mark.parametrize("name", ["film.mp4", "{frame}.png"])
def test_leaving_the_block_leaves_nothing(tmp_path: Path, name: str) -> None:
    with pytest.raises(KeyboardInterrupt):
        write_film(tmp_path / name, stop=KeyboardInterrupt())
    assert not list(tmp_path.iterdir())
    assert_no_child_process()


def test_a_failure_leaves_the_older_film_alone(tmp_path: Path) -> None:
    film = tmp_path / "film.mp4"
    film.write_bytes(b"older")
    with pytest.raises(KeyboardInterrupt):
        write_film(film, stop=KeyboardInterrupt())
    assert [path.read_bytes() for path in tmp_path.iterdir()] == [b"older"]
    write_film(film)
    assert film.stat().st_size > 500


@pytest.mark.parametrize(
    ("script", "message"),
    [
        ("exit 0", "stopped before the film was complete"),
        ("echo the reason >&2; exit 3", "the reason"),
        ("head -c 20000 > /dev/null; echo the reason >&2; exit 3", "the reason"),
        ("cat > /dev/null; echo first >&2; echo failed! >&2; exit 1", f"{FAILED}first\n    failed!$"),
        ("cat > /dev/null; exit 9", f"{FAILED}exit status 9 and no message$"),
        ("cat > /dev/null; kill -9 $$", f"{FAILED}signal SIGKILL and no message$"),
        ("yes 'a long complaint' | head -c 1000000 >&2; echo the reason >&2; exit 3", "the reason"),
    ],
)
def test_an_encoder_that_fails_gives_its_reason(tmp_path, fake_ffmpeg, script, message) -> None:
    fake_ffmpeg(script)
    with pytest.raises(RenderError, match=message) as caught:
        write_film(tmp_path / "film.mp4", num_frames=30)
    assert len(str(caught.value)) < 4000
    assert not list(tmp_path.iterdir())
    assert_no_child_process()


def test_an_encoder_that_cannot_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", "/absent")
    with pytest.raises(RenderError, match=r"film.mp4: ffmpeg cannot be started\n  got: .*No such file .*'/absent'$"):
        write_film(tmp_path / "film.mp4")


def test_an_ffmpeg_without_the_encoder_is_told_before_anything_is_drawn(tmp_path, fake_ffmpeg) -> None:
    output = OutputSpec(tmp_path / "film.mov", codec="hevc", background=None)
    require_encoder(output)
    fake_ffmpeg('echo "Supported pixel formats: yuv420p"')
    require_encoder(replace(output, background=(0.0, 0.0, 0.0)))
    with pytest.raises(RenderError, match="this ffmpeg cannot encode the film\n  got: no libx265 of yuva420p"):
        require_encoder(output)


def test_an_encoder_that_hangs_is_ended(tmp_path: Path, fake_ffmpeg: Callable[[str], None]) -> None:
    fake_ffmpeg("exec sleep 1000")
    with pytest.raises(KeyboardInterrupt):
        write_film(tmp_path / "film.mp4", num_frames=1, stop=KeyboardInterrupt())
    assert_no_child_process()


@pytest.mark.parametrize("suffix", ["mp4", "gif", "webm"])
def test_a_full_disk_under_ffmpeg(suffix: str, tmp_path: Path) -> None:
    output = OutputSpec(tmp_path / f"film.{suffix}", size=(64, 64))

    def encode() -> None:
        with open_encoder(output, Path("/dev/full")) as encode_picture:
            for _ in range(30):
                encode_picture(PICTURE)

    with pytest.raises(RenderError, match="the disk is full"):
        encode()
    assert_no_child_process()


@pytest.mark.parametrize(
    ("name", "number", "message"),
    [
        ("film.mp4", errno.EDQUOT, "the disk is full"),
        ("{frame}.png", errno.EROFS, "no permission"),
        ("film.gif", errno.EIO, "Input/output error"),
    ],
)
def test_a_rename_that_fails(tmp_path, monkeypatch, name: str, number: int, message: str) -> None:
    def refuse(source: object, target: object) -> None:
        raise OSError(number, os.strerror(number), str(source))

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(RenderError, match=message):
        write_film(tmp_path / name)
    assert not list(tmp_path.iterdir())


def test_a_folder_that_takes_no_files_is_told_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(path: Path) -> None:
        raise PermissionError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(Path, "touch", refuse)
    with pytest.raises(RenderError), open_film(OutputSpec(tmp_path / "film.mp4")):
        pytest.fail("found out too late")


def test_an_error_of_the_block_is_not_taken_for_one_of_the_output(tmp_path: Path) -> None:
    def read() -> None:
        with staged_files() as write:
            write(tmp_path / "file", b"")
            (tmp_path / "absent").read_bytes()

    with pytest.raises(FileNotFoundError):
        read()


def test_files_get_the_usual_permissions(tmp_path: Path) -> None:
    (tmp_path / "plain").touch()
    write_staged(tmp_path / "staged", b"content")
    assert (tmp_path / "staged").stat().st_mode == (tmp_path / "plain").stat().st_mode
