"""Raw pictures to MP4 and GIF through the ffmpeg that imageio-ffmpeg brings along."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
from collections.abc import Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import numpy.typing as npt

from renderer.errors import HsplatError, RenderError
from renderer.film.atomic import output_error
from renderer.film.stream_tail import StreamTail

# ffmpeg converts RGB with the BT.601 matrix unless it is told, whatever the tags say. The chroma position is H.264's
# default, left; `accurate_rnd` and `bitexact` make the result the same on every processor.
_TO_YUV = (
    "scale=out_color_matrix=bt709:out_range=limited:out_h_chr_pos=0:out_v_chr_pos=128"
    ":flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact,format=yuv420p,"
    "setparams=color_primaries=bt709:color_trc=bt709:colorspace=bt709:range=limited"
)
# x264's output depends on the number of threads, and by default that is the number of cores.
_NUM_ENCODER_THREADS = 4

# One palette a frame, so that memory does not grow with the film. Of ffmpeg's ditherings this one kept local averages
# best on renderings of the engine CT: 52.8 dB after a 3 x 3 mean, against 51.2 without dithering and 50.8 with Bayer's.
_TO_PALETTE = (
    "split[pictures][samples];[samples]palettegen=stats_mode=single:reserve_transparent=0[palettes];"
    "[pictures][palettes]paletteuse=new=1:dither=sierra2_4a"
)
_SHORTEST_GIF_DELAY_CS = 2  # browsers show shorter delays as 10
_LONGEST_GIF_DELAY_CS = 65535  # 16 bits


def mp4_options(quality: float) -> list[str]:
    """ffmpeg's options for H.264 that plays everywhere, at `quality` 0 to 10.

    The constant rate factor is `40 - 3 quality`, so that 8 is 16, visually lossless, and two steps of quality double
    the size of the file (a CRF 6 lower does).
    """
    assert 0 <= quality <= 10, quality
    options = {"-vf": _TO_YUV, "-c:v": "libx264", "-preset": "medium", "-profile:v": "high"}
    options |= {"-crf": f"{40 - 3 * quality:g}", "-threads": str(_NUM_ENCODER_THREADS)}
    options |= {"-flags:v": "+bitexact", "-fflags": "+bitexact", "-movflags": "+faststart", "-f": "mp4"}
    return [word for option in options.items() for word in option]


def gif_options() -> list[str]:
    """ffmpeg's options for a GIF that loops for ever."""
    return ["-vf", _TO_PALETTE, "-fflags", "+bitexact", "-loop", "0", "-f", "gif"]


def gif_delay_cs(frames_per_second: float) -> int:
    """The time a GIF shows each frame: the nearest whole number of hundredths of a second that players honour."""
    nearest = int(100 / frames_per_second + 0.5)
    return min(max(nearest, _SHORTEST_GIF_DELAY_CS), _LONGEST_GIF_DELAY_CS)


@contextlib.contextmanager
def open_encoder(
    size: tuple[int, int], frames_per_second: Fraction, options: Sequence[str], file: Path, output: Path
) -> Iterator[Encoder]:
    """ffmpeg, writing the pictures it is given to `file`, which is complete after the block.

    size: (width, height) of the pictures.
    output: its final name, for messages.

    Raises RenderError with ffmpeg's last words when it cannot start, stops early or fails. However the block ends,
    ffmpeg has ended too.
    """
    command = [find_ffmpeg(output), *_arguments(size, frames_per_second, options, file)]
    encoder = Encoder(_start(command, output), output)
    try:
        yield encoder
        encoder.finish()
    finally:
        encoder.kill()


class Encoder:
    """A running ffmpeg; made by `open_encoder`."""

    def __init__(self, process: subprocess.Popen[bytes], output: Path) -> None:
        assert process.stdin is not None
        assert process.stderr is not None
        self._process, self._pictures, self._output = process, process.stdin, output
        self._stderr_tail = StreamTail(process.stderr)

    def write(self, image: npt.NDArray[np.uint8]) -> None:
        """Encode one picture, uint8 [h, w, 3]."""
        try:
            self._pictures.write(image.tobytes())
            self._pictures.flush()
        except OSError as error:
            raise self._failure("ffmpeg stopped before the film was complete") from error

    def finish(self) -> None:
        """Tell ffmpeg that this was all and wait until its file is complete."""
        try:
            self._pictures.close()
        except OSError as error:
            raise self._failure("ffmpeg stopped before the film was complete") from error
        if self._process.wait() != 0:
            raise self._failure("ffmpeg could not complete the film")

    def kill(self) -> None:
        """End ffmpeg, whatever it is doing; does nothing when it has ended."""
        self._process.kill()
        self._process.wait()
        # What is still buffered has nowhere to go.
        with contextlib.suppress(OSError):
            self._pictures.close()

    def _failure(self, what: str) -> HsplatError:
        status = self._process.wait()
        words = "\n    ".join(self._stderr_tail.lines())  # to stand in a message
        if os.strerror(errno.ENOSPC) in words:
            return output_error(OSError(errno.ENOSPC, words), self._output)
        return RenderError(what, where=str(self._output), got=words or f"{_exit_description(status)} and no message")


def _exit_description(status: int) -> str:
    return f"signal {signal.Signals(-status).name}" if -status in set(signal.Signals) else f"exit status {status}"


def _arguments(size: tuple[int, int], rate: Fraction, options: Sequence[str], file: Path) -> list[str]:
    width, height = size
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", f"{width}x{height}", "-framerate", str(rate)]
    # `file:` keeps a name with a colon or a leading dash from being taken for something else.
    general = ["-hide_banner", "-nostdin", "-loglevel", "error", "-y", "-filter_threads", "1"]
    return [*general, *source, "-i", "pipe:0", *options, f"file:{file}"]


def _start(command: Sequence[str], output: Path) -> subprocess.Popen[bytes]:
    try:
        # A session of its own: Ctrl-C in the terminal is for us, and we end ffmpeg when we are done with it.
        return subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            start_new_session=True,
        )
    except OSError as error:
        raise RenderError("ffmpeg cannot be started", where=str(output), got=str(error)) from error


def find_ffmpeg(output: Path) -> str:
    """The program; raises RenderError where there is none. output: for messages."""
    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise RenderError(
            "there is no ffmpeg",
            where=str(output),
            hint="install imageio-ffmpeg from a wheel, which contains it, or name one in IMAGEIO_FFMPEG_EXE",
        ) from error
