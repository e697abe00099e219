"""Encode raw pictures as MP4 or GIF, with the ffmpeg that imageio-ffmpeg contains."""

from __future__ import annotations

import contextlib
import errno
import os
import signal
import subprocess
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path

import numpy as np
import numpy.typing as npt

from renderer.errors import HsplatError, RenderError
from renderer.film.atomic import output_error
from renderer.film.stream_tail import StreamTail
from renderer.system import address_space_hint, join_lines

# Without out_color_matrix, ffmpeg converts RGB with the BT.601 matrix, whatever the tags say. The chroma position is
# H.264's default, left; `accurate_rnd` and `bitexact` give the same result on every processor.
_TO_YUV = (
    "scale=out_color_matrix=bt709:out_range=limited:out_h_chr_pos=0:out_v_chr_pos=128"
    ":flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact,format=yuv420p,"
    "setparams=color_primaries=bt709:color_trc=bt709:colorspace=bt709:range=limited"
)
# x264's defaults keep the look of grain, which renderings do not have, at the cost of exact pixels. With these, films
# are some 0.5 dB closer to their frames at equal size (docs/benchmarks/encoding.md). Without any adaptive quantisation
# (AQ) it would be more, but black backgrounds would be lit in places at a low quality.
_X264_PARAMS = "psy=0:aq-strength=0.7:chroma-qp-offset=-4"
# x264's output depends on the number of threads, which by default is the number of cores.
_NUM_ENCODER_THREADS = 4

# One palette for each frame keeps memory independent of the length of the film. Of ffmpeg's ditherings this one kept
# local averages best on renderings of the engine CT: 52.8 dB after a 3 x 3 mean, against 51.2 without dithering and
# 50.8 with Bayer's.
_TO_PALETTE = (
    "split[pictures][samples];[samples]palettegen=stats_mode=single:reserve_transparent=0[palettes];"
    "[pictures][palettes]paletteuse=new=1:dither=sierra2_4a"
)
_SHORTEST_GIF_DELAY_CS = 2  # browsers show shorter delays as 10
_LONGEST_GIF_DELAY_CS = 65535  # 16 bits


def mp4_options(quality: float) -> list[str]:
    """Return ffmpeg's options for H.264 that plays everywhere, at `quality` 0 to 10.

    The constant rate factor (CRF) is `40 - 3 quality`. Quality 8 has CRF 16, which is visually lossless; two steps of
    quality lower the CRF by 6, which doubles the size of the file.
    """
    assert 0 <= quality <= 10, quality
    options = {"-vf": _TO_YUV, "-c:v": "libx264", "-preset": "medium", "-profile:v": "high"}
    options |= {"-crf": f"{40 - 3 * quality:g}", "-threads": str(_NUM_ENCODER_THREADS), "-x264-params": _X264_PARAMS}
    options |= {"-flags:v": "+bitexact", "-fflags": "+bitexact", "-movflags": "+faststart", "-f": "mp4"}
    return [word for option in options.items() for word in option]


def gif_options() -> list[str]:
    """Return ffmpeg's options for a GIF that loops forever."""
    return ["-vf", _TO_PALETTE, "-fflags", "+bitexact", "-loop", "0", "-f", "gif"]


def gif_delay_cs(frames_per_second: float) -> int:
    """Return how long a GIF shows each frame, in the hundredths of a second that players honour."""
    nearest = int(100 / frames_per_second + 0.5)
    return min(max(nearest, _SHORTEST_GIF_DELAY_CS), _LONGEST_GIF_DELAY_CS)


@contextlib.contextmanager
def open_encoder(
    size: tuple[int, int], frames_per_second: Fraction, options: Sequence[str], file: Path, output: Path
) -> Iterator[Callable[[npt.NDArray[np.uint8]], None]]:
    """Run ffmpeg, and yield a function that encodes a picture, uint8 [h, w, 3]; `file` is complete after the block.

    size: (width, height) of the pictures. output: the final name of the file, for messages.

    Raises RenderError with the end of ffmpeg's messages if it cannot start, stops early or fails. However the block
    ends, ffmpeg has ended too.
    """
    arguments = _arguments(size, frames_per_second, options, file)
    process = start_ffmpeg(arguments, output, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    assert process.stdin is not None and process.stderr is not None
    pictures, stderr_tail = process.stdin, StreamTail(process.stderr)

    def write(image: npt.NDArray[np.uint8]) -> None:
        try:
            pictures.write(image.tobytes())
            pictures.flush()
        except OSError as error:
            what = "ffmpeg stopped before the film was complete"
            raise _failure(what, process.wait(), stderr_tail.lines(), output) from error

    try:
        yield write
        pictures.close()
        if status := process.wait():
            raise _failure("ffmpeg could not complete the film", status, stderr_tail.lines(), output)
    finally:
        process.kill()
        process.wait()
        with contextlib.suppress(OSError):  # what is still buffered is lost
            pictures.close()


def _failure(what: str, status: int, lines: Sequence[str], output: Path) -> HsplatError:
    """Return the error for a failure of ffmpeg with this exit status, which printed these lines."""
    words = join_lines(lines)
    if os.strerror(errno.ENOSPC) in words:
        return output_error(OSError(errno.ENOSPC, words), output)
    exit_text = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
    return RenderError(what, where=str(output), got=words or f"{exit_text} and no message", hint=address_space_hint())


def _arguments(size: tuple[int, int], rate: Fraction, options: Sequence[str], file: Path) -> list[str]:
    width, height = size
    source = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", f"{width}x{height}", "-framerate", str(rate)]
    # `file:` protects names with a colon or a leading dash.
    general = ["-hide_banner", "-nostdin", "-loglevel", "error", "-y", "-filter_threads", "1"]
    return [*general, *source, "-i", "pipe:0", *options, f"file:{file}"]


def start_ffmpeg(arguments: Sequence[str], file: Path, *, stdin: int, stdout: int) -> subprocess.Popen[bytes]:
    """Start ffmpeg, which the caller has to end. Raises RenderError. file: for messages. stdin, stdout: as of Popen."""
    command = [find_ffmpeg(file), *arguments]
    try:
        # In a new session, Ctrl-C in the terminal does not reach ffmpeg.
        return subprocess.Popen(command, stdin=stdin, stdout=stdout, stderr=subprocess.PIPE, start_new_session=True)
    except OSError as error:
        raise RenderError("ffmpeg cannot be started", where=str(file), got=str(error)) from error


def find_ffmpeg(output: Path) -> str:
    """Return the path of ffmpeg. Raises RenderError if there is none. output: for messages."""
    import imageio_ffmpeg

    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise RenderError(
            "ffmpeg is missing",
            where=str(output),
            hint="install imageio-ffmpeg from a wheel, which contains it, or set IMAGEIO_FFMPEG_EXE to its path",
        ) from error
