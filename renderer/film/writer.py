"""Write finished frames to an MP4, a GIF or numbered PNGs, each complete or not there at all."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

from renderer.film.atomic import require_writable, staging, translate_os_errors
from renderer.film.encode import find_ffmpeg, gif_delay_cs, gif_options, mp4_options, open_encoder
from renderer.film.names import frame_path, has_frame_files, picture_shape
from renderer.film.png import encode_png
from renderer.scene import OutputSpec

Image = npt.NDArray[np.uint8]


class FilmWriter:
    """Takes the frames of one film in order; made by `open_film`.

    put: writes a frame. notes: what the user should know about the files, such as a frame rate that differs from the
    one asked for.
    """

    def __init__(
        self, output: OutputSpec, frames: Sequence[int], put: Callable[[int, Image], object], notes: Sequence[str] = ()
    ) -> None:
        self._shape, self._put = picture_shape(output), put
        self._frames, self._num_written = tuple(frames), 0
        self.notes = tuple(notes)

    def write(self, frame: int, image: Image) -> None:
        """Write the next frame: uint8 [h, w, 3], with a transparent background [h, w, 4] with straight alpha.

        Raises RenderError if it cannot be written or the encoder fails.
        """
        assert not self.is_complete, f"frame {frame} is one too many"
        assert frame == self._frames[self._num_written], f"frame {frame} came, not {self._frames[self._num_written]}"
        assert image.dtype == np.uint8, image.dtype
        assert image.shape == self._shape, f"{image.shape}, not {self._shape}"
        self._put(frame, image)
        self._num_written += 1

    @property
    def is_complete(self) -> bool:
        """Whether all frames were written."""
        return self._num_written == len(self._frames)


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
) -> Iterator[FilmWriter]:
    """Yield a writer for `frames`, all of which must be written, in this order.

    Files get their final names at the end of the block, one by one, when all are complete. If the block raises,
    KeyboardInterrupt included, nothing is left. Whether the output can be written is tried at once. Raises InputError
    if its name cannot be a file, RenderError if it cannot be written.

    staging_folder: on the same disk, for incomplete files; None for beside the output.
    before_rename: called when everything is written, before files get their final names.
    """
    open_writer = _open_pngs if has_frame_files(output) else _open_video
    with staging(staging_folder) as stage:
        if has_frame_files(output) and frames:
            require_writable(frame_path(output.file, frames[0]), staging_folder)
        with open_writer(output, frames, stage) as writer:
            yield writer
            assert writer.is_complete, "frames are missing"
        before_rename()


@contextlib.contextmanager
def _open_pngs(output: OutputSpec, frames: Sequence[int], stage: Callable[[Path], Path]) -> Iterator[FilmWriter]:
    assert len({frame_path(output.file, frame) for frame in frames}) == len(frames), "frames share a file"

    def put(frame: int, image: Image) -> None:
        path, content = frame_path(output.file, frame), encode_png(image)
        with translate_os_errors(path):
            stage(path).write_bytes(content)

    yield FilmWriter(output, frames, put)


@contextlib.contextmanager
def _open_video(output: OutputSpec, frames: Sequence[int], stage: Callable[[Path], Path]) -> Iterator[FilmWriter]:
    assert output.background is not None, "only PNG can be transparent"
    rate, options, notes = _gif(output) if output.file.suffix.lower() == ".gif" else _mp4(output)
    with open_encoder(output.size, rate, options, stage(output.file), output.file) as encoder:
        yield FilmWriter(output, frames, lambda _, image: encoder.write(image), notes)


def _mp4(output: OutputSpec) -> tuple[Fraction, list[str], list[str]]:
    """Return the frame rate, ffmpeg's options and notes."""
    assert output.file.suffix.lower() == ".mp4", output.file
    assert all(length % 2 == 0 for length in output.size), f"{output.size}: yuv420p needs even sizes"
    # A few decimals are enough to find television's fractions of 1001; rates with two decimals stay exact.
    return Fraction(output.frames_per_second).limit_denominator(1001), mp4_options(output.quality), []


def _gif(output: OutputSpec) -> tuple[Fraction, list[str], list[str]]:
    """Return the frame rate, ffmpeg's options and notes."""
    rate = Fraction(100, gif_delay_cs(output.frames_per_second))
    same = abs(rate - output.frames_per_second) < 0.005
    note = (
        f"a GIF shows each frame for whole hundredths of a second: {float(rate):.2f} frames per second, "
        f"not {output.frames_per_second:g}"
    )
    return rate, gif_options(), [] if same else [note]
