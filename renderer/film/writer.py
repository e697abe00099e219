"""Write finished frames to an MP4, a GIF or numbered PNGs, each complete or not there at all."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path

from renderer.film.atomic import staging, translate_os_errors
from renderer.film.encode import find_ffmpeg, gif_delay_cs, gif_options, mp4_options, open_encoder
from renderer.film.names import frame_path, has_frame_files, picture_shape
from renderer.film.picture import Picture
from renderer.scene import OutputSpec

WriteFrame = Callable[[int, Picture], None]


def require_encoder(output: OutputSpec) -> None:
    """Raise RenderError if the output needs an encoder that is missing."""
    if not has_frame_files(output):
        find_ffmpeg(output.file)


@contextlib.contextmanager
def open_film(
    output: OutputSpec,
    frames: Sequence[int],
    *,
    staging_folder: Path | None = None,
    before_rename: Callable[[], None] = lambda: None,
) -> Iterator[WriteFrame]:
    """Yield a function that writes the next frame; it takes the frame's number and picture.

    All frames must be written, in this order. Files get their final names at the end of the block, one by one, when all
    are complete. If the block raises, KeyboardInterrupt included, nothing is left. Raises InputError if the name of
    the output cannot be a file, RenderError if it cannot be written or the encoder fails. A power failure may damage
    frames in files, which are known by their digests.

    staging_folder: on the same disk, for incomplete files; None for beside the output.
    before_rename: called when everything is written, before files get their final names.
    """
    open_writer = _open_pngs if has_frame_files(output) else _open_video
    remaining = iter(frames)
    with staging(staging_folder, is_durable=not has_frame_files(output)) as stage:
        with open_writer(output, stage) as write:

            def write_next(frame: int, picture: Picture) -> None:
                assert frame == next(remaining, None), f"frame {frame} is not the next one"
                write(frame, picture)

            yield write_next
            assert next(remaining, None) is None, "frames are missing"
        before_rename()


@contextlib.contextmanager
def _open_pngs(output: OutputSpec, stage: Callable[[Path], Path]) -> Iterator[WriteFrame]:
    def write(frame: int, picture: Picture) -> None:
        path = frame_path(output.file, frame)
        with translate_os_errors(path):
            stage(path).write_bytes(picture.png)

    yield write


@contextlib.contextmanager
def _open_video(output: OutputSpec, stage: Callable[[Path], Path]) -> Iterator[WriteFrame]:
    assert output.background is not None, "only PNG can be transparent"
    if _is_gif(output):
        options = gif_options()
    else:
        assert all(length % 2 == 0 for length in output.size), f"{output.size}: yuv420p needs even sizes"
        options = mp4_options(output.quality)
    with open_encoder(output.size, _frame_rate(output), options, stage(output.file), output.file) as encode:

        def write(_: int, picture: Picture) -> None:
            assert picture.pixels.shape == picture_shape(output), f"{picture.pixels.shape}, not {picture_shape(output)}"
            encode(picture.pixels)

        yield write


def film_notes(output: OutputSpec) -> list[str]:
    """Return a note where a GIF cannot have the frame rate that was requested."""
    rate = _frame_rate(output)
    if not _is_gif(output) or abs(rate - output.frames_per_second) < 0.005:
        return []
    shown = f"{float(rate):.2f} frames per second, not {output.frames_per_second:g}"
    return [f"a GIF shows each frame for whole hundredths of a second: {shown}"]


def _is_gif(output: OutputSpec) -> bool:
    return output.file.suffix.lower() == ".gif"


def _frame_rate(output: OutputSpec) -> Fraction:
    if _is_gif(output):
        return Fraction(100, gif_delay_cs(output.frames_per_second))
    # A few decimals are enough to find television's fractions of 1001; rates with two decimals stay exact.
    return Fraction(output.frames_per_second).limit_denominator(1001)
