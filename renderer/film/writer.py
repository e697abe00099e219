"""Finished frames to files: an MP4, a GIF or numbered PNGs, each complete or not there at all."""

from __future__ import annotations

import contextlib
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

from renderer.film.atomic import require_writable, staged_file, staged_files
from renderer.film.encode import Encoder, find_ffmpeg, gif_delay_cs, gif_options, mp4_options, open_encoder
from renderer.film.names import frame_path, has_frame_files, picture_shape
from renderer.film.png import encode_png
from renderer.scene import OutputSpec


class FilmWriter(ABC):
    """Takes the frames of one film in order; made by `open_film`.

    notes: what the user should know about the files, such as a frame rate that differs from the one asked for.
    """

    def __init__(self, output: OutputSpec, frames: Sequence[int], notes: Sequence[str] = ()) -> None:
        self._shape = picture_shape(output)
        self._frames, self._num_written = tuple(frames), 0
        self.notes = tuple(notes)

    def write(self, frame: int, image: npt.NDArray[np.uint8]) -> None:
        """Take the next frame: uint8 [h, w, 3], with a transparent background [h, w, 4] with straight alpha.

        Raises RenderError when it cannot be written or the encoder fails.
        """
        assert not self.complete, f"frame {frame} is one too many"
        assert frame == self._frames[self._num_written], f"frame {frame} came, not {self._frames[self._num_written]}"
        assert image.dtype == np.uint8, image.dtype
        assert image.shape == self._shape, f"{image.shape}, not {self._shape}"
        self._put(frame, image)
        self._num_written += 1

    @property
    def complete(self) -> bool:
        """Whether all frames have come."""
        return self._num_written == len(self._frames)

    @abstractmethod
    def _put(self, frame: int, image: npt.NDArray[np.uint8]) -> None: ...


def require_encoder(output: OutputSpec) -> None:
    """Raise RenderError where the output needs an encoder that is not there."""
    if not has_frame_files(output):
        find_ffmpeg(output.file)


@contextlib.contextmanager
def open_film(
    output: OutputSpec,
    frames: Sequence[int],
    *,
    within: Path | None = None,
    finishing: Callable[[], None] = lambda: None,
) -> Iterator[FilmWriter]:
    """A writer for `frames`, all of which must come, in this order.

    The files have their final names, one after the other, when all are complete, at the end of the block. If it raises,
    KeyboardInterrupt included, nothing is left. That the output can be written is tried at once. Raises InputError when
    its name cannot be a file, RenderError when it cannot be written.

    within: a folder on the same disk for what is not complete, if not beside the output.
    finishing: called at the end of the block when all is written, before files get their final names.
    """
    opened = (_open_png if has_frame_files(output) else _open_video)(output, frames, within, finishing)
    with opened as writer:
        yield writer
        assert writer.complete, "frames are missing"


@contextlib.contextmanager
def _open_png(
    output: OutputSpec, frames: Sequence[int], within: Path | None, finishing: Callable[[], None]
) -> Iterator[FilmWriter]:
    with staged_files(within) as write_file:
        yield _PngWriter(output, frames, write_file, within)
        finishing()


class _PngWriter(FilmWriter):
    def __init__(
        self, output: OutputSpec, frames: Sequence[int], write_file: Callable[[Path, bytes], None], within: Path | None
    ) -> None:
        super().__init__(output, frames)
        self._template, self._write_file = output.file, write_file
        assert len({frame_path(self._template, frame) for frame in frames}) == len(frames), "frames share a file"
        for frame in frames[:1]:
            require_writable(frame_path(self._template, frame), within)

    def _put(self, frame: int, image: npt.NDArray[np.uint8]) -> None:
        self._write_file(frame_path(self._template, frame), encode_png(image))


class _VideoWriter(FilmWriter):
    def __init__(self, output: OutputSpec, frames: Sequence[int], notes: Sequence[str], encoder: Encoder) -> None:
        super().__init__(output, frames, notes)
        self._encoder = encoder

    def _put(self, frame: int, image: npt.NDArray[np.uint8]) -> None:
        self._encoder.write(image)


@contextlib.contextmanager
def _open_video(
    output: OutputSpec, frames: Sequence[int], within: Path | None, finishing: Callable[[], None]
) -> Iterator[FilmWriter]:
    assert output.background is not None, "only PNG can be transparent"
    rate, options, notes = _gif(output) if output.file.suffix.lower() == ".gif" else _mp4(output)
    with staged_file(output.file, within) as temporary:
        with open_encoder(output.size, rate, options, temporary, output.file) as encoder:
            yield _VideoWriter(output, frames, notes, encoder)
        finishing()


def _mp4(output: OutputSpec) -> tuple[Fraction, list[str], list[str]]:
    """Frame rate, ffmpeg's options and notes."""
    assert output.file.suffix.lower() == ".mp4", output.file
    assert all(length % 2 == 0 for length in output.size), f"{output.size}: yuv420p needs even sizes"
    # Television's fractions of 1001 are found from a few decimals, and rates with two decimals are kept exactly.
    return Fraction(output.frames_per_second).limit_denominator(1001), mp4_options(output.quality), []


def _gif(output: OutputSpec) -> tuple[Fraction, list[str], list[str]]:
    """Frame rate, ffmpeg's options and notes."""
    rate = Fraction(100, gif_delay_cs(output.frames_per_second))
    same = abs(rate - output.frames_per_second) < 0.005
    note = (
        f"a GIF shows each frame for whole hundredths of a second: {float(rate):.2f} frames per second, "
        f"not {output.frames_per_second:g}"
    )
    return rate, gif_options(), [] if same else [note]
