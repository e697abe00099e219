"""Encode raw pictures as a film, with the ffmpeg that imageio-ffmpeg contains."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import signal
import subprocess
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

from renderer.errors import HsplatError, RenderError
from renderer.film.atomic import output_error
from renderer.film.picture import Pixels
from renderer.film.stream_tail import StreamTail
from renderer.scene import FORMATS, OutputFile
from renderer.system import address_space_hint, join_lines

# The filter that converts RGB to YUV. Without out_color_matrix, ffmpeg uses the BT.601 matrix, whatever the tags say.
# The chroma position is H.264's default, left; `accurate_rnd` and `bitexact` give the same result on every processor.
_TO_YUV = (
    "scale=out_color_matrix=bt709:out_range={0}:out_h_chr_pos=0:out_v_chr_pos=128"
    ":flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact,format={1},"
    "setparams=color_primaries=bt709:color_trc=bt709:colorspace=bt709:range={0}"
)
# The filter that converts RGB to colours of a palette. A palette for each frame keeps memory independent of the length
# of the film. Of ffmpeg's ditherings, this one kept local averages best on renderings of the engine CT: 52.8 dB after a
# 3 x 3 mean, against 51.2 without dithering and 50.8 with Bayer's.
_TO_PALETTE = (
    "split[pictures][samples];[samples]palettegen=stats_mode=single:reserve_transparent=0[palettes];"
    "[pictures][palettes]paletteuse=new=1:dither=sierra2_4a"
)
# The filter that splits RGBA into a film of colours and a grey film of alpha, as AVIF stores alpha as a second film.
_TO_PLANES = "[0:v]split[all][same];[all]{0}[colors];[same]alphaextract,format=gray,setparams=range=full:{1}[alpha]"
# The parameters of ffmpeg's filter `setparams` that name the colour space of the grey film of alpha in an AVIF.
_GREY_COLORS = "color_primaries=bt709:color_trc=bt709:colorspace=bt709"
# The pixel formats of encoders that this process has asked for, by the path of ffmpeg and the name of the encoder. To
# ask takes 15 ms of processor time, as much as to encode a film of a few small pictures.
_PIXEL_FORMATS = dict[tuple[str, str], list[str]]()
# The shortest delay of a GIF's frame, in hundredths of a second. Browsers show a frame with a shorter delay for 10.
_SHORTEST_GIF_DELAY_CS = 2
# The longest delay of a GIF's frame, in hundredths of a second: the largest number of 16 bits.
_LONGEST_GIF_DELAY_CS = 65535


def encoder_options(output: OutputFile) -> list[str]:
    """Return ffmpeg's options for a film: filters, encoder and container."""
    codec, pixel_format, kind = output.chosen_codec, output.chosen_pixel_format, output.format.filters
    yuv = _TO_YUV.format(kind, pixel_format.replace("yuva444p", "yuv444p").replace("yuva420p", "yuv420p"))
    if output.format.has_alpha_plane and output.background is None:
        planes = _TO_PLANES.format(yuv, _GREY_COLORS)
        filters = ["-filter_complex", planes, "-map", "[colors]", "-map", "[alpha]"]
    else:
        direct = {"palette": _TO_PALETTE, "": f"format={pixel_format}"}
        filters = ["-vf", direct.get(kind, _TO_YUV.format(kind, pixel_format))]
    crf = output.chosen_crf
    rate = [] if crf is None else ["-crf", f"{crf:g}"]
    if codec.has_percent_quality:
        rate = ["-quality", f"{10 * output.quality:g}"]
    density = ["-dpi", str(round(output.dpi))] if codec.has_dpi and output.dpi else []
    exact = ["-flags:v", "+bitexact", "-fflags", "+bitexact"]
    return [*filters, "-c:v", codec.encoder, *rate, *codec.options, *density, *exact, *output.format.muxer]


def gif_delay_cs(frames_per_second: float) -> int:
    """Return the delay of each frame of a GIF in hundredths of a second, within the range that players support."""
    nearest = int(100 / frames_per_second + 0.5)
    return min(max(nearest, _SHORTEST_GIF_DELAY_CS), _LONGEST_GIF_DELAY_CS)


def frame_rate(output: OutputFile) -> Fraction:
    """Return the frame rate of a film: the possible rate of its format that is nearest to the requested one."""
    if output.format.ticks_per_second:
        return Fraction(100, gif_delay_cs(output.frames_per_second))
    # 29.97 becomes 30000/1001, as in television's rates, and other rates with two decimals stay exact.
    return Fraction(output.frames_per_second).limit_denominator(1001)


@contextlib.contextmanager
def open_encoder(output: OutputFile, file: Path) -> Iterator[Callable[[Pixels], None]]:
    """Run ffmpeg, and yield a function that encodes one more picture. The film is complete after the block.

    output: the output whose settings the film has; its `file` is the final name, for messages. file: the file to write.
    Raises RenderError with the end of ffmpeg's messages if it cannot start, stops early or fails. At the end of the
    block, ffmpeg has ended in any case.
    """
    arguments, name = _arguments(output, file), output.file
    process = start_ffmpeg(arguments, name, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    assert process.stdin is not None and process.stderr is not None
    pictures, stderr_tail = process.stdin, StreamTail(process.stderr)

    def write(image: Pixels) -> None:
        assert (image.shape, 8 * image.itemsize) == (output.kind.shape, output.kind.depth), (image.shape, output.kind)
        try:
            pictures.write(image.tobytes())
            pictures.flush()
        except OSError as error:
            what = "ffmpeg stopped before the film was complete"
            raise _failure(what, process.wait(), stderr_tail.lines(), name) from error

    try:
        yield write
        pictures.close()
        if status := process.wait():
            raise _failure("ffmpeg could not complete the film", status, stderr_tail.lines(), name)
    finally:
        process.kill()
        process.wait()
        with contextlib.suppress(OSError):  # ffmpeg is gone and cannot take bytes that are still in the buffer
            pictures.close()


def _failure(what: str, status: int, lines: Sequence[str], output: Path) -> HsplatError:
    """Return the error for a failure of ffmpeg, with its exit status and the lines that it printed."""
    words = join_lines(lines)
    if os.strerror(errno.ENOSPC) in words:
        return output_error(OSError(errno.ENOSPC, words), output)
    exit_text = f"signal {signal.Signals(-status).name}" if status < 0 else f"exit status {status}"
    return RenderError(what, where=str(output), got=words or f"{exit_text} and no message", hint=address_space_hint())


def _arguments(output: OutputFile, file: Path) -> list[str]:
    width, height = output.size
    raw = {8: ("rgb24", "rgba"), 16: ("rgb48le", "rgba64le")}[output.kind.depth][output.background is None]
    source = ["-f", "rawvideo", "-pix_fmt", raw, "-video_size", f"{width}x{height}"]
    source += ["-framerate", str(frame_rate(output))]
    # With `file:` before it, ffmpeg takes a name with a colon or a leading dash as a name.
    general = ["-hide_banner", "-nostdin", "-loglevel", "error", "-y", "-filter_threads", "1"]
    return [*general, *source, "-i", "pipe:0", *encoder_options(output), f"file:{file}"]


def require_codec(output: OutputFile) -> None:
    """Raise RenderError if there is no ffmpeg, or one that cannot encode a film."""
    encoder, wanted = output.chosen_codec.encoder, output.chosen_pixel_format
    if output.format.has_alpha_plane:
        wanted = wanted.replace("yuva", "yuv")
    key = (_find_ffmpeg(output.file), encoder)
    if not _PIXEL_FORMATS.get(key):
        _PIXEL_FORMATS[key] = _pixel_formats(encoder, output.file)
    if not {wanted, f"{wanted}le"}.intersection(_PIXEL_FORMATS[key]):
        what, got = "this ffmpeg cannot encode the film", f"no {encoder} of {wanted}"
        hint = "leave codec out, or install imageio-ffmpeg from a wheel, which contains another ffmpeg"
        raise RenderError(what, where=str(output.file), got=got, hint=hint)


def _pixel_formats(encoder: str, file: Path) -> list[str]:
    """Return the pixel formats that an encoder of ffmpeg takes. file: the name of the film, for messages."""
    asked = start_ffmpeg(
        ["-hide_banner", "-h", f"encoder={encoder}"], file, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE
    )
    with asked:
        found = re.search(rb"Supported pixel formats: (.*)", asked.communicate()[0])
    return found[1].decode(errors="replace").split() if found else []


class Ffmpeg(NamedTuple):
    """The ffmpeg that encodes films.

    path: its file. version: its version. lacking: the formats and codecs of films that it cannot encode, such as
        `.avif av1`.
    """

    path: str
    version: str
    lacking: list[str]


def describe_ffmpeg() -> Ffmpeg:
    """Describe the ffmpeg that encodes films. Raises RenderError if there is none, or if it fails."""
    name = Path("ffmpeg")
    with start_ffmpeg(["-encoders"], name, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE) as asked:
        listed, banner = asked.communicate()
    version = re.match(r"ffmpeg version (\S+)", banner.decode(errors="replace"))
    if asked.returncode != 0 or version is None:
        raise _failure("ffmpeg does not answer", asked.returncode, banner.decode(errors="replace").splitlines(), name)
    rows = [line.split() for line in listed.decode(errors="replace").splitlines()]
    encoders = {row[1] for row in rows if len(row) > 1}
    codecs = [(suffix, codec, each.encoder) for suffix, of in FORMATS.items() for codec, each in of.codecs.items()]
    lacking = [f"{suffix} {codec}" for suffix, codec, encoder in codecs if encoder not in encoders]
    return Ffmpeg(_find_ffmpeg(name), version[1], lacking)


def start_ffmpeg(arguments: Sequence[str], file: Path, *, stdin: int, stdout: int) -> subprocess.Popen[bytes]:
    """Start ffmpeg, which the caller has to end. Raises RenderError if it cannot start.

    file: the name of the film, for messages. stdin, stdout: the arguments of Popen.
    """
    command = [_find_ffmpeg(file), *arguments]
    try:
        # In a new session, Ctrl-C in the terminal does not reach ffmpeg.
        return subprocess.Popen(command, stdin=stdin, stdout=stdout, stderr=subprocess.PIPE, start_new_session=True)
    except OSError as error:
        raise RenderError("ffmpeg cannot be started", where=str(file), got=str(error)) from error


def _find_ffmpeg(output: Path) -> str:
    """Return the path of ffmpeg. Raises RenderError if there is none. output: the name of the film, for messages."""
    import imageio_ffmpeg

    try:
        return str(imageio_ffmpeg.get_ffmpeg_exe())
    except RuntimeError as error:
        raise RenderError(
            "ffmpeg is missing",
            where=str(output),
            hint="install imageio-ffmpeg from a wheel, which contains it, or set IMAGEIO_FFMPEG_EXE to its path",
        ) from error
